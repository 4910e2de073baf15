"""Readings over half a second, and the limits that they must keep before a vehicle is taken to stand (`still`)."""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import equation, larger, replacing, smaller, squared
from flownav.estimation.laws import component
from flownav.navigation import calls
from flownav.navigation.inertial import sound
from flownav.navigation.motion_records import ImuWindow, SeenWindow
from flownav.navigation.reasons import is_received
from flownav.navigation.records import Look, Reading
from flownav.navigation.verdicts import on_lanes

# Figures are of windows of half a second in the logs of ../shared/data; test_still holds each verdict at its limits.
LEAST_READINGS = 5.0  # chosen: four are too few to know a spread
# Rms of all axes about the mean: at rest 0.002 and 0.02 at most (indoor-made, mocap), in flight 0.020 and 0.17 at least
# (outdoor-3). A simulated helicopter hovers as quietly as one at rest (heli_sitl): its range shows that it flies.
QUIET_GYRO_RAD_S, QUIET_ACCEL_M_S2 = 0.01, 0.12
QUIET_READINGS = (
    125.0  # of 250 Hz: a unit that is read oftener has as much noise in a root hertz, and more in a reading
)
RESTING_TURN_RAD_S = 0.04  # 2 deg/s: at rest gyros read 0.002 to 0.018 (indoor-made/f-dropouts)
STEADY_RANGE_M = 0.03  # at rest ranges span 0.01 m at most (indoor-made), in flight 0.03 to 0.05 in the median
SPAN_SIGMAS = 4.0  # of white noise in a window's ranges, 8 to 30 of them: 2.8 to 4.1 sigma on average
CONTACT_M = 0.35  # on the ground, where none was seen yet: sonars read 0.30 for all that is nearer (mocap, outdoor-2)
RESTING_FLOW_M_S, SHAKEN_FLOW_M_S = 0.3, 0.1  # on the ground 0 (indoor-made), 0.03 (outdoor), 0.17 (outdoor-2) at most
# Nearer to the ground no lens is in focus, nor is its flow fused (`flow_min_height_m`): it does not show whether the
# vehicle slides, and a range that stays there for half a second shows that it stands
BLURRED_M = 0.05
RESTING_GPS_M_S = 1.0  # on the ground receivers read 0.2 (outdoor) to 0.7 m/s (outdoor-3) at most
MOVES, SHAKEN, RESTS = 0.0, 1.0, 2.0  # what a vehicle does: it moves, stands with its motors on, or off
NO_READINGS, NOTHING_SEEN = ImuWindow(), SeenWindow()

with_span = replacing(SeenWindow, "range_low_m", "range_high_m", "range_m", "ranges", "range_jumps")
with_flow = replacing(SeenWindow, "flow_u_m_s", "flow_v_m_s", "flows")
with_gps = replacing(SeenWindow, "gps_m_s")


# -- windows ------------------------------------------------------------------------------------------------
@equation
def with_imu(r: Reading, m: ImuWindow) -> ImuWindow:
    """Sums with one inertial reading more: of differences from the window's first, so that small ones are not lost."""
    new = m.readings == 0.0
    p0, q0, r0 = r.value_0 if new else m.first_p, r.value_1 if new else m.first_q, r.value_2 if new else m.first_r
    x0, y0, z0 = r.value_3 if new else m.first_x, r.value_4 if new else m.first_y, r.value_5 if new else m.first_z
    p, q, r_ = r.value_0 - p0, r.value_1 - q0, r.value_2 - r0
    x, y, z = r.value_3 - x0, r.value_4 - y0, r.value_5 - z0
    return ImuWindow(
        m.readings + 1.0, p0, q0, r0, x0, y0, z0, m.sum_p + p, m.sum_q + q, m.sum_r + r_,
        m.sum_x + x, m.sum_y + y, m.sum_z + z,
        m.square_p + p * p, m.square_q + q * q, m.square_r + r_ * r_, m.accel_square + x * x + y * y + z * z,
    )  # fmt: skip


@equation
def turning_of(m: ImuWindow, axis: int) -> tuple[float, float]:
    """Mean [rad/s] and variance [(rad/s)^2] of the turning about one body axis over a window."""
    n = larger(m.readings, 1.0)
    first = component((m.first_p, m.first_q, m.first_r), axis)
    mean = component((m.sum_p, m.sum_q, m.sum_r), axis) / n
    return first + mean, larger(component((m.square_p, m.square_q, m.square_r), axis) / n - mean * mean, 0.0)


@equation
def spreads(m: ImuWindow) -> tuple[float, float]:
    """Rms of the turning [rad/s] and of the specific force [m/s2] about their means over a window, all axes."""
    n = larger(m.readings, 1.0)
    gyro = turning_of(m, 0)[1] + turning_of(m, 1)[1] + turning_of(m, 2)[1]
    accel = m.accel_square / n - (squared(m.sum_x) + squared(m.sum_y) + squared(m.sum_z)) / (n * n)
    return np.sqrt(gyro), np.sqrt(larger(accel, 0.0))


@equation
def with_range(range_m: float, m: SeenWindow) -> SeenWindow:
    """The span of the ranges, and how they jump, with one more."""
    jump_m = range_m - m.range_m if m.ranges > 0.0 else 0.0
    return with_span(
        m,
        range_low_m=smaller(m.range_low_m, range_m),
        range_high_m=larger(m.range_high_m, range_m),
        range_m=range_m,
        ranges=m.ranges + 1.0,
        range_jumps=m.range_jumps + jump_m * jump_m,
    )


