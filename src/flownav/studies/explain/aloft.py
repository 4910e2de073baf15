"""When a logged vehicle was aloft and how it moved, by what measures neither flow nor is asked about."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from flownav.core.errors import InputError
from flownav.core.frames import GRAVITY_M_S2, rotation_from_quaternion, to_earth
from flownav.core.measurement import Array, Sensor, Stream
from flownav.core.record import POSITION_NED, QUATERNION, VELOCITY_BODY
from flownav.logs.log import Log, attitude_at, attitude_rates
from flownav.replays.bundle import with_attitude
from flownav.studies.explain.autopilot_settings import AutopilotSettings, settings_stated
from flownav.studies.explain.sign import Window
from flownav.studies.explain.signals import (
    Flags,
    gap_near,
    running_median,
    stretches,
)

LIFTED_M, LIFTED_BY_OTHERS_M, GROUND_RANGE_M = 0.15, 0.6, 0.6
LEAST_LONGEST, JUMP_M, JUMP_SHARE = 5, 0.3, 0.1
CROWD_S, CROWD_STEPS, CROWD_SHARE = 0.25, 2.5, 0.4
LEAST_ROWS = 200
START_ROWS = 20
FLAG_LATE_S = 3.0  # a flag of landing follows so late


def without_echo(range_m: Array) -> Flags:
    """Readings (n,) of exactly the longest range, entered by a jump: what a sensor says that hears nothing."""
    longest = range_m == float(range_m.max(initial=0.0))
    found = np.zeros(len(range_m), bool)
    for first, last in stretches(longest):
        before = range_m[first - 1] if first > 0 else range_m[min(last + 1, len(range_m) - 1)]
        if last - first >= LEAST_LONGEST and range_m[first] - before > JUMP_M + JUMP_SHARE * before:
            found[first : last + 1] = True
    return found


def crowded(t_s: Array) -> Flags:
    """Readings (n,) with two in five of the usual number of neighbours."""
    if len(t_s) < START_ROWS:
        return np.ones(len(t_s), bool)
    step = float(np.median(np.diff(t_s)))
    half = max(CROWD_S, CROWD_STEPS * step)
    count = np.searchsorted(t_s, t_s + half, side="right") - np.searchsorted(t_s, t_s - half)
    return np.asarray(count >= CROWD_SHARE * 2.0 * half / max(step, 1e-4))


class Own(NamedTuple):
    """The autopilot's own estimate: position, velocity NED (n, 3); told_velocity: which is no slope of places."""

    t_s: Array
    pos_ned_m: Array
    vel_ned_m_s: Array
    states_velocity: bool


