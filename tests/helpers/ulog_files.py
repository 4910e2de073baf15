"""A small ULog writer for tests, apart from the package's reader: topics with chosen fields, instances and damage."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

CODES = {
    "float": "f", "double": "d", "uint64_t": "Q", "uint32_t": "I", "int32_t": "i", "uint16_t": "H", "int16_t": "h",
    "uint8_t": "B", "int8_t": "b", "bool": "?", "char": "c",
}  # fmt: skip
START_US = 5_000_000


@dataclass
class Written:
    """One instance of a topic: fields as "type name" or "type[n] name" with columns (n,) or (n, k)."""

    name: str
    fields: dict[str, np.ndarray]
    t_s: np.ndarray
    instance: int = 0


@dataclass
class UlogWriter:
    """Bytes of a ULog: definitions, parameters, announcements, then data in time order."""

    topics: list[Written] = field(default_factory=list)
    parameters: dict[str, float | int] = field(default_factory=dict)
    start_us: int = START_US

    def add(self, name: str, t_s, instance: int = 0, **columns) -> UlogWriter:
        """Fields by keyword `type__name`, or `type__name` with a two-dimensional column for an array."""
        fields = {key.replace("__", " ", 1): np.asarray(value) for key, value in columns.items()}
        self.topics.append(Written(name, fields, np.asarray(t_s, float), instance))
        return self

    def bytes(self, *, in_order: bool = True) -> bytes:
        head = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", self.start_us)
        out = [head, message("B", bytes(40))]
        defined = set()
        for topic in self.topics:
            if topic.name not in defined:
                defined.add(topic.name)
                out.append(message("F", f"{topic.name}:{';'.join(self._types(topic))};".encode()))
        for key, value in self.parameters.items():
            kind, code = ("int32_t", "i") if isinstance(value, int) else ("float", "f")
            text = f"{kind} {key}".encode()
            out.append(message("P", bytes([len(text)]) + text + struct.pack(f"<{code}", value)))
        rows = []
        for number, topic in enumerate(self.topics):
            out.append(message("A", struct.pack("<BH", topic.instance, number) + topic.name.encode()))
            for k, t in enumerate(topic.t_s):
                rows.append((t, message("D", struct.pack("<H", number) + self._row(topic, k))))
        if in_order:
            rows.sort(key=lambda row: row[0])
        return b"".join(out) + b"".join(row for _, row in rows)

    def write(self, path: Path, *, in_order: bool = True) -> Path:
        path.write_bytes(self.bytes(in_order=in_order))
        return path

    def _types(self, topic: Written) -> list[str]:
        types = ["uint64_t timestamp"]
        for key, values in topic.fields.items():
            kind, name = key.split(" ")
            types.append(f"{kind}[{values.shape[1]}] {name}" if values.ndim == 2 else f"{kind} {name}")
        return types

    def _row(self, topic: Written, k: int) -> bytes:
        out = [struct.pack("<Q", self.start_us + round(1e6 * topic.t_s[k]))]
        for key, values in topic.fields.items():
            code = CODES[key.split(" ")[0]]
            row = np.atleast_1d(values[k] if values.ndim else values)
            numbers = row.tolist() if code in "fd?" else [round(float(v)) for v in row]
            out.append(struct.pack(f"<{len(numbers)}{code}", *numbers))
        return b"".join(out)


def message(kind: str, payload: bytes) -> bytes:
    """One ULog message."""
    return struct.pack("<HB", len(payload), ord(kind)) + payload


def in_us(t_s) -> np.ndarray:
    """Microseconds of the writer's clock, for fields such as timestamp_sample."""
    return START_US + 1e6 * np.asarray(t_s, float)


