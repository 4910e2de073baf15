"""Inertial readings that no vehicle can follow: a spike, or a burst of them, is as one that never came.

A jump is a spike where it is larger than turning and shaking can make it from one reading to the next. What stays away
for longer than a burst lasts is believed: then the vehicle was hit, and by how much the velocity may have changed
meanwhile is added to its doubt, so that flow and GPS find it anew. An IMU that reads nothing but zeros has failed.
A `Witness` judges so beside the filter: for the flow's turning, and for the carrying to now.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import ONE_LANE, equation, kernel, larger, pointer, replacing, smaller
from flownav.core.measurement import Array
from flownav.estimation.states import ATTITUDE, VELOCITY
from flownav.navigation import calls
from flownav.navigation.inertial import size_of, sound
from flownav.navigation.memory import MEMORY, READING, load_imu, load_spike, new_work, store_imu, store_spike
from flownav.navigation.motion_records import ImuMemory, SpikeMemory
from flownav.navigation.records import Reading, StartMemory
from flownav.navigation.tape import IMU_SPIKE
from flownav.navigation.verdicts import Doubt, Event, on_lanes
from flownav.navigation.vibration import with_reading

# Logs are those of ../shared/data. In flight neighbours jump by 0.8 rad/s and 7 m/s2 at most (outdoor-3, 50 Hz), on
# touching down by 3.0 and 42, a spike of indoor-made/d-vibration by 30 rad/s. A burst of 0.1 s at 30 m/s2 cost 3 m, and
# costs 0.1 now (live/test_live_glitches.py).
GYRO_JUMP_RAD_S, TURNING_RAD_S2 = 1.0, 200.0  # at once, and in the time between: a flick up to 5 rad/s is followed
ACCEL_JUMP_M_S2, SHAKING_M_S3 = 10.0, 1000.0  # at 20, bursts of 30 (test_live_glitches) pass where jumps of 1 are usual
SPIKE_RATIO = 6.0  # times the usual jump: chosen; at 3 what a vehicle can do is a spike (test_spikes)
USUAL_JUMP_READINGS = 50.0  # over which that is followed: chosen; half and twice as many pass test_spikes too
BURST_SLOWNESS = 3.0  # times, in a burst: it must not make itself usual; chosen, 1.5 and 6 pass test_spikes too
LONGEST_S = 0.1  # chosen, not measured: readings further apart are no neighbours
AFTER_GAP_S = 0.02  # chosen: a jump over a gap is held to what 50 Hz allow, since the reading stands for all of it
MOST_REFUSED = 3.0  # in a row, after a gap, or of one that shakes and repeats no reading (test_spikes)
# usual jumps of one that does not shake, where a burst differs from motion: 0.05 to 0.08 and 0.5 to 0.6 in the
# outdoor logs; mocap and indoor-made shake (0.07 to 0.1 and 1.5 to 1.9), d-vibration most (0.3 and 7.6)
CALM_RAD_S, CALM_M_S2 = 0.3, 1.5
BURST_S = 0.3  # spikes that last longer are what happened: chosen, the longest burst of test_live_glitches
RETURN_SHARE = 0.5  # of the possible jump: so near a reading must come to what was before the burst: not measured
MOST_DOUBT_M_S = 1.0  # what a burst that was none may have done to the velocity: chosen, not measured
MOST_DOUBT_RAD = 0.2  # and to the attitude: chosen, not measured
JUMP_OF_RMS = 2.2  # from one reading of white noise to the next, three axes, over the rms of one: sqrt(6) in the rms
LONE_SHARE = 0.3  # of that, for one reading alone: a hard touchdown at 50 Hz, as outdoor-3's; chosen


with_usual = replacing(SpikeMemory, "accel_m_s2")


@equation
def distance(x: float, y: float, z: float) -> float:
    """Length of a vector."""
    length: float = np.sqrt(x * x + y * y + z * z)
    return length


@equation
def is_dead(r: Reading) -> bool:
    """Whether all six axes read 0 to the last digit, as no IMU does that is alive."""
    return size_of(r) == 0.0


@equation
def judge_spike(reading: Reading, step_s: float, m: ImuMemory, s: SpikeMemory) -> tuple[bool, SpikeMemory]:
    """Whether an inertial reading is a spike after the one that was kept, step_s before; and the memory of it.

    Only in a vehicle that does not shake is a burst distinguished from real motion; in one that does, a value that the
    next reading repeats is believed, and three in a row are the most. In a burst a reading is held against what was
    kept before it, by the jump that was possible when it began. After a gap beyond BURST_S three in a row are the most.
    The usual jump is that between neighbours, kept or not: motors that start shake every reading, a burst stands still.
    """
    gyro = distance(reading.value_0 - m.gyro_x, reading.value_1 - m.gyro_y, reading.value_2 - m.gyro_z)
    accel = distance(reading.value_3 - m.accel_x, reading.value_4 - m.accel_y, reading.value_5 - m.accel_z)
    calm = (s.gyro_rad_s < CALM_RAD_S and s.accel_m_s2 < CALM_M_S2) or s.refused > MOST_REFUSED
    burst = calm and s.refused > 0.0 and step_s <= BURST_S
    near = burst or step_s <= LONGEST_S
    reach_s = s.reach_s if burst else step_s if near else AFTER_GAP_S
    most_gyro = GYRO_JUMP_RAD_S + TURNING_RAD_S2 * reach_s + SPIKE_RATIO * s.gyro_rad_s
    most_accel = ACCEL_JUMP_M_S2 + SHAKING_M_S3 * reach_s + SPIKE_RATIO * s.accel_m_s2
    back = RETURN_SHARE if burst else 1.0
    jumps = gyro > back * most_gyro or accel > back * most_accel
    gyro_next = distance(reading.value_0 - s.gyro_x, reading.value_1 - s.gyro_y, reading.value_2 - s.gyro_z)
    accel_next = distance(reading.value_3 - s.accel_x, reading.value_4 - s.accel_y, reading.value_5 - s.accel_z)
    again = s.refused > 0.0 and gyro_next < 0.5 * most_gyro and accel_next < 0.5 * most_accel
    confirmed = not calm and (again or s.refused >= MOST_REFUSED)
    spike = (jumps and (near or s.refused < MOST_REFUSED) and not confirmed) or is_dead(reading)
    share = 1.0 / (BURST_SLOWNESS * USUAL_JUMP_READINGS if spike else USUAL_JUMP_READINGS)
    gyro_usual = s.gyro_rad_s + share * (smaller(gyro_next, most_gyro) - s.gyro_rad_s)
    accel_usual = s.accel_m_s2 + share * (smaller(accel_next, most_accel) - s.accel_m_s2)
    return spike, SpikeMemory(
        s.refused + 1.0 if spike else 0.0,
        gyro_usual if near else s.gyro_rad_s,
        accel_usual if near else s.accel_m_s2,
        reading.value_0, reading.value_1, reading.value_2, reading.value_3, reading.value_4, reading.value_5,
        reach_s,
    )  # fmt: skip


@equation
def doubt_of(reading: Reading, step_s: float, m: ImuMemory, s: SpikeMemory) -> float:
    """The velocity's variance [m2/s2] that one spike more of a burst adds, an axis.

    In all that of what the readings say beyond the one that was kept, over the time since, up to MOST_DOUBT_M_S; for a
    spike that is alone LONE_SHARE of it.
    """
    accel = distance(reading.value_3 - m.accel_x, reading.value_4 - m.accel_y, reading.value_5 - m.accel_z)
    return grown(accel, step_s, MOST_DOUBT_M_S, s)


@equation
def turning_doubt_of(reading: Reading, step_s: float, m: ImuMemory, s: SpikeMemory) -> float:
    """Variance that a hit adds to the attitude [rad2], by the gyro's reading."""
    gyro = distance(reading.value_0 - m.gyro_x, reading.value_1 - m.gyro_y, reading.value_2 - m.gyro_z)
    return grown(gyro, step_s, MOST_DOUBT_RAD, s)


