"""A rangefinder along the boresight, lidar or sonar: what of the true distance it reports, and when it does not.

- A wide beam reads the nearest ground inside its cone: over a plane that is the perpendicular, h, while the tilt is
below half the beam's width b, and h/cos(tilt - b) beyond; a narrow one reads the slant. (Over a step it is as over a
plane.) - A scale (a sonar's speed of sound, 0.17 % a kelvin) and an offset of this unit; noise with a part that grows
with the distance; whole steps. - Distances below the floor are not distinguished: it reads the floor (the
HRLV-MaxSonar: 300 mm). Beyond the ceiling, by slant range, or where the beam grazes the ground, there is no echo: the
reading is the ceiling with quality 0. - Echoes: half of them the second one, twice as far; half of something near.
Spells in which it repeats its last value, and spells in which nothing arrives. A unit may be stuck for good.

Last: the paper's rangefinder (HRLV-MaxSonar on the PX4FLOW, 10 Hz): floor, ceiling, resolution, noise, a stuck value.
The sonar reports its floor, 300 mm, for anything nearer, whole millimetres, and nothing beyond 5 m (MaxBotix, HRLV-
MaxSonar-EZ datasheet). The PX4FLOW firmware smooths its ranges with a fixed-gain filter, whose rate is the only
vertical velocity that the sensor has:

    x- = x + v T,   e = range - x-,   x = x- + 0.8461 e,   v = v + 6.2034 e
"""

import math
from typing import ClassVar, NamedTuple

import numpy as np
from pydantic import Field, field_validator

from flownav.core.compile import clamp, equation, larger
from flownav.core.parameter_files import Number, more_than
from flownav.sensors.geometry import BeamHit
from flownav.sensors.processes import level_of, quantised, spell, steps_per_unit
from flownav.sensors.sheet import Lever, SensorSheet, Spells

SMALLEST_COSINE = 0.1


class RangeSensorParameters(NamedTuple):
    """Coefficients of one reading."""

    beam_cosine: float  # of half the beam's width
    beam_sine: float
    least_incidence_cosine: float
    floor_m: float
    ceiling_m: float
    resolution_m: float
    steps_per_m: float
    scale_sigma: float
    offset_sigma_m: float
    sigma_m: float
    relative_sigma: float  # of the distance
    echo_above: float
    near_echo_m: float
    lost_begins_above: float
    lost_ends_above: float
    held_begins_above: float
    held_ends_above: float
    stuck: float  # 1: every reading is stuck_m
    stuck_m: float


class RangeSensorUnit(NamedTuple):
    """This unit's scale error and offset. As normals: one for each."""

    scale: float
    offset_m: float


class RangeSensorNormals(NamedTuple):
    """Standard normals of one reading."""

    noise: float
    echo: float
    echo_kind: float
    lost: float
    held: float
    spare: float


class RangeSensorState(NamedTuple):
    """The last reading and its quality, 1 in a spell that repeats it, 1 in a spell in which nothing arrives."""

    last_m: float
    last_quality: float
    held: float
    lost: float


class RangeSensorReading(NamedTuple):
    """A distance along the boresight, quality 0 (no echo) or 255, and 1 where it arrived."""

    range_m: float
    quality: float
    arrived: float


@equation
def draw_range_sensor(n: RangeSensorUnit, p: RangeSensorParameters) -> RangeSensorUnit:
    """This flight's unit."""
    return RangeSensorUnit(p.scale_sigma * n.scale, p.offset_sigma_m * n.offset_m)


@equation
def start_range_sensor(truth: BeamHit, p: RangeSensorParameters) -> RangeSensorState:
    """Working, the last reading that of the first moment."""
    return RangeSensorState(clamp(truth.distance_m, p.floor_m, p.ceiling_m), 255.0, 0.0, 0.0)


@equation
def wide_beam(truth: BeamHit, p: RangeSensorParameters) -> float:
    """Distance to the nearest ground inside the beam's cone: h, or h/cos(tilt - b) where the tilt is more than b."""
    cosine = clamp(truth.incidence_cosine, SMALLEST_COSINE, 1.0)
    sine = np.sqrt(larger(1.0 - cosine * cosine, 0.0))
    slant = cosine * p.beam_cosine + sine * p.beam_sine
    return truth.distance_m * (cosine / (slant if cosine < p.beam_cosine else 1.0))


