"""Optical flow readings: angular rates less the vehicle's turning, or the sensor's own metric velocity."""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import Lanes, Work, equation, procedure, replacing, smaller
from flownav.core.measurement import Sensor
from flownav.estimation.covariance import consider
from flownav.estimation.laws.flow import body_velocity, flow_rate
from flownav.estimation.named import VelocityNed
from flownav.estimation.states import ATTITUDE, COMPASS, FLOW_SCALE, GROUND, GYRO_BIAS, INS_ERROR, POSITION, VELOCITY
from flownav.navigation import calls
from flownav.navigation.fault_signs import sign_flow
from flownav.navigation.flow_judge import (
    counted_agreement,
    gyro_share,
    hold_back,
    judge_look,
    judge_scale,
    see_ground,
    see_turning,
    sum_looks,
)
from flownav.navigation.flow_noise import (
    DOUBTED_RATIO,
    LONGEST_STEP_S,
    alike,
    blind_variance,
    blindness,
    disputed_variance,
    flow_variance,
    followed_agreement,
    followed_excess,
    followed_likeness,
    followed_quality,
    lasting_doubt,
    lasting_walk,
    wrong_since,
)
from flownav.navigation.kernel_settings import FlowSettings, carries_lag, flow_gain
from flownav.navigation.lagged_flow import observe_lagged
from flownav.navigation.memory import RANGE_MISSING, SCALE_UNSTATED, holds
from flownav.navigation.offers import conclude, note_aid
from flownav.navigation.packed import load_flow_settings
from flownav.navigation.reasons import FUSED, INNOVATION_GATE, SILENT, component_of
from flownav.navigation.records import AGREEING, FlowInnovation, FlowMemory, GpsMemory, Look, Reading
from flownav.navigation.tape import FLOW_DOUBTED, FLOW_TRUSTED, Output
from flownav.navigation.trust import watch_whiteness
from flownav.navigation.verdicts import (
    NO_EVENT,
    Biases,
    Doubt,
    Event,
    GyroShare,
    HeldBack,
    Measured,
    Offer,
    Tested,
    on_lanes,
)
from flownav.navigation.windows import watch_flow

with_agreement = replacing(FlowMemory, "excess", "ratio", "likeness", "agreed")
with_verdict = replacing(FlowMemory, "taken_s", "doubted", "wrong_s", "usual")


# -- one component ------------------------------------------------------------------------------------------
class FlowOffer(NamedTuple):
    """A component of flow: the offer, the value that its law is compared with, and the gyro's bias in that."""

    offer: Offer
    measured: Measured
    share: GyroShare


@on_lanes(calls.offer_component)
def offer_component(
    reading: Reading,
    look: Look,
    biases: Biases,
    m: FlowMemory,
    *,
    t_s: float,
    component: int,
    angular: bool,
    s: FlowSettings,
) -> FlowOffer:
    """One component without turning and gain error, with its variance. A down velocity that no sensor has is NaN.

    Every stated noise is that of the value as the sensor reports it: the sensor file's law, which is of the residuals
    about gain times velocity, the settings, and a variance that a reading states. So the gain is taken off both.
    """
    raw, listed = component_of(reading, component)
    turning = look.turning_x if component == 0 else look.turning_y
    gain = flow_gain(component, angular, s.flow_gain_x, s.flow_gain_y)
    reported = (raw - turning) if angular else raw
    observation = reported / gain
    speed = reported * look.range_m if angular else reported
    per_speed = 1.0 / (look.range_m * look.range_m) if angular else 1.0
    stated = np.nan if angular else listed
    noise = m.excess * flow_variance(look.range_m, speed, reading.quality, angular, s)
    noise += disputed_variance(look, speed) if angular else 0.0
    model = per_speed * (noise + blind_variance(look.range_m, reading.quality, m.usual, t_s - m.taken_s, s))
    variance = (stated if np.isfinite(stated) else model) / (gain * gain)
    absent = component == 2 and not np.isfinite(raw)
    # the law of a sensor without states of its own has the gyro's bias, which the turning does not
    share = gyro_share(reading) / gain if angular and not carries_lag(s) else 0.0
    return FlowOffer(
        Offer(observation, variance, SILENT if absent else int(look.reason)),
        Measured(observation - share * (biases.gyro_x if component == 0 else biases.gyro_y)),
        GyroShare(share),
    )


@on_lanes(calls.learn)
def learn(
    tested: Tested, reading: Reading, before: FlowInnovation, m: FlowMemory, *, t_s: float, angular: bool,
    component: int, s: FlowSettings,
) -> FlowMemory:  # fmt: skip
    """Agreement and excess noise from the component that was just tested. A flow that waits (`hold_back`) teaches no
    noise: garbage would widen the bound that it is held to.
    """
    if tested.reason != FUSED and tested.reason != INNOVATION_GATE:
        return m
    innovation, total = tested.innovation, tested.total
    square = smaller(innovation * innovation, s.gate_sigma * s.gate_sigma * total) / total
    modelled = angular or not np.isfinite(component_of(reading, component)[1])
    teaches = modelled and not blindness(reading.quality, m.usual) > 0.0 and m.agreed >= AGREEING
    return with_agreement(
        m,
        excess=followed_excess(innovation, before.innovation, tested.variance, t_s, m, s) if teaches else m.excess,
        ratio=followed_agreement(square, t_s, m),
        likeness=followed_likeness(alike(innovation, before.innovation, total), t_s, m),
        agreed=counted_agreement(innovation - before.innovation, tested.variance, m),
    )