@equation
def grown(rate: float, step_s: float, most: float, s: SpikeMemory) -> float:
    """How much the square of rate times time has grown with the newest step of a burst; of the first, LONE_SHARE."""
    now = smaller(rate * step_s, most) * (LONE_SHARE if s.refused == 1.0 else 1.0)
    before = smaller(rate * larger(step_s - s.reach_s, 0.0), most) * (LONE_SHARE if s.refused == 2.0 else 1.0)
    return now * now - before * before if s.refused > 1.0 else now * now


class Arrived(NamedTuple):
    """Whether the reading at hand arrived."""

    arrived: float


class SpikeVerdict(NamedTuple):
    """Verdict on an inertial reading that may be a spike: memory, whether it is taken, doubts, and event."""

    spike: SpikeMemory
    arrived: Arrived
    velocity: tuple[Doubt, Doubt, Doubt]
    attitude: tuple[Doubt, Doubt, Doubt]
    dropped: Event


MEMORY.name(Arrived, READING + Reading._fields.index("arrived"))


@on_lanes(calls.drop_spikes)
def drop_spikes(reading: Reading, start: StartMemory, m: ImuMemory, before: SpikeMemory, *, t_s: float) -> SpikeVerdict:
    """A spike did not arrive."""
    judged = sound(reading) and np.isfinite(m.read_s) and start.started > 0.0
    step_s = t_s - m.read_s
    usual = (
        larger(before.accel_m_s2, JUMP_OF_RMS * np.sqrt(start.shaken)) if before.reach_s == 0.0 else before.accel_m_s2
    )
    jumps, after = judge_spike(reading, step_s, m, with_usual(before, accel_m_s2=usual))
    spike = judged and jumps
    moved = doubt_of(reading, step_s, m, after) if spike else 0.0
    turned = turning_doubt_of(reading, step_s, m, after) if spike else 0.0
    return SpikeVerdict(
        after if judged else before,
        Arrived(0.0 if spike else reading.arrived),
        (Doubt(VELOCITY, moved), Doubt(VELOCITY + 1, moved), Doubt(VELOCITY + 2, moved)),
        (Doubt(ATTITUDE, turned), Doubt(ATTITUDE + 1, turned), Doubt(ATTITUDE + 2, turned)),
        Event(
            IMU_SPIKE if spike and after.refused == 1.0 else -1,
            distance(reading.value_0, reading.value_1, reading.value_2),
        ),
    )