def ulog_of_flight(tables: dict[str, dict[str, np.ndarray]], *, old: bool = False) -> UlogWriter:
    """The tables of `replay_logs.log_of_flight` as PX4 logs them: today's topics, or those of ten years ago."""
    from flownav.core.frames import quaternion_from_euler

    writer = UlogWriter()
    attitude, imu, gps, flow = (tables[name] for name in ("attitude", "imu", "gps", "flow"))
    angles = [attitude[name] for name in ("roll_rad", "pitch_rad", "yaw_rad")]
    writer.add("vehicle_attitude", attitude["t_s"], float__q=np.column_stack(quaternion_from_euler(*angles)))
    rates, force = (np.column_stack([imu[f"{what}_{a}_{unit}"] for a in "xyz"])
                    for what, unit in (("gyro", "rad_s"), ("accel", "m_s2")))  # fmt: skip
    dt_s = np.full(len(flow["t_s"]), float(np.median(np.diff(flow["t_s"]))))
    seen = np.column_stack([flow["flow_x_rad_s"], flow["flow_y_rad_s"]]) * dt_s[:, None]
    turned = np.column_stack([flow["gyro_x_rad_s"], flow["gyro_y_rad_s"], 0.0 * dt_s]) * dt_s[:, None]
    velocity = {f"float__vel_{a}_m_s": gps[f"vel_{a}_m_s"] for a in "ned"}
    accuracy = {"float__eph": 0.0 * gps["t_s"] + 0.8, "float__epv": 0.0 * gps["t_s"] + 1.5,
                "float__s_variance_m_s": 0.0 * gps["t_s"] + 0.3, "uint8_t__fix_type": gps["fix_type"],
                "bool__vel_ned_valid": gps["fix_type"] > 0}  # fmt: skip
    if old:
        writer.add("sensor_combined", imu["t_s"], float__gyro_rad=rates, float__accelerometer_m_s2=force)
        writer.add("vehicle_gps_position", gps["t_s"], int32_t__lat=1e7 * gps["lat_deg"],
                   int32_t__lon=1e7 * gps["lon_deg"], int32_t__alt=1e3 * gps["alt_m"], **velocity,
                   **accuracy)  # fmt: skip
        writer.add("optical_flow", flow["t_s"], float__pixel_flow_x_integral=seen[:, 0],
                   float__pixel_flow_y_integral=seen[:, 1], float__gyro_x_rate_integral=turned[:, 0],
                   float__gyro_y_rate_integral=turned[:, 1], float__gyro_z_rate_integral=turned[:, 2],
                   uint32_t__integration_timespan=1e6 * dt_s, uint8_t__quality=flow["quality"])  # fmt: skip
        writer.add("sensor_baro", tables["baro"]["t_s"], float__altitude=tables["baro"]["alt_m"])
    else:
        dt_us = np.full(len(imu["t_s"]), 5000)
        writer.add("vehicle_imu", imu["t_s"], float__delta_angle=5e-3 * rates, float__delta_velocity=5e-3 * force,
                   uint32_t__delta_angle_dt=dt_us, uint16_t__delta_velocity_dt=dt_us)  # fmt: skip
        writer.add("sensor_gps", gps["t_s"], double__latitude_deg=gps["lat_deg"], double__longitude_deg=gps["lon_deg"],
                   double__altitude_msl_m=gps["alt_m"], **velocity, **accuracy)  # fmt: skip
        writer.add("vehicle_optical_flow", flow["t_s"], uint64_t__timestamp_sample=in_us(flow["t_s"] - 0.004),
                   float__pixel_flow=seen, float__delta_angle=turned, uint32_t__integration_timespan_us=1e6 * dt_s,
                   uint8_t__quality=flow["quality"])  # fmt: skip
        writer.add("vehicle_air_data", tables["baro"]["t_s"], float__baro_alt_meter=tables["baro"]["alt_m"])
    distance = tables["range"]
    writer.add("distance_sensor", distance["t_s"], float__current_distance=distance["range_m"],
               float__min_distance=0.0 * distance["t_s"] + 0.1, float__max_distance=0.0 * distance["t_s"] + 12.0,
               uint8_t__orientation=0 * distance["t_s"] + 25)  # fmt: skip
    field_gauss = 1e-3 * np.column_stack([tables["mag"][f"mag_{a}_mgauss"] for a in "xyz"])
    if old:
        columns = {f"float__{a}": field_gauss[:, k] for k, a in enumerate("xyz")}
        return writer.add("sensor_mag", tables["mag"]["t_s"], **columns)
    return writer.add("vehicle_magnetometer", tables["mag"]["t_s"], float__magnetometer_ga=field_gauss)