class Freed(NamedTuple):
    """A level velocity that is doubted, and the innovation for the reading after."""

    doubts: tuple[Doubt, Doubt]
    innovation: FlowInnovation


@on_lanes(calls.free_velocity)
def free_velocity(
    tested: Tested, look: Look, gps: GpsMemory, before: FlowInnovation, m: FlowMemory, *, t_s: float, angular: bool
) -> Freed:
    """Doubts that free the velocity where flow is refused again and again and no other sensor measures it."""
    refused = tested.reason == INNOVATION_GATE
    again = tested.innovation * before.innovation > 0.0  # spikes are not alike
    freed = refused and m.ratio > DOUBTED_RATIO and not holds(gps, t_s) and again
    least = smaller(abs(tested.innovation), abs(before.innovation)) * (look.range_m if angular else 1.0)
    variance = least * least if freed else 0.0
    return Freed(
        (Doubt(VELOCITY, variance), Doubt(VELOCITY + 1, variance)),
        FlowInnovation(tested.innovation) if refused or tested.reason == FUSED else before,
    )


# -- a reading as a whole -----------------------------------------------------------------------------------
@on_lanes(calls.walk_alone)
def walk_alone(
    look: Look, velocity: VelocityNed, gps: GpsMemory, m: FlowMemory, *, t_s: float, s: FlowSettings
) -> tuple[Doubt, Doubt]:
    """Where no GPS holds the position, it is less sure by what lasts of the flow's error since the reading before."""
    step_s = smaller(t_s - m.taken_s, LONGEST_STEP_S)
    north, east = velocity.vel_n, velocity.vel_e
    walk = lasting_walk(look.range_m, np.sqrt(north * north + east * east), s)
    variance = walk * step_s if look.reason == FUSED and not holds(gps, t_s) else 0.0
    return Doubt(POSITION, variance), Doubt(POSITION + 1, variance)


class Agreement(NamedTuple):
    """Memories and event after a reading of flow was found to agree or not: it is doubted, or trusted anew."""

    held: HeldBack
    flow: FlowMemory
    event: Event


@on_lanes(calls.judge_agreement)
def judge_agreement(look: Look, reading: Reading, m: FlowMemory, *, t_s: float) -> Agreement:
    """Write the event that flow is doubted, or trusted again; note when it was tested last. No other is held back."""
    if look.reason != FUSED:
        return Agreement(HeldBack(0.0), m, NO_EVENT)
    doubted = lasting_doubt(m.doubted, m.ratio)
    after = with_verdict(
        m,
        taken_s=t_s,
        doubted=doubted,
        wrong_s=wrong_since(t_s, m.likeness, m.wrong_s),
        usual=followed_quality(reading.quality, t_s - m.taken_s, m.usual),
    )
    kind = FLOW_DOUBTED if doubted > 0.0 else FLOW_TRUSTED
    return Agreement(HeldBack(0.0), after, Event(kind if doubted != m.doubted else -1, m.ratio))


# -- the flow's way -----------------------------------------------------------------------------------------
@procedure
def take_flow(
    work: Work, lanes: Lanes, lag: bool | None, t_s: float, sensor: int, gyro_is_imu: bool, p: Work, o: Output
) -> None:
    """Two components of flow [rad/s], or two or three of body velocity [m/s], with noise scheduled on the height.

    lag: `covariance.lagged`, whether the sensor's dynamics are states.
    """
    s = load_flow_settings(p)
    angular = sensor == Sensor.FLOW_RATE
    if angular and lag is None:
        sum_looks(work, lanes, t_s)
    see_ground(work, lanes, t_s, s)
    if angular:
        see_turning(work, lanes, t_s, gyro_is_imu, s)
    judge_look(work, lanes, angular, s)
    hold_back(work, lanes, t_s)
    judge_scale(work, lanes, t_s)
    consider_others(work, lanes)
    watch_flow(work, lanes, angular)
    for component in range(2 if angular or lag is not None else 3):
        offer_component(work, lanes, t_s, component, angular, s)
        if lag is not None:
            observe_lagged(work, lanes, component, angular, s)
        elif angular:
            flow_rate(work, lanes, component, s.flow_forward_m, s.flow_right_m, s.flow_below_m, s.flow_below_m)
        else:
            body_velocity(work, lanes, component, s.flow_forward_m, s.flow_right_m, s.flow_below_m)
        sign_flow(work, lanes, t_s, component, angular)
        conclude(work, lanes, t_s, sensor, component, s.gate_sigma, o)
        watch_whiteness(work, lanes, t_s, 1 - component if angular else component)
        learn(work, lanes, t_s, angular, component, s)
        free_velocity(work, lanes, t_s, angular, component)
        note_aid(work, lanes, t_s, o)
    walk_alone(work, lanes, t_s, s)
    judge_agreement(work, lanes, t_s, o)


@equation
def consider_others(work: Work, lanes: Lanes) -> None:
    """Consider states that flow depends on and must not correct: over a step of the ground it would move the height,
    and by accelerations that err it would turn the heading; its scale is learnt where GPS holds (`judge_scale`). Where
    GPS measures the velocity too, GPS corrects the rest.
    """
    consider(work, lanes, POSITION + 2, RANGE_MISSING)
    consider(work, lanes, GROUND, RANGE_MISSING)
    consider(work, lanes, FLOW_SCALE, SCALE_UNSTATED)
    consider(work, lanes, ATTITUDE + 2)
    consider(work, lanes, GYRO_BIAS + 2)
    consider(work, lanes, INS_ERROR + 2)
    consider(work, lanes, COMPASS)
    consider(work, lanes, COMPASS + 1)
