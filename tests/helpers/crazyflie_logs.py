"""Made flights as logs of the Crazyflie's micro SD deck: a writer of its format, apart from the package's reader."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from zlib import crc32

import numpy as np

GRAVITY = 9.80665
RAD_PER_COUNT = 0.71674 / 35.0 / 10.0  # mm_flow.c: thetapix, Npix, ten counts a pixel
READ_EVERY_S = 0.01


@dataclass
class DeckLog:
    """Kinds of blocks: name, variables with type letters, rows of (time [s], values)."""

    version: int = 2
    kinds: list[tuple[str, list[str], list[tuple[float, tuple[float, ...]]]]] = field(default_factory=list)

    def add(self, name: str, variables: list[str], t_s, *columns) -> DeckLog:
        rows = list(zip(map(float, t_s), zip(*columns, strict=True), strict=True))
        self.kinds.append((name, variables, rows))
        return self

    def content(self) -> bytes:
        out = [b"\xbc", struct.pack("<HH", self.version, len(self.kinds))]
        blocks = []
        for number, (name, variables, rows) in enumerate(self.kinds):
            out += [struct.pack("<H", number), name.encode() + b"\0", struct.pack("<H", len(variables))]
            out += [variable.encode() + b"\0" for variable in variables]
            letters = [variable[-2] for variable in variables]
            for t, values in rows:
                time = struct.pack("<I", round(1e3 * t)) if self.version == 1 else struct.pack("<Q", round(1e6 * t))
                packed = [v if letter in "fd" else round(v) for v, letter in zip(values, letters, strict=True)]
                blocks.append((t, struct.pack("<H", number) + time + struct.pack(f"<{''.join(letters)}", *packed)))
        blocks.sort(key=lambda block: block[0])
        whole = b"".join([*out, *(block for _, block in blocks)])
        return whole + struct.pack("<I", crc32(whole))


def counts_of(flow_rad_s: np.ndarray) -> np.ndarray:
    """Whole counts of 10 ms each; what is cut off is seen in the next, as the sensor goes on from where it looked."""
    seen = np.cumsum(flow_rad_s * READ_EVERY_S / RAD_PER_COUNT)
    return np.diff(np.rint(seen), prepend=0.0)


def quantised(tables: dict[str, dict[str, np.ndarray]]) -> dict[str, dict[str, np.ndarray]]:
    """The flight as such a log can say it: no GPS, flow in whole counts without a gyro, range in millimetres."""
    kept = {name: dict(tables[name]) for name in ("attitude", "imu", "range", "baro", "mag")}
    flow = tables["flow"]
    kept["flow"] = {"t_s": flow["t_s"], "quality": np.full(len(flow["t_s"]), 80.0)} | {
        f"flow_{axis}_rad_s": counts_of(flow[f"flow_{axis}_rad_s"]) * RAD_PER_COUNT / READ_EVERY_S for axis in "xy"
    }
    kept["range"]["range_m"] = np.rint(1e3 * kept["range"]["range_m"]) * 1e-3
    return kept


def deck_log(tables: dict[str, dict[str, np.ndarray]], version: int = 2, boot_s: float = 30.0,
             truth: dict[str, np.ndarray] | None = None) -> DeckLog:  # fmt: skip
    """The tables of `quantised` in the deck's units and axes (FLU, x north, y west, z up), 100 Hz of flow."""
    imu, attitude, flow = tables["imu"], tables["attitude"], tables["flow"]
    log = DeckLog(version)
    names = [f"{group}.{axis}(f)" for group in ("gyro", "acc") for axis in "xyz"]
    sign = {"x": 1.0, "y": -1.0, "z": -1.0}
    gyro = [np.degrees(sign[axis] * imu[f"gyro_{axis}_rad_s"]) for axis in "xyz"]
    acc = [sign[axis] * imu[f"accel_{axis}_m_s2"] / GRAVITY for axis in "xyz"]
    log.add("fixedFrequency", names, imu["t_s"] + boot_s, *gyro, *acc)
    angles = [np.degrees(attitude[f"{name}_rad"]) for name in ("roll", "pitch", "yaw")]
    log.add("attitude", ["stateEstimate.roll(f)", "stateEstimate.pitch(f)", "stateEstimate.yaw(f)"],
            attitude["t_s"] + boot_s, angles[0], angles[1], -angles[2])  # fmt: skip
    counts = {axis: np.rint(flow[f"flow_{axis}_rad_s"] * READ_EVERY_S / RAD_PER_COUNT) for axis in "xy"}
    log.add("estFlow", ["motion.deltaX(h)", "motion.deltaY(h)", "motion.squal(B)"], flow["t_s"] + boot_s,
            -counts["x"], -counts["y"], flow["quality"])  # fmt: skip
    log.add("estTOF", ["range.zrange(H)"], tables["range"]["t_s"] + boot_s, 1e3 * tables["range"]["range_m"])
    log.add("estBarometer", ["baro.asl(f)"], tables["baro"]["t_s"] + boot_s, tables["baro"]["alt_m"])
    field_gauss = [sign[axis] * 1e-3 * tables["mag"][f"mag_{axis}_mgauss"] for axis in "xyz"]
    log.add("magnetometer", [f"mag.{axis}(f)" for axis in "xyz"], tables["mag"]["t_s"] + boot_s, *field_gauss)
    if truth is not None:
        log.add("estPosition", [f"locSrv.{axis}(f)" for axis in "xyz"], truth["t_s"] + boot_s,
                truth["n"], -truth["e"], -truth["d"])  # fmt: skip
    return log


