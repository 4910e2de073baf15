"""The verdict on a flow reading, and the turning that it saw: laws of one reading, its memory and the settings."""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import clamp, cos, equation, exp, larger, replacing, smaller
from flownav.estimation.laws import lens_range
from flownav.navigation import calls
from flownav.navigation.flow_noise import LONGEST_STEP_S
from flownav.navigation.height import MANY_STRAYS
from flownav.navigation.kernel_settings import FlowSettings
from flownav.navigation.memory import holds
from flownav.navigation.reasons import (
    FUSED,
    NEAR_GROUND,
    NO_HEADING,
    NO_HEIGHT,
    OUT_OF_RANGE,
    SILENT,
    TILTED,
    is_received,
    judged,
    objecting,
    usable_in_flight,
)
from flownav.navigation.records import (
    AGREEING,
    AidMemory,
    EchoMemory,
    FlowMemory,
    FlowSum,
    GpsMemory,
    GroundMemory,
    HeadingMemory,
    Look,
    RangeMemory,
    Reading,
    StartMemory,
)
from flownav.navigation.verdicts import Biases, GroundBelow, HeldBack, on_lanes

with_turning = replacing(Look, "turning_x", "turning_y")
with_reason = replacing(Look, "reason")
with_scale = replacing(Look, "unscaled")
with_values = replacing(Reading, "value_0", "value_1", "value_2", "value_3", "value_4", "value_5", "quality")
with_arrival = replacing(Reading, "arrived")
with_agreed = replacing(FlowMemory, "agreed")
with_gyro = replacing(FlowMemory, "bias_x", "bias_y", "bias_count")

LARGEST_SPREAD = 0.5  # of the height over the ground, of which flow makes no speed: chosen, not measured
UNKNOWN_RANGE_M = 2.0  # chosen: an angular flow over an unknown height is written down, not fused (NO_HEIGHT)
DISPUTES_S = 0.3  # so long a range speaks of the height that flow is seen from: chosen
# A sensor that counts pixels carries the rest of a pixel over to the next look: so long a look sums such errors up to
# none, where a filter that takes each look for white noise does not. A vehicle's velocity hardly changes meanwhile.
LEAST_LOOK_S = 0.038
BLIND_S = 5.0  # after as long without any aid a position is invalid (`invalid_s`)
ALIKE_SIGMA = 2.5  # chosen: 1 of 80 components of sound flow is beyond it, most of what is random
NEAR_LIMIT = 0.98  # a sensor at its limit reads the limit, whatever the flow: chosen, 2 % for rounding (test_judges)


class Summed(NamedTuple):
    """The reading that is to be judged, which has not arrived while looks are summed up, and the sum."""

    reading: Reading
    looks: FlowSum


