"""The rangefinder (HRLV-MaxSonar on the PX4FLOW, 10 Hz): floor, ceiling, resolution, noise, a stuck value.

The sonar reports its floor, 300 mm, for anything nearer, whole millimetres, and nothing beyond 5 m
(MaxBotix, HRLV-MaxSonar-EZ datasheet). The PX4FLOW firmware smooths its ranges with a fixed-gain filter, whose rate is
the only vertical velocity that the sensor has:

    x- = x + v T,   e = range - x-,   x = x- + 0.8461 e,   v = v + 6.2034 e
"""

from typing import NamedTuple

from flownav.core.compile import clamp, equation, larger
from flownav.sensors.processes import quantised

PERIOD_S = 0.1
FILTER_RANGE_GAIN = 0.8461
FILTER_RATE_GAIN_1_S = 6.2034
SMALLEST_TILT_COSINE = 0.1


class RangefinderParameters(NamedTuple):
    """Limits, resolution and noise; `stuck` 1 makes every reading `stuck_m`."""

    floor_m: float
    ceiling_m: float
    resolution_m: float
    steps_per_m: float
    sigma_m: float
    stuck: float
    stuck_m: float


class RangefinderState(NamedTuple):
    """The firmware's smoothed range [m] and its rate [m/s]."""

    range_m: float
    rate_m_s: float


class RangeReading(NamedTuple):
    """A range along the boresight, 1 where a target is within reach (else the reading is the ceiling)."""

    range_m: float
    valid: float


@equation
def slant_range(height_m: float, tilt_cosine: float) -> float:
    """Distance to level ground along the boresight (body z): height/cos(tilt); tilt is held below 84 degrees."""
    return height_m / larger(tilt_cosine, SMALLEST_TILT_COSINE)


@equation
def start_rangefinder(height_m: float, tilt_cosine: float, p: RangefinderParameters) -> RangefinderState:
    """The filter at rest at the range of the first moment."""
    return RangefinderState(clamp(slant_range(height_m, tilt_cosine), p.floor_m, p.ceiling_m), 0.0)


@equation
def step_rangefinder(
    state: RangefinderState, height_m: float, tilt_cosine: float, normal: float, p: RangefinderParameters
) -> tuple[RangefinderState, RangeReading]:
    """One reading (10 Hz) of a sonar `height_m` above level ground, tilted by arccos(tilt_cosine)."""
    distance_m = slant_range(height_m, tilt_cosine)
    echo_m = quantised(distance_m + p.sigma_m * normal, p.resolution_m, p.steps_per_m)
    working_m = clamp(echo_m, p.floor_m, p.ceiling_m)
    range_m = p.stuck_m if p.stuck > 0.5 else working_m
    valid = 1.0 if p.stuck > 0.5 or distance_m <= p.ceiling_m else 0.0
    return smooth_range(state, range_m), RangeReading(range_m, valid)


@equation
def smooth_range(state: RangefinderState, range_m: float) -> RangefinderState:
    """The firmware's filter, one reading on."""
    predicted_m = state.range_m + PERIOD_S * state.rate_m_s
    error_m = range_m - predicted_m
    return RangefinderState(predicted_m + FILTER_RANGE_GAIN * error_m, state.rate_m_s + FILTER_RATE_GAIN_1_S * error_m)
