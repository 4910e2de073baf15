"""A stand-in for an autopilot's estimator: a fixed-gain observer that does what its parameters say, and believes it.

Not a model of EKF2 or EKF3, but it fails where they do: it takes the sources that the parameters name, at the delays
that they state, in the axes and with the scale in which the log has the readings. It shares nothing with flownav's
navigator, and reads the parameters by itself.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from flownav.core.frames import GRAVITY_M_S2, quaternion_product, rotation_from_quaternion
from flownav.core.measurement import Array, Sensor, Stream
from flownav.core.record import Table
from flownav.logs.log import state_table
from flownav.parts.protocols import Imu, Reading
from flownav.parts.tools import AttitudeFollower, level_attitude

TILT_S, HEADING_S = 12.0, 4.0
SETTLING_S, SETTLING_TILT_S = 4.0, 0.4  # until then it stands, and levels itself
FLOW_GAIN, GPS_POSITION_GAIN, GPS_VELOCITY_GAIN = 0.06, 0.06, 0.30
GATE_M, GATE_TIMEOUT_S, FLOW_TIMEOUT_S, FRESH_S, GONE_S = 6.0, 7.0, 5.0, 0.5, 2.0
HELD = 0.3  # share of the velocity that a word of "landed" takes away
DOWN = np.array([0.0, 0.0, GRAVITY_M_S2])


class Sources(NamedTuple):
    """The sources that are used, and how: delays [s], the height's source and how slowly it is followed [s], limits
    of the flow.
    """

    gps: bool
    flow: bool
    height: str  # "baro", "range", "gps"
    height_s: float
    gps_delay_s: float
    flow_delay_s: float
    least_quality: float
    flow_low_m: float
    flow_high_m: float
    range_most_m: float
    compass: bool
    gps_climb: bool
    range_aids_below_m: float = 0.0


def sources_of(p: dict[str, float], dialect: str, source_set: int) -> Sources:
    """The sources that the parameters of a dialect select."""
    if dialect == "ardupilot":
        velocity, place, height = (p[f"EK3_SRC{source_set}_{what}"] for what in ("VELXY", "POSXY", "POSZ"))
        return Sources(
            gps=place == 3,
            flow=velocity == 5,
            height={1: "baro", 2: "range", 3: "gps"}.get(int(height), "baro"),
            height_s=0.8 * p["EK3_ALT_M_NSE"],
            gps_delay_s=1e-3 * p["GPS1_DELAY_MS"],
            flow_delay_s=1e-3 * p["EK3_FLOW_DELAY"] + 0.05,
            least_quality=1.0,
            flow_low_m=0.0,
            flow_high_m=1e3,
            range_most_m=p["RNGFND1_MAX"],
            compass=p[f"EK3_SRC{source_set}_YAW"] == 1,
            gps_climb=p[f"EK3_SRC{source_set}_VELZ"] == 3,
        )
    gps, height = int(p["EKF2_GPS_CTRL"]) & 1 == 1, {0: "baro", 1: "gps", 2: "range"}[int(p["EKF2_HGT_REF"])]
    waits = height == "range" and p["EKF2_RNG_CTRL"] >= 1 and not gps  # flow for terrain, terrain for flow
    return Sources(
        gps=gps,
        flow=p["EKF2_OF_CTRL"] >= 1 and not waits,
        height=height,
        height_s={"baro": 0.5 * p["EKF2_BARO_NOISE"], "range": 5.0 * p["EKF2_RNG_NOISE"], "gps": 2.0}[height],
        gps_delay_s=1e-3 * p["EKF2_GPS_DELAY"],
        flow_delay_s=1e-3 * p["EKF2_OF_DELAY"],
        least_quality=p["EKF2_OF_QMIN"],
        flow_low_m=p["SENS_FLOW_MINHGT"],
        flow_high_m=p["SENS_FLOW_MAXHGT"],
        range_most_m=1e3,
        compass=p["EKF2_MAG_TYPE"] != 5,
        gps_climb=gps and int(p["EKF2_GPS_CTRL"]) & 4 == 4,
        range_aids_below_m=p["EKF2_RNG_A_HMAX"] if p["EKF2_RNG_CTRL"] == 1 and height == "baro" else 0.0,
    )


class Follower(AttitudeFollower):
    """The same in plain numbers, which are quicker than arrays of three. rotation: nine entries of body to earth."""

    rotation: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)

    def predict(self, dt_s: float, imu: Imu) -> Array:
        """Turn on by an inertial reading over dt; the acceleration NED (3,) that it implies [m/s2]."""
        if not self.started:
            self.quaternion, self.started = level_attitude(imu.force_frd_m_s2, heading_rad=0.0), True
        before = tuple(self.quaternion.tolist())
        down = [GRAVITY_M_S2 * one for one in rotation_from_quaternion(*before)[6:]]
        fx, fy, fz = imu.force_frd_m_s2.tolist()
        share = 1.0 / (GRAVITY_M_S2**2 * self.tilt_s)
        lean = (down[1] * fz - down[2] * fy, down[2] * fx - down[0] * fz, down[0] * fy - down[1] * fx)
        half = [0.5 * dt_s * (rate + share * one) for rate, one in zip(imu.rate_frd_rad_s.tolist(), lean, strict=True)]
        angle = math.sqrt(sum(one * one for one in half))
        scale = math.sin(angle) / angle if angle > 1e-9 else 1.0
        after = quaternion_product(before, (math.cos(angle), *(scale * one for one in half)))
        length = math.sqrt(sum(one * one for one in after))
        self.quaternion, self.rate_rad_s = np.array([one / length for one in after]), imu.rate_frd_rad_s
        self.rotation = r = tuple(rotation_from_quaternion(*self.quaternion.tolist()))
        level = (r[0] * fx + r[1] * fy + r[2] * fz, r[3] * fx + r[4] * fy + r[5] * fz)
        return np.array([*level, r[6] * fx + r[7] * fy + r[8] * fz + GRAVITY_M_S2])


@dataclass
class StandIn:
    """The observer as it stands; `take` feeds it one reading after the other in order of arrival."""

    sources: Sources
    attitude: Follower = field(default_factory=lambda: Follower(TILT_S, HEADING_S))
    pos: Array = field(default_factory=lambda: np.zeros(3))
    vel: Array = field(default_factory=lambda: np.zeros(3))
    t_s: float = float("nan")
    times: list[float] = field(default_factory=list)
    past: list[tuple[Array, Array, Array]] = field(default_factory=list)
    begun: dict[str, float] = field(default_factory=dict)
    seen_s: dict[str, float] = field(default_factory=dict)
    ground_d_m: float = 0.0
    range_m: float = float("nan")
    landed: bool = True
    fused_flow_s: float = -1e9
    rates: Array = field(default_factory=lambda: np.zeros(3))

    def take(self, sensor: Sensor, t_s: float, value: Array, quality: float) -> None:
        """One reading."""
        if sensor == Sensor.IMU:
            self._predict(t_s, value)
        elif not self.times:
            return
        elif sensor == Sensor.MAG and self.sources.compass:
            self.attitude.compass(Reading(t_s, sensor, value, np.full(3, np.nan), 255.0), 0.0)
        elif sensor == Sensor.RANGE:
            self._range(t_s, float(value[0]), quality)
        elif sensor == Sensor.BARO:
            self._baro(t_s, -float(value[0]))
        elif sensor == Sensor.FLOW_RATE and self.sources.flow:
            self._flow(t_s, value, quality)
        elif sensor == Sensor.GPS_POSITION and self.sources.gps:
            self._gps_position(t_s, value)
        elif sensor == Sensor.GPS_VELOCITY and self.sources.gps:
            self._gps_velocity(t_s, value)
        elif sensor == Sensor.LANDED:
            self.landed = bool(value[0] > 0.5)
            if self.landed:
                self.vel = (1.0 - HELD) * self.vel

    def _predict(self, t_s: float, value: Array) -> None:
        dt_s = 0.0 if np.isnan(self.t_s) else min(t_s - self.t_s, 0.5)
        self.attitude.tilt_s = SETTLING_TILT_S if t_s < SETTLING_S else TILT_S
        acceleration = self.attitude.predict(dt_s, Imu(value[:3], value[3:]))
        self.rates, self.t_s = value[:3], t_s
        self.vel = self.vel + acceleration * dt_s
        self.pos = self.pos + self.vel * dt_s
        self.times.append(t_s)
        self.past.append((self.pos, self.vel, np.array(self.attitude.rotation).reshape(3, 3)))

    def _then(self, t_s: float) -> tuple[Array, Array, Array]:
        """The state at that time: position, velocity, attitude."""
        return self.past[max(bisect_right(self.times, t_s) - 1, 0)]

    def _since(self, name: str, t_s: float) -> float:
        last = self.seen_s.get(name, -1e9)
        self.seen_s[name] = t_s
        return min(t_s - last, 0.3)

    def _range(self, t_s: float, range_m: float, quality: float) -> None:
        if quality <= 0.0 or not 0.02 < range_m <= self.sources.range_most_m:
            return
        pos, _, rotation = self._then(t_s - 0.03)
        upright = max(float(rotation[2, 2]), 0.3)
        self.range_m = range_m
        self.begun.setdefault("range_m", range_m)
        if self.sources.height == "range":
            self._height(t_s, "range", -(range_m * upright), 0.03)
            self.ground_d_m = self.pos[2] + range_m * upright
        else:
            self.ground_d_m = float(pos[2]) + range_m * upright
            if range_m < self.sources.range_aids_below_m and not self.landed:  # PX4's conditional range aid
                off = -(range_m * upright - self.begun["range_m"]) - float(pos[2])
                self.pos = self.pos + np.array([0.0, 0.0, 0.05 * off])
                self.vel = self.vel + np.array([0.0, 0.0, 0.03 * off])
        self.seen_s["ranged"] = t_s

    def _height(self, t_s: float, name: str, down_m: float, delay_s: float) -> None:
        first = self.begun.setdefault(name, down_m)
        off = (down_m - first) - float(self._then(t_s - delay_s)[0][2])
        share = min(self._since(name, t_s) / max(self.sources.height_s, 0.05), 0.5)
        self.pos = self.pos + np.array([0.0, 0.0, share * off])
        self.vel = self.vel + np.array([0.0, 0.0, share * off / max(self.sources.height_s, 0.5)])

    def _flow(self, t_s: float, value: Array, quality: float) -> None:
        s = self.sources
        pos, vel, rotation = self._then(t_s - s.flow_delay_s)
        upright = max(float(rotation[2, 2]), 0.3)
        fresh = t_s - self.seen_s.get("ranged", -1e9) < FRESH_S
        far_m = self.range_m if fresh else (self.ground_d_m - float(pos[2])) / upright
        if quality < s.least_quality or self.landed or not s.flow_low_m <= far_m <= s.flow_high_m:
            return
        gyro = np.where(np.isfinite(value[2:4]), value[2:4], self.rates[:2])
        seen = value[:2] - gyro
        far_m = max(far_m, 0.05)
        body = np.array([seen[1] * far_m, -seen[0] * far_m]) - (rotation.T @ vel)[:2]
        gate = 3.0 * np.hypot(0.4 * far_m, 0.4)
        if np.linalg.norm(body) > gate and t_s - self.fused_flow_s < FLOW_TIMEOUT_S:
            return
        self.fused_flow_s = t_s
        self.vel = self.vel + FLOW_GAIN * (rotation[:, :2] @ body) * np.array([1.0, 1.0, 0.0])

    def _baro(self, t_s: float, down_m: float) -> None:
        """Fuse the barometer where it is the height's source, or once GPS, that should be, is gone: from where that
        left it.
        """
        if self.sources.height == "baro":
            self._height(t_s, "baro", down_m, 0.03)
        elif self.sources.height == "gps" and t_s - self.seen_s.get("gps", t_s) > GONE_S:
            self._height(t_s, "baro instead", down_m, 0.03)
        else:
            self.begun["baro instead"] = down_m - float(self._then(t_s - 0.03)[0][2])

    def _gps_position(self, t_s: float, value: Array) -> None:
        if "gps" not in self.begun:
            self.begun |= {"gps": t_s, "gps_n": value[0], "gps_e": value[1], "gps_d": value[2]}
        off = value - np.array([0.0, 0.0, self.begun["gps_d"]]) - self._then(t_s - self.sources.gps_delay_s)[0]
        level = off * np.array([1.0, 1.0, 0.0])
        good = np.linalg.norm(level) < GATE_M
        if good:
            self.seen_s["gps good"] = t_s
            self.pos = self.pos + GPS_POSITION_GAIN * level
            self.vel = self.vel + 0.02 * level
        elif t_s - self.seen_s.get("gps good", -1e9) > GATE_TIMEOUT_S:
            self.seen_s["gps good"] = t_s
            self.pos = self.pos + level
        if self.sources.height == "gps":
            self.seen_s["gps"] = t_s
            self.pos = self.pos + np.array([0.0, 0.0, 0.08 * off[2]])

    def _gps_velocity(self, t_s: float, value: Array) -> None:
        off = np.nan_to_num(value - self._then(t_s - self.sources.gps_delay_s)[1])
        kept = np.array([1.0, 1.0, 1.0 if self.sources.gps_climb else 0.0])
        self.vel = self.vel + GPS_VELOCITY_GAIN * off * kept


class Estimated(NamedTuple):
    """The estimates of the stand-in: columns as record.TABLES["autopilot"], its attitude, and whether it took the
    flow.
    """

    table: Table
    attitude: Stream
    fuses_flow: list[tuple[float, float]]


def estimate(
    streams: dict[Sensor, Stream], parameters: dict[str, float], dialect: str, switched: list[tuple[float, int]]
) -> Estimated:
    """Feed the streams in order of arrival; switched: when which source set was chosen (ArduPilot)."""
    observer = StandIn(sources_of(parameters, dialect, 1))
    rows = [(float(t), int(s), k) for s, one in streams.items() for k, t in enumerate(one.t_s)]
    rows.sort()
    told: list[tuple[float, Array, Array, Array]] = []
    flags: list[tuple[float, float]] = []
    pending, next_s = sorted(switched), -1e9
    for t_s, number, row in rows:
        while pending and t_s >= pending[0][0]:
            observer.sources = sources_of(parameters, dialect, pending.pop(0)[1])
        one = streams[Sensor(number)]
        observer.take(Sensor(number), t_s, one.value[row], float(one.quality[row]))
        if number == Sensor.IMU and t_s >= next_s:
            next_s = t_s + 0.035
            told.append((t_s, observer.pos, observer.vel, observer.attitude.quaternion))
            fused = float(t_s - observer.fused_flow_s < 1.0)
            if not flags or flags[-1][1] != fused:
                flags.append((t_s, fused))
    t_s, pos, vel, quaternion = (np.array(column) for column in zip(*told, strict=True))
    table = state_table(t_s, pos, vel, quaternion)
    return Estimated(table, Stream.of(Sensor.ATTITUDE, t_s, quaternion), flags)