# -- the logger of the estimator's events ----------------------------------------------------------------------
FOUND = {  # dataset_config.txt of utiasDSL/util-uwb-dataset: each event's payload, then what it names
    "estTDOA": ["idA(B)", "idB(B)", "distanceDiff(f)"],
    "estPosition": ["source(B)", *(f"{group}.{axis}(f)" for group in ("locSrv", "lighthouse") for axis in "xyz")],
    "estPose": [f"locSrv.{name}(f)" for name in ("x", "y", "z", "qx", "qy", "qz", "qw")],
    "estDistance": ["id(B)", "distance(f)"],
    "estTOF": ["range.zrange(H)"],
    "estAbsoluteHeight": [],
    "estFlow": ["motion.deltaX(h)", "motion.deltaY(h)"],
    "estYawError": ["yawError(f)"],
    "estSweepAngle": ["sensorId(B)", "baseStationId(B)", "sweepId(B)", "t(f)", "sweepAngle(f)"],
    "estGyroscope": [f"gyro.{axis}(f)" for axis in "xyz"],
    "estAcceleration": [f"acc.{axis}(f)" for axis in "xyz"],
    "estBarometer": ["baro.asl(f)"],
}


def event_log(tables: dict[str, dict[str, np.ndarray]], pose: dict[str, np.ndarray] | None = None, *,
              version: int = 2, boot_s: float = 30.0, lost: float = 0.0, seed: int = 1) -> DeckLog:  # fmt: skip
    """The tables of `quantised` as the estimator's events write them (src/modules/src/estimator/estimator.c).

    Gyro and accelerometer apart by some microseconds, the barometer at the gyro's rate with its last value, flow only
    where a read saw motion. pose: t_s, n, e, d and the quaternion qw ... qz of FRD to NED. lost: the share of blocks
    for which the deck's buffer had no room.
    """
    imu, flow, sign = tables["imu"], tables["flow"], {"x": 1.0, "y": -1.0, "z": -1.0}
    counts = {axis: np.rint(flow[f"flow_{axis}_rad_s"] * READ_EVERY_S / RAD_PER_COUNT) for axis in "xy"}
    moved = (counts["x"] != 0) | (counts["y"] != 0)
    last = np.maximum(np.searchsorted(tables["baro"]["t_s"], imu["t_s"], side="right") - 1, 0)
    rows = {
        "estGyroscope": (imu["t_s"], *(np.degrees(sign[axis] * imu[f"gyro_{axis}_rad_s"]) for axis in "xyz")),
        "estAcceleration": (imu["t_s"] + 60e-6, *(sign[axis] * imu[f"accel_{axis}_m_s2"] / GRAVITY for axis in "xyz")),
        "estBarometer": (imu["t_s"] + 90e-6, tables["baro"]["alt_m"][last]),
        "estTOF": (tables["range"]["t_s"], 1e3 * tables["range"]["range_m"]),
        "estFlow": (flow["t_s"][moved], -counts["x"][moved], -counts["y"][moved]),
    }
    if pose is not None:
        rows["estPose"] = (pose["t_s"], pose["n"], -pose["e"], -pose["d"],
                           pose["qx"], -pose["qy"], -pose["qz"], pose["qw"])  # fmt: skip
    log, draw = DeckLog(version), np.random.default_rng(seed)
    for name, variables in FOUND.items():
        t_s, *columns = rows.get(name, (np.zeros(0), *(np.zeros(0) for _ in variables)))
        kept = draw.random(len(t_s)) >= lost
        log.add(name, variables, t_s[kept] + boot_s, *(column[kept] for column in columns))
    return log