@dataclass(frozen=True)
class Aloft:
    """A log, its rates, forces and heights, and its flight."""

    log: Log

    @cached_property
    def own_settings(self) -> AutopilotSettings:
        """The autopilot's settings, as read from its parameters."""
        return settings_stated(self.log.parameters)

    @cached_property
    def attitude(self) -> Stream | None:
        """The log's attitude, else the navigator's own of it."""
        if Sensor.ATTITUDE in self.log.streams:
            return self.log.streams[Sensor.ATTITUDE]
        try:
            return with_attitude(self.log)[0].streams.get(Sensor.ATTITUDE)
        except InputError:
            return None

    def stream(self, sensor: Sensor) -> Stream | None:
        """A sensor's readings; None where the log has fewer than two."""
        found = self._imu_once if sensor == Sensor.IMU else self.log.streams.get(sensor)
        return found if found is not None and len(found) > 1 else None

    @cached_property
    def _imu_once(self) -> Stream | None:
        """Inertial readings, each instant once: a flooded link leaves many copies of one."""
        imu = self.log.streams.get(Sensor.IMU)
        if imu is None or (np.diff(imu.t_s) > 0.0).all():
            return imu
        t_s, first = np.unique(imu.t_s, return_index=True)
        return replace(imu, t_s=t_s, value=imu.value[first], variance=imu.variance[first], quality=imu.quality[first])

    # -- rates and forces ----------------------------------------------------------------------------------------
    @cached_property
    def rates(self) -> tuple[Array, Array] | None:
        """Body rates (n, 3): the IMU's, else those by which the attitude turns."""
        imu = self.stream(Sensor.IMU)
        if imu is not None and len(imu) > LEAST_ROWS:
            return imu.t_s - imu.delay_s, imu.value[:, :3]
        a = self.attitude
        if a is None or len(a) < LEAST_ROWS:
            return None
        later = np.flatnonzero(np.diff(a.t_s) > 1e-4)
        start, end = a.t_s[later], a.t_s[later + 1]
        return 0.5 * (start + end), attitude_rates(a, start, end)

    def rotation(self, t_s: Array) -> Any:
        """Nine entries of body to earth at instants; ask only where there is an attitude."""
        assert self.attitude is not None
        return rotation_from_quaternion(*attitude_at(self.attitude, t_s).T)

    def attitude_yaw(self, t_s: float) -> float:
        """The attitude's heading at an instant [rad]."""
        r = self.rotation(np.array([t_s]))
        return float(np.arctan2(r[3][0], r[0][0]))

    @cached_property
    def inertial_velocity(self) -> tuple[Array, Array] | None:
        """The IMU's acceleration in earth axes integrated (n, 3): right over a second or two."""
        imu = self.stream(Sensor.IMU)
        if imu is None or self.attitude is None or len(imu) < LEAST_ROWS:
            return None
        t_s = imu.t_s - imu.delay_s
        force: Array = np.column_stack(to_earth(self.rotation(t_s), *imu.value[:, 3:].T))
        force[:, 2] += GRAVITY_M_S2
        steps = 0.5 * (force[1:] + force[:-1]) * np.minimum(np.diff(t_s), 0.2)[:, None]
        return t_s, np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])

    # -- heights -------------------------------------------------------------------------------------------------
    @cached_property
    def ranges(self) -> tuple[Array, Array] | None:
        """Instants and metres of the ranges with data: single echoes among readings without any are none."""
        stream = self.stream(Sensor.RANGE)
        if stream is None:
            return None
        good = (stream.quality > 0.0) & (stream.value[:, 0] > 0.0) & ~without_echo(stream.value[:, 0])
        good[good] = crowded(stream.t_s[good])
        return (stream.t_s[good] - stream.delay_s, stream.value[good, 0]) if good.sum() > START_ROWS else None

    @cached_property
    def range_height(self) -> tuple[Array, Array] | None:
        """Height above the ground below by the range, upright (n,), without single echoes."""
        if self.ranges is None:
            return None
        t_s, range_m = self.ranges
        upright = np.clip(self.rotation(t_s)[8], 0.3, 1.0) if self.attitude is not None else np.ones(len(t_s))
        return t_s, running_median(range_m * upright, 9)

    @cached_property
    def ground_range_m(self) -> float:
        """The range reading on the ground [m]; 0 where the log begins in flight."""
        if self.ranges is None:
            return 0.0
        first = float(np.median(self.ranges[1][:START_ROWS]))
        return first if first < GROUND_RANGE_M else 0.0

    @cached_property
    def other_heights(self) -> dict[str, tuple[Array, Array]]:
        """Heights above the start by others than the range, by name: barometer, GPS, the autopilot's own."""
        found = {}
        baro, gps = self.stream(Sensor.BARO), self.stream(Sensor.GPS_POSITION)
        if baro is not None:
            found["barometer"] = baro.t_s - baro.delay_s, baro.value[:, 0]
        if gps is not None:
            found["GPS"] = gps.t_s - gps.delay_s, -gps.value[:, 2]
        if self.own is not None:
            found["autopilot"] = self.own.t_s, -self.own.pos_ned_m[:, 2]
        return {name: (t, h - float(np.median(h[:START_ROWS]))) for name, (t, h) in found.items()}

    def lifted(self, t_s: Array) -> Flags:
        """Whether the vehicle is off the ground: by the range, where none is near by most other heights.

        Not by the flag that says landed, which may be wrong; by it, else always, where there is nothing else.
        """
        votes = [np.interp(t_s, *of) > LIFTED_BY_OTHERS_M for of in self.other_heights.values()]
        others = np.mean(votes, axis=0) >= 0.5 if votes else None
        if self.range_height is None:
            if others is not None:
                return np.asarray(others)
            landed = self.stream(Sensor.LANDED)
            if landed is None:
                return np.ones(len(t_s), bool)
            row = np.clip(np.searchsorted(landed.t_s, t_s, side="right") - 1, 0, len(landed) - 1)
            return np.asarray(landed.value[row, 0] < 0.5)
        high = np.interp(t_s, *self.range_height) > self.ground_range_m + LIFTED_M
        near = gap_near(self.range_height[0], t_s) <= 1.0
        return np.asarray(np.where(near, high, others if others is not None else high))

    @cached_property
    def flight_s(self) -> Window:
        """From the first to the last instant off the ground; the log's span where there is none."""
        grid = np.arange(*self.log.span_s, 0.1)
        up = np.flatnonzero(self.lifted(grid) & self._between_landings(grid))
        return (float(grid[up[0]]), float(grid[up[-1]])) if len(up) > 10 else self.log.span_s

    @cached_property
    def flew(self) -> bool:
        """Whether it left the ground at all."""
        grid = np.arange(*self.log.span_s, 0.1)
        return int(np.count_nonzero(self.lifted(grid) & self._between_landings(grid))) > 10

    def _between_landings(self, t_s: Array) -> Flags:
        """From the first word of flying to the last: a vehicle that is carried about says that it stands."""
        landed = self.stream(Sensor.LANDED)
        flying = np.flatnonzero(landed.value[:, 0] < 0.5) if landed is not None else np.zeros(0, int)
        if landed is None or not len(flying):
            return np.ones(len(t_s), bool)
        last = flying[-1] + 1
        end = float(landed.t_s[last]) if last < len(landed) else np.inf
        return np.asarray((t_s >= landed.t_s[flying[0]] - FLAG_LATE_S) & (t_s <= end + FLAG_LATE_S))

    # -- others ------------------------------------------------------------------------------------------
    @cached_property
    def gps_velocity(self) -> tuple[Array, Array] | None:
        """GPS velocity NED (n, 3) by arrival."""
        stream = self.stream(Sensor.GPS_VELOCITY)
        if stream is None:
            return None
        good = np.isfinite(stream.value[:, :2]).all(axis=1)
        return (stream.t_s[good], np.nan_to_num(stream.value[good])) if good.sum() > START_ROWS else None

    @cached_property
    def own(self) -> Own | None:
        """The autopilot's own estimate."""
        table = self.log.autopilot
        if table is None or len(table["t_s"]) < START_ROWS:
            return None
        t_s, pos = np.asarray(table["t_s"], float), np.column_stack([table[name] for name in POSITION_NED])
        states_velocity = set(VELOCITY_BODY) <= table.keys() and set(QUATERNION) <= table.keys()
        if states_velocity:
            body = np.column_stack([table[name] for name in VELOCITY_BODY]).astype(float)
            turned = np.column_stack([table[name] for name in QUATERNION]).astype(float)
            vel: Array = np.column_stack(to_earth(rotation_from_quaternion(*turned.T), *body.T))
        else:
            vel = np.gradient(pos, np.maximum(t_s, np.arange(len(t_s)) * 1e-6), axis=0)
        good = np.isfinite(pos).all(axis=1) & np.isfinite(vel).all(axis=1)
        return Own(t_s[good], pos[good], vel[good], states_velocity) if good.sum() > START_ROWS else None