@on_lanes(calls.sum_looks)
def sum_looks(reading: Reading, m: FlowSum, *, t_s: float) -> Summed:
    """Looks of an angular flow that are shorter than LEAST_LOOK_S are summed up to one that is not: its mean."""
    look_s = t_s - m.received_s
    alone = not is_received(reading) or not look_s < LEAST_LOOK_S or not np.isfinite(reading.value_0 + reading.value_1)
    new = FlowSum(
        t_s, m.looked_s + look_s, m.x + look_s * reading.value_0, m.y + look_s * reading.value_1,
        m.own_x + look_s * reading.value_2, m.own_y + look_s * reading.value_3, m.imu_x + look_s * reading.value_4,
        m.imu_y + look_s * reading.value_5, m.quality + look_s * reading.quality,
    )  # fmt: skip
    ends = not alone and new.looked_s >= LEAST_LOOK_S
    per = 1.0 / new.looked_s if ends else 1.0
    mean = with_values(
        reading, value_0=per * new.x, value_1=per * new.y, value_2=per * new.own_x, value_3=per * new.own_y,
        value_4=per * new.imu_x, value_5=per * new.imu_y, quality=per * new.quality,
    )  # fmt: skip
    nothing = FlowSum(t_s if reading.arrived > 0.0 else m.received_s, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    waits = with_arrival(reading, arrived=0.0)
    return Summed(reading if alone else (mean if ends else waits), nothing if alone or ends else new)


@equation
def gyro_share(reading: Reading) -> float:
    """Share of the filter's gyro bias in the turning: 1 where the turning is the IMU's, or the sensor's gyro is held to
    the IMU's; else 0.
    """
    return 1.0 if np.isfinite(reading.value_4 + reading.value_5) else 0.0


@equation
def turning_of(
    reading: Reading, t_s: float, bias_x: float, bias_y: float, gyro_is_imu: bool, m: FlowMemory, s: FlowSettings
) -> tuple[float, float, FlowMemory]:
    """The turning that the flow saw [rad/s]: its own gyro less its bias, or the vehicle's IMU over the exposure.

    bias_x, bias_y: the filter's gyro bias, which the IMU's mean has. A sensor's own gyro is followed against the IMU,
    but not where it has no data: it may report zero then for its gyro too.
    """
    imu_x, imu_y = reading.value_4 - bias_x, reading.value_5 - bias_y
    own_x, own_y = reading.value_2, reading.value_3
    imu_here = bool(np.isfinite(imu_x + imu_y))
    by_imu = gyro_is_imu and imu_here
    follows = imu_here and not by_imu and bool(np.isfinite(own_x + own_y)) and reading.quality != 0.0
    count = m.bias_count + 1.0 if follows else m.bias_count
    step_s = smaller(larger(t_s - m.taken_s, 0.0), LONGEST_STEP_S)
    share = larger(1.0 - exp(-step_s / s.flow_gyro_time_s), 1.0 / larger(count, 1.0)) if follows else 0.0
    bias_own_x = m.bias_x + share * (own_x - imu_x - m.bias_x) if follows else m.bias_x
    bias_own_y = m.bias_y + share * (own_y - imu_y - m.bias_y) if follows else m.bias_y
    after = with_gyro(m, bias_x=bias_own_x, bias_y=bias_own_y, bias_count=count)
    x = imu_x if by_imu else own_x - bias_own_x
    y = imu_y if by_imu else own_y - bias_own_y
    return x, y, after


# -- what was seen ------------------------------------------------------------------------------------------
@on_lanes(calls.see_ground)
def see_ground(
    below: GroundBelow, ranged: RangeMemory, echo: EchoMemory, ground: GroundMemory, *, t_s: float, s: FlowSettings
) -> Look:
    """The ground that the lens sees, and whether a range measures the height over it; the rest is not known yet."""
    range_m = lens_range(below.rotation, below.height_m, (0.0, 0.0, s.flow_below_m))[0]
    spread_m = np.sqrt(larger(below.variance, 0.0))
    known = ground.known > 0.0 and spread_m <= LARGEST_SPREAD * range_m
    disputed = np.isfinite(ranged.refused_s) or echo.stray > MANY_STRAYS
    ranged_lately = t_s - ranged.taken_s <= s.height_hold_s and not disputed
    newest = t_s - ranged.tested_s <= DISPUTES_S
    return Look(
        turning_x=0.0,
        turning_y=0.0,
        range_m=range_m if known else UNKNOWN_RANGE_M,
        known=1.0 if known else 0.0,
        upright=below.rotation[8],
        unranged=0.0 if ranged_lately else 1.0,
        disputed_m=abs(ranged.contradiction_m) if newest and known else 0.0,
        reason=SILENT,
        unscaled=1.0,
    )


@on_lanes(calls.see_turning)
def see_turning(
    reading: Reading,
    start: StartMemory,
    biases: Biases,
    look: Look,
    m: FlowMemory,
    *,
    t_s: float,
    gyro_is_imu: bool,
    s: FlowSettings,
) -> tuple[Look, FlowMemory]:
    """The turning that an angular flow saw; a sensor's own gyro is followed."""
    x, y, after = turning_of(reading, t_s, biases.gyro_x, biases.gyro_y, gyro_is_imu, m, s)
    follows = start.started > 0.0 and reading.arrived > 0.0
    return with_turning(look, turning_x=x, turning_y=y), after if follows else m


@on_lanes(calls.judge_look)
def judge_look(
    reading: Reading, start: StartMemory, heading: HeadingMemory, look: Look, *, angular: bool, s: FlowSettings
) -> Look:
    """The verdict on the whole reading; flow turns with the heading, and waits until that is found."""
    turning = look.turning_x + look.turning_y if angular else 0.0
    sound = usable_in_flight(reading, reading.value_0 + reading.value_1 + turning, 0.0, start.started)
    unknown = angular and look.known == 0.0
    fast = angular and larger(abs(reading.value_0), abs(reading.value_1)) >= NEAR_LIMIT * s.flow_limit_rad_s
    near = look.known > 0.0 and look.range_m * look.upright <= s.flow_min_height_m  # `lens_range` is at least 0.05
    seen = objecting(NO_HEIGHT if unknown else FUSED, fast, OUT_OF_RANGE)
    reach = objecting(objecting(seen, look.upright < cos(s.tilt_limit_rad), TILTED), near, NEAR_GROUND)
    return with_reason(look, reason=judged(sound, reach, False, NO_HEADING if heading.sought > 0.0 else FUSED))


@on_lanes(calls.judge_scale)
def judge_scale(look: Look, gps: GpsMemory, m: FlowMemory, *, t_s: float) -> Look:
    """A flow's scale is learnt against GPS alone, and not of a flow that is doubted: without either, an error of the
    motion or noise passes for a scale, which then lasts.
    """
    return with_scale(look, unscaled=0.0 if holds(gps, t_s) and m.doubted == 0.0 else 1.0)


class Held(NamedTuple):
    """Whether a flow reading is tested and not fused, and the memory of the flow."""

    held: HeldBack
    flow: FlowMemory


@on_lanes(calls.hold_back)
def hold_back(look: Look, gps: GpsMemory, aid: AidMemory, m: FlowMemory, *, t_s: float) -> Held:
    """A flow that is wrong again and again is tested and not fused while GPS holds.

    Nor is one that sees again after BLIND_S in which nothing aided the position, until AGREEING more readings have
    agreed with the one before than have not: the velocity is so unsure by then that a single reading would set it, and
    move the position with it.
    """
    blind = look.reason == FUSED and aid.flag > 0.0 and t_s - m.taken_s > BLIND_S
    after = with_agreed(m, agreed=0.0 if blind else (AGREEING if aid.flag == 0.0 else m.agreed))
    wrong = holds(gps, t_s) and np.isfinite(m.wrong_s)
    return Held(HeldBack(1.0 if wrong or after.agreed < AGREEING else 0.0), after)


@equation
def counted_agreement(change: float, variance: float, m: FlowMemory) -> float:
    """Number of readings that agree less those that do not, after a component whose innovation changed by this much
    since the reading before: it agrees within ALIKE_SIGMA of the noise of two. An error of the motion is in both.
    """
    agrees = change * change <= 2.0 * ALIKE_SIGMA * ALIKE_SIGMA * variance
    counted = clamp(m.agreed + (0.5 if agrees else -0.5), 0.0, AGREEING)
    return counted if m.agreed < AGREEING else m.agreed