@equation
def is_steady(m: SeenWindow) -> bool:
    """Whether ranges span no more than those of one height do: a sensor's noise shows in what changes between two."""
    noise_m = np.sqrt(0.5 * m.range_jumps / larger(m.ranges - 1.0, 1.0))
    return bool(m.range_high_m - m.range_low_m <= STEADY_RANGE_M + SPAN_SIGMAS * noise_m)


@equation
def contact_range(contact_m: float) -> float:
    """Largest range of a vehicle on the ground [m]. contact_m: as it rested before, or NaN."""
    return larger(CONTACT_M, contact_m + STEADY_RANGE_M if np.isfinite(contact_m) else 0.0)


@equation
def flow_speed(m: SeenWindow) -> float:
    """The speed of the mean of a window's flow [m/s]."""
    speed_m_s: float = np.sqrt(squared(m.flow_u_m_s) + squared(m.flow_v_m_s)) / larger(m.flows, 1.0)
    return speed_m_s


@equation
def judge_standing(gyro: ImuWindow, seen: SeenWindow, contact_m: float, last_m: float = np.nan) -> float:
    """State of motion of a vehicle by its readings over a window: MOVES, SHAKEN, RESTS.

    contact_m: the range when it rested before; last_m: the last range before this window; NaN where not known.
    """
    turning, shaking = spreads(gyro)
    turn = np.sqrt(squared(turning_of(gyro, 0)[0]) + squared(turning_of(gyro, 1)[0]) + squared(turning_of(gyro, 2)[0]))
    left = 3.0 * turning / np.sqrt(larger(gyro.readings, 1.0))  # of shaking in a mean, at most
    enough = gyro.readings >= LEAST_READINGS and turn < RESTING_TURN_RAD_S + left
    ranged = seen.range_high_m >= 0.0
    contact = contact_range(contact_m)
    touching = ranged and seen.range_high_m <= contact
    was_near, was_far = not ranged and last_m <= contact, not ranged and last_m > contact
    steady = is_steady(seen)
    flow_m_s = flow_speed(seen)
    unmoved = seen.gps_m_s < RESTING_GPS_M_S
    oftener = np.sqrt(larger(gyro.readings / QUIET_READINGS, 1.0))
    quiet = turning < oftener * QUIET_GYRO_RAD_S and shaking < oftener * QUIET_ACCEL_M_S2
    seen_still = flow_m_s < RESTING_FLOW_M_S or was_near  # a lens on the ground sees nothing, and may report anything
    rests = enough and quiet and unmoved and seen_still and ((touching and steady) or (not ranged and not was_far))
    below = (touching and steady) or was_near
    blurred = touching and seen.range_high_m < BLURRED_M
    seen_so = seen.flows > 0.0 and flow_m_s < SHAKEN_FLOW_M_S
    shaken = enough and unmoved and below and (seen_so or blurred)
    return RESTS if rests else (SHAKEN if shaken else MOVES)


# -- what is watched ----------------------------------------------------------------------------------------
class Windows(NamedTuple):
    """The windows of a lane."""

    imu: ImuWindow
    seen: SeenWindow


@on_lanes(calls.open_windows)
def open_windows() -> Windows:
    """Windows in which nothing has been read."""
    return Windows(NO_READINGS, NOTHING_SEEN)


@on_lanes(calls.watch_imu)
def watch_imu(reading: Reading, m: ImuWindow) -> ImuWindow:
    """The inertial reading at hand goes into the window."""
    return with_imu(reading, m) if sound(reading) else m


@on_lanes(calls.watch_range)
def watch_range(reading: Reading, m: SeenWindow) -> SeenWindow:
    """A range goes into the window, whatever the filter makes of it; many sensors report 0 for no data."""
    ranged = is_received(reading) and reading.value_0 > 0.0 and np.isfinite(reading.value_0)
    return with_range(reading.value_0, m) if ranged else m


@on_lanes(calls.watch_gps_velocity)
def watch_gps_velocity(reading: Reading, m: SeenWindow) -> SeenWindow:
    """The fastest level velocity of a receiver stays in the window."""
    speed_m_s = np.sqrt(squared(reading.value_0) + squared(reading.value_1))
    is_stated = is_received(reading) and np.isfinite(speed_m_s)
    return with_gps(m, gps_m_s=larger(m.gps_m_s, speed_m_s)) if is_stated else m


@on_lanes(calls.watch_flow)
def watch_flow(reading: Reading, look: Look, m: SeenWindow, *, angular: bool) -> SeenWindow:
    """The flow's velocity by the latest range goes into the window."""
    x = reading.value_0 - (look.turning_x if angular else 0.0)
    y = reading.value_1 - (look.turning_y if angular else 0.0)
    ranged = m.range_high_m if m.range_high_m >= 0.0 else look.range_m
    per = ranged if angular else 1.0
    summed = with_flow(
        m, flow_u_m_s=m.flow_u_m_s + x * per, flow_v_m_s=m.flow_v_m_s + y * per, flows=m.flows + 1.0
    )  # fmt: skip
    return summed if is_received(reading) and np.isfinite(x + y) else m