@equation
def step_range_sensor(
    state: RangeSensorState,
    unit: RangeSensorUnit,
    truth: BeamHit,
    n: RangeSensorNormals,
    p: RangeSensorParameters,
) -> tuple[RangeSensorState, RangeSensorReading]:
    """One reading of the distance along the beam (`beam.beam_distance`)."""
    held = spell(state.held, n.held, p.held_begins_above, p.held_ends_above)
    lost = spell(state.lost, n.lost, p.lost_begins_above, p.lost_ends_above)
    nearest_m = wide_beam(truth, p)
    growing = p.relative_sigma * nearest_m
    sigma = np.sqrt(p.sigma_m * p.sigma_m + growing * growing)
    measured_m = nearest_m * (1.0 + unit.scale) + unit.offset_m + sigma * n.noise
    strayed_m = 2.0 * measured_m if n.echo_kind > 0.0 else p.near_echo_m
    echo = n.echo > p.echo_above
    read_m = quantised(strayed_m if echo else measured_m, p.resolution_m, p.steps_per_m)
    returned = (truth.incidence_cosine >= p.least_incidence_cosine) | echo
    in_reach = returned & ((strayed_m if echo else nearest_m) <= p.ceiling_m)
    fresh_m = clamp(read_m, p.floor_m, p.ceiling_m) if in_reach else p.ceiling_m
    fresh_quality = 255.0 if in_reach else 0.0
    repeats = held > 0.5
    working_m = state.last_m if repeats else fresh_m
    stuck = p.stuck > 0.5
    range_m = p.stuck_m if stuck else working_m
    quality = 255.0 if stuck else (state.last_quality if repeats else fresh_quality)
    after = RangeSensorState(range_m, quality, held, lost)
    return after, RangeSensorReading(range_m, quality, 0.0 if lost > 0.5 else 1.0)


class RangeSensorSheet(SensorSheet):
    """A lidar or a sonar. half_beam_deg: of the cone; max_incidence_deg: beyond which there is no echo."""

    shipped_file: ClassVar[str] = "range_sensor.toml"

    rate_hz: Number = Field(ge=1.0, le=1000.0)  # readings a second
    floor_m: Number = Field(ge=0.0, le=10.0)  # what it reads of anything nearer
    ceiling_m: Number = Field(gt=0.0, le=1000.0)  # beyond it no echo: it reads this, with quality 0
    half_beam_deg: Number = Field(0.0, ge=0.0, le=45.0)  # of the cone, in which it reads the nearest ground; 0: a ray
    max_incidence_deg: Number = Field(60.0, gt=0.0, le=80.0)  # between beam and the ground's normal; beyond it no echo
    resolution_m: Number = Field(0.0, ge=0.0, le=1.0)  # readings come in whole steps of this; 0: no steps
    sigma_m: Number = Field(ge=0.0, le=10.0)  # noise of a reading, standard deviation
    sigma_percent: Number = Field(0.0, ge=0.0, le=50.0)  # noise that grows with the distance, standard deviation
    scale_percent: Number = Field(0.0, ge=0.0, le=20.0)  # error of this unit's scale, standard deviation
    offset_sigma_m: Number = Field(0.0, ge=0.0, le=1.0)  # constant error of this unit, standard deviation
    echo_share: Number = Field(0.0, ge=0.0, le=1.0)  # of the readings, are false: half twice as far, half near
    near_echo_m: Number = Field(0.3, ge=0.0, le=10.0)  # what the near false ones read
    lost: Spells = Spells()
    held: Spells = Spells()
    stuck_at_m: Number | None = Field(None, ge=0.0, le=1000.0)  # every reading is this; none: it works
    lens: Lever = Lever()

    _above_the_floor = field_validator("ceiling_m")(more_than("floor_m"))

    def parameters(self) -> RangeSensorParameters:
        """Coefficients of one reading."""
        half_beam = math.radians(self.half_beam_deg)
        return RangeSensorParameters(
            math.cos(half_beam), math.sin(half_beam), math.cos(math.radians(self.max_incidence_deg)),
            self.floor_m, self.ceiling_m, self.resolution_m, steps_per_unit(self.resolution_m),
            0.01 * self.scale_percent, self.offset_sigma_m, self.sigma_m, 0.01 * self.sigma_percent,
            level_of(self.echo_share), self.near_echo_m,
            *self.lost.levels(self.period_s), *self.held.levels(self.period_s),
            0.0 if self.stuck_at_m is None else 1.0, self.stuck_at_m or 0.0,
        )  # fmt: skip


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