class Witness:
    """The filter's judge of spikes on a memory of its own, from reading to reading."""

    def __init__(self) -> None:
        self._work = new_work(ONE_LANE)

    def keeps(self, imu: Array) -> NDArray[np.bool_]:
        """Which inertial readings are no spikes, (n,); imu (n, 7): time [s], gyro [rad/s], specific force [m/s2]."""
        kept = np.ones(len(imu), np.bool_)
        mark_spikes(self._work, imu, kept)
        return kept


@kernel
def mark_spikes(work: Array, imu: Array, kept: NDArray[np.bool_]) -> None:
    """False in `kept` where a reading is a spike after those before it; the first is none."""
    rows, lanes, unstated = pointer(work), ONE_LANE, np.nan
    for k in range(len(imu)):
        reading = Reading(
            imu[k, 1], imu[k, 2], imu[k, 3], imu[k, 4], imu[k, 5], imu[k, 6],
            unstated, unstated, unstated, 255.0, 1.0, 0.0,
        )  # fmt: skip
        m = load_imu(rows, lanes, 0)
        if np.isfinite(m.read_s):
            spike, after = judge_spike(reading, imu[k, 0] - m.read_s, m, load_spike(rows, lanes, 0))
            store_spike(rows, lanes, 0, after)
            kept[k] = not spike
        if kept[k]:
            store_imu(rows, lanes, 0, with_reading(reading, imu[k, 0], m))
