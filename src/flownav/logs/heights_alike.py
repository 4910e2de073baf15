"""Does a log's reference have up and down as the log's own sensors of height have them?"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from flownav.core.frames import rotation_from_quaternion
from flownav.core.measurement import Array, Sensor, Stream
from flownav.core.record import POSITION_NED, Table
from flownav.logs.log import attitude_at, integrated

LEAST_HEIGHTS, LEAST_CLIMB_M = 50, 0.3  # readings; rms
LEAST_LIKENESS = 0.71  # correlation that shows up from down: half of what a height varies by is the other's
FELT, FELT_S, LONGEST_IMU_S = "the accelerometer", 1.0, 0.1  # over which a height bends; between readings
LEAST_FELT, LEAST_BEND_M = 0.5, 0.1  # correlation that shows up from down; rms


class _Sign(NamedTuple):
    """Which sensor, and the correlation of its height with a reference's: -1 where that is upside down."""

    name: str
    likeness: float

    @property
    def says(self) -> int:
        """1 the reference is right, -1 it is upside down, 0 the sensor does not show it."""
        least = LEAST_FELT if self.name == FELT else LEAST_LIKENESS
        return 0 if abs(self.likeness) < least else (1 if self.likeness > 0.0 else -1)


def upside_down(truth: Table, streams: Mapping[Sensor, Stream]) -> str:
    """Which sensors of height show that a reference's down points up, in words; "" where none does.

    Barometer, accelerometer and range are asked, and most of those that show it clearly decide. Of two that contradict
    each other one is wrong: a barometer drifts with the weather, a range over a slope falls as its vehicle climbs.
    """
    t_s, up_m = np.asarray(truth["t_s"], float), -np.asarray(truth[POSITION_NED[2]], float)
    signs = [sign for sign in heights_alike(t_s, up_m, streams) if sign.says]
    against = [sign.name for sign in signs if sign.says < 0]
    return " and ".join(against) if 2 * len(against) > len(signs) else ""


def heights_alike(t_s: Array, up_m: Array, streams: Mapping[Sensor, Stream]) -> list[_Sign]:
    """By barometer, accelerometer and range, each where there is enough motion, how its height is like a reference's,
    t_s (n,) and up (n,).
    """
    found = []
    for sensor in (Sensor.BARO, Sensor.IMU, Sensor.RANGE):
        stream = streams.get(sensor)
        if stream is None or not len(t_s):
            continue
        if sensor == Sensor.IMU:
            likeness = _felt_alike(t_s, up_m, stream, streams.get(Sensor.ATTITUDE))
        else:
            likeness = _height_alike(t_s, up_m, stream)
        if likeness is not None:
            found.append(_Sign(FELT if sensor == Sensor.IMU else sensor.name.lower(), likeness))
    return found


def _height_alike(t_s: Array, up_m: Array, stream: Stream) -> float | None:
    """The correlation of a sensor's height with a reference's; None without enough climb."""
    at_s, height_m = stream.t_s - stream.delay_s, stream.value[:, 0]
    inside = (at_s >= t_s[0]) & (at_s <= t_s[-1]) & np.isfinite(height_m)
    inside &= (height_m > 0.0) | (stream.sensor != Sensor.RANGE)
    if np.count_nonzero(inside) < LEAST_HEIGHTS:
        return None
    ours, theirs = np.interp(at_s[inside], t_s, up_m), height_m[inside]
    if min(ours.std(), theirs.std()) < LEAST_CLIMB_M:
        return None
    return float(np.corrcoef(ours, theirs)[0, 1])


def _felt_alike(t_s: Array, up_m: Array, imu: Stream, attitude: Stream | None) -> float | None:
    """The correlation of how a height bends over FELT_S with the accelerometer, integrated twice; None without either.

    Up is by the attitude, else along the specific force: a multirotor's thrust, whose tilt shortens it by its square.
    A constant bias, and what is left of gravity, do not count.
    """
    force = imu.value[:, 3:6]
    good = np.isfinite(force).all(axis=1)
    at_s, force = (imu.t_s - imu.delay_s)[good], force[good]
    if len(at_s) < LEAST_HEIGHTS or float(np.median(np.diff(at_s))) > LONGEST_IMU_S:
        return None
    if attitude is not None and len(attitude) > 1:
        row = rotation_from_quaternion(*attitude_at(attitude, at_s + attitude.delay_s).T)[6:]
        up = -sum(one * axis for one, axis in zip(row, force.T, strict=True))
    else:
        up = np.linalg.norm(force, axis=1)
    steps = np.diff(at_s)
    way = integrated(integrated(np.asarray(up) - float(np.median(up)), steps), steps)
    grid = np.arange(max(t_s[0], at_s[0]) + FELT_S, min(t_s[-1], at_s[-1]) - FELT_S, 0.1 * FELT_S)
    if len(grid) < LEAST_HEIGHTS:
        return None
    ours, theirs = (
        np.interp(grid + FELT_S, at, height) - 2.0 * np.interp(grid, at, height) + np.interp(grid - FELT_S, at, height)
        for at, height in ((t_s, up_m), (at_s, way))
    )
    broken = np.interp(grid + FELT_S, at_s[1:], np.cumsum(steps > FELT_S)) > np.interp(
        grid - FELT_S, at_s[1:], np.cumsum(steps > FELT_S)
    )
    ours, theirs = ours[~broken], theirs[~broken]
    if len(ours) < LEAST_HEIGHTS or ours.std() < LEAST_BEND_M or theirs.std() == 0.0:
        return None
    return float(np.corrcoef(ours, theirs)[0, 1])
