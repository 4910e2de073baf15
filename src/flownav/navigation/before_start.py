"""Readings before the start: the newest attitude, the mean specific force, and the force as it is now."""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import Lanes, Work, equation, procedure, replacing, squared
from flownav.core.measurement import Sensor
from flownav.navigation import calls
from flownav.navigation.inertial import STEADY_S, is_possible
from flownav.navigation.motion_records import ImuMemory
from flownav.navigation.records import Reading, StartMemory
from flownav.navigation.verdicts import on_lanes
from flownav.navigation.vibration import with_reading

MOST_LEVELLING = 100.0  # readings whose mean is level: 2 s at 50 Hz
with_force = replacing(StartMemory, "force_x", "force_y", "force_z", "readings", "shaken", "since_s")
with_felt = replacing(StartMemory, "felt_x", "felt_y", "felt_z")
with_attitude = replacing(StartMemory, "attitude_s", "qw", "qx", "qy", "qz")


@equation
def levelled(reading: Reading, m: StartMemory, t_s: float) -> StartMemory:
    """The mean specific force [m/s2], and how it is shaken, with one reading more."""
    share = 1.0 / min(m.readings + 1.0, MOST_LEVELLING)
    x, y, z = reading.value_3 - m.force_x, reading.value_4 - m.force_y, reading.value_5 - m.force_z
    square = (x * x + y * y + z * z) / 3.0 if m.readings > 0.0 else 0.0
    return with_force(
        m,
        force_x=m.force_x + share * x,
        force_y=m.force_y + share * y,
        force_z=m.force_z + share * z,
        readings=m.readings + 1.0,
        shaken=m.shaken + share * (square - m.shaken),
        since_s=m.since_s if m.readings > 0.0 else t_s,
    )


@equation
def felt(reading: Reading, m: StartMemory, dt_s: float) -> StartMemory:
    """The specific force as it is now, without its vibration; the first as it is read."""
    share = dt_s / (STEADY_S + dt_s) if m.readings > 0.0 else 1.0
    return with_felt(
        m,
        felt_x=m.felt_x + share * (reading.value_3 - m.felt_x),
        felt_y=m.felt_y + share * (reading.value_4 - m.felt_y),
        felt_z=m.felt_z + share * (reading.value_5 - m.felt_z),
    )


@on_lanes(calls.waits)
def waits(m: StartMemory) -> bool:
    """Whether any lane has not started."""
    return m.started == 0.0


@on_lanes(calls.note_attitude)
def note_attitude(reading: Reading, m: StartMemory, *, t_s: float) -> StartMemory:
    """The latest attitude before the start, of unit length."""
    w, x, y, z = reading.value_0, reading.value_1, reading.value_2, reading.value_3
    size = np.sqrt(squared(w) + squared(x) + squared(y) + squared(z))
    noted = m.started == 0.0 and reading.arrived > 0.0 and size > 0.5 and size < 2.0
    after = with_attitude(m, attitude_s=t_s, qw=w / size, qx=x / size, qy=y / size, qz=z / size)
    return after if noted else m


class Levelled(NamedTuple):
    """Memories after an inertial reading before the start."""

    start: StartMemory
    imu: ImuMemory


@on_lanes(calls.note_force)
def note_force(reading: Reading, m: StartMemory, imu: ImuMemory, *, t_s: float) -> Levelled:
    """The latest inertial reading before the start, and the mean specific force."""
    noted = m.started == 0.0 and reading.arrived > 0.0 and is_possible(reading)
    return Levelled(
        levelled(reading, felt(reading, m, t_s - imu.read_s), t_s) if noted else m,
        with_reading(reading, t_s, imu) if noted else imu,
    )


@procedure
def gather(work: Work, lanes: Lanes, t_s: float, sensor: int) -> None:
    """Before the start: the latest attitude, IMU reading, and the mean specific force."""
    if waits(work, lanes):
        if sensor == Sensor.ATTITUDE:
            note_attitude(work, lanes, t_s)
        elif sensor == Sensor.IMU:
            note_force(work, lanes, t_s)
