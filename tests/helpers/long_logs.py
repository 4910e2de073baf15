"""A log of hours at a kilohertz, written piece by piece: a hover that repeats itself every PERIOD_S, as a PX4 ULog."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from replay_logs import log_of_flight
from ulog_files import START_US, UlogWriter, ulog_of_flight

PERIOD_S = 20.0
NOISE = {
    "float gyro_rad": 0.02, "float accelerometer_m_s2": 0.3, "float current_distance": 0.01, "float altitude": 0.1,
    "float pixel_flow_x_integral": 1e-3, "float pixel_flow_y_integral": 1e-3, "int32_t lat": 3.0, "int32_t lon": 3.0,
    "int32_t alt": 500.0, "float vel_n_m_s": 0.05, "float vel_e_m_s": 0.05, "float vel_d_m_s": 0.05,
}  # fmt: skip
KINDS = {
    "float": "<f4", "double": "<f8", "int32_t": "<i4", "uint32_t": "<u4", "uint16_t": "<u2", "uint8_t": "u1",
    "bool": "u1",
}  # fmt: skip


def hover(t_s: np.ndarray) -> np.ndarray:
    """A slow eight, 2 m wide and 3 m above the ground."""
    turn = 2.0 * np.pi / PERIOD_S * t_s
    return np.column_stack([np.sin(turn), 0.7 * np.sin(2.0 * turn), -3.0 + 0.2 * np.cos(turn)])


def write_long_ulog(path: Path, duration_s: float = 7200.0, imu_hz: float = 1000.0, seed: int = 1) -> Path:
    """A hover with an IMU of `imu_hz`, attitude at 50 Hz, flow and range at 20 Hz, barometer at 10 and GPS at 5 Hz.

    Its readings have noise, the same in every period.
    """
    topics = _topics(imu_hz, np.random.default_rng(seed))
    writer = UlogWriter()
    for name, fields in topics.items():
        empty = {key.replace(" ", "__"): column[:0] for key, column in fields.items() if key != "at_s"}
        writer.add(name, np.zeros(0), **empty)
    rows = {name: _rows(number, fields) for number, (name, fields) in enumerate(topics.items())}
    with path.open("wb") as file:
        file.write(writer.bytes())
        for begun_s in np.arange(0.0, duration_s, PERIOD_S):
            for second in range(int(PERIOD_S)):
                for table in rows.values():
                    inside = table[(table["at_s"] >= second) & (table["at_s"] < second + 1.0)]
                    stamped = inside["row"].copy()
                    stamped["timestamp"] = START_US + np.round(1e6 * (begun_s + inside["at_s"])).astype(np.uint64)
                    file.write(stamped.tobytes())
    return path


def _topics(imu_hz: float, draws: np.random.Generator) -> dict[str, dict[str, np.ndarray]]:
    """The topics of one period: columns by "type name", the rows' times under "at_s"."""
    flown = log_of_flight(2.0 * PERIOD_S, imu_hz=imu_hz, yaw_rate=0.0, along=hover)
    tables = {}
    for name, table in flown.tables.items():
        middle = (table["t_s"] >= 0.5 * PERIOD_S - 1e-9) & (table["t_s"] < 1.5 * PERIOD_S - 1e-9)
        tables[name] = {key: column[middle] for key, column in table.items()}
        tables[name]["t_s"] = tables[name]["t_s"] - 0.5 * PERIOD_S
    writer = ulog_of_flight(tables, old=True)
    found = {}
    for topic in writer.topics:
        fields = {key: np.asarray(column, float) for key, column in topic.fields.items()}
        for key, sigma in NOISE.items():
            if key in fields:
                fields[key] = fields[key] + sigma * draws.standard_normal(fields[key].shape)
        found[topic.name] = {"at_s": topic.t_s, **fields}
    return found


def _rows(number: int, fields: dict[str, np.ndarray]) -> np.ndarray:
    """The messages of one topic over one period, and when each stands [s]."""
    columns = {key: column for key, column in fields.items() if key != "at_s"}
    layout = [(key.split()[1], KINDS[key.split()[0]], column.shape[1:]) for key, column in columns.items()]
    whole = np.dtype([("length", "<u2"), ("kind", "u1"), ("topic", "<u2"), ("timestamp", "<u8"), *layout])
    rows = np.zeros(len(fields["at_s"]), np.dtype([("at_s", float), ("row", whole)]))
    rows["at_s"] = fields["at_s"]
    rows["row"]["length"], rows["row"]["kind"], rows["row"]["topic"] = whole.itemsize - 3, ord("D"), number
    for key, column in columns.items():
        rows["row"][key.split()[1]] = column
    return rows
