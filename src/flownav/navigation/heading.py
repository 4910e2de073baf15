"""Headings: what becomes of one that is read, a magnetometer's, and one that comes from elsewhere."""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import Lanes, Work, arctan2, clamp, equation, larger, procedure, replacing
from flownav.core.frames import rotation_from_quaternion, to_earth
from flownav.core.measurement import Sensor
from flownav.estimation.covariance import expect, states_of
from flownav.estimation.hypotheses import HEADING_OFF, sign_all
from flownav.estimation.laws.attitude import heading
from flownav.estimation.named import Attitude
from flownav.estimation.states import ATTITUDE, INS_ERROR
from flownav.navigation import calls
from flownav.navigation.kernel_settings import FROM_YAW, AttitudeSettings, Equipment
from flownav.navigation.memory import holds
from flownav.navigation.offers import conclude, offer_what_is_sound
from flownav.navigation.packed import load_attitude_settings
from flownav.navigation.reasons import FUSED, INNOVATION_GATE, NO_HEADING, SILENT, is_received, judged, usable_in_flight
from flownav.navigation.records import GpsMemory, HeadingMemory, Reading, StartMemory
from flownav.navigation.tape import Output
from flownav.navigation.verdicts import Doubt, Fate, Noise, Offer, Tested, on_lanes

LEAST_FIELD_GAUSS = 1e-3  # chosen: hundreds of times less than the level field but near the magnetic poles
LEAST_STEP_S = 1e-3  # keeps a division finite

# Headings that are refused for three times as long as they agreed before are as good as what the filter learnt of them,
# within bounds: a moment, and three times as long as a vehicle passes by steel. All chosen.
RECONSIDERED_TIMES, LEAST_RECONSIDERED_S, RECONSIDERED_S = 3.0, 3.0, 30.0
with_time = replacing(HeadingMemory, "read_s", "fused_rad2")
with_refusal = replacing(HeadingMemory, "agreed_s", "refused_s")
with_field = replacing(HeadingMemory, "field_rad")


@equation
def heading_variance(t_s: float, m: HeadingMemory, s: AttitudeSettings) -> float:
    """Variance of one heading [rad2] whose error lasts for many: 2 sigma^2 tau/dt, at least sigma^2."""
    step_s = larger(t_s - m.read_s, LEAST_STEP_S)
    return s.heading_noise_rad * s.heading_noise_rad * larger(1.0, 2.0 * s.heading_time_s / step_s)


class HeadingVerdict(NamedTuple):
    """Verdict on a heading: memory and offer."""

    heading: HeadingMemory
    offer: Offer


@equation
def offered_heading(
    t_s: float, read_rad: float, stated: float, reason: int, m: HeadingMemory, s: AttitudeSettings
) -> HeadingVerdict:
    """A heading with the variance that is stated, or that of one alone; `weigh_heading` knows how often it is read."""
    modelled = not np.isfinite(stated)
    verdict = judged(reason, FUSED, False, NO_HEADING if m.refuted > 0.0 else FUSED)
    after = with_time(
        m,
        read_s=t_s if modelled and verdict != SILENT else m.read_s,
        fused_rad2=heading_variance(t_s, m, s) if modelled else stated,
    )
    return HeadingVerdict(
        after, Offer(read_rad, s.heading_noise_rad * s.heading_noise_rad if modelled else stated, verdict)
    )


class Weighed(NamedTuple):
    """A heading tested by its gate: its fate, the variance to fuse it with, and the doubts."""

    fate: Fate
    noise: Noise
    heading: HeadingMemory
    doubts: tuple[Doubt, Doubt]


@on_lanes(calls.weigh_heading)
def weigh_heading(
    fate: Fate, tested: Tested, gps: GpsMemory, m: HeadingMemory, *, t_s: float, gate_sigma: float
) -> Weighed:
    """The gate is that of one heading, however often it is read: an error that lasts lets none pass that is far off.

    Headings that stay refused contradict what the filter learnt of those before, which may have been wrong as well.
    Where GPS holds, it determines the heading by the course, and the headings' own lasting error is doubted by the
    contradiction. Without it the filter's heading is doubted, and so is that error where headings had agreed for more
    than a moment: nothing shows then which of them is wrong.
    """
    sound = fate.reason == FUSED
    beyond = sound and tested.innovation * tested.innovation > gate_sigma * gate_sigma * tested.total
    since_s = m.refused_s if np.isfinite(m.refused_s) else t_s
    agreed_s = since_s - m.agreed_s if np.isfinite(m.agreed_s) else 0.0
    lasts = beyond and t_s - since_s >= clamp(RECONSIDERED_TIMES * agreed_s, LEAST_RECONSIDERED_S, RECONSIDERED_S)
    doubt, held = tested.innovation * tested.innovation if lasts else 0.0, holds(gps, t_s)
    passes_s = t_s if sound and not beyond and not np.isfinite(m.agreed_s) else m.agreed_s
    waits_s = since_s if beyond else (np.nan if sound else m.refused_s)
    return Weighed(
        Fate(INNOVATION_GATE if beyond else fate.reason),
        Noise(m.fused_rad2),
        with_refusal(m, agreed_s=np.nan if lasts else passes_s, refused_s=np.nan if lasts else waits_s),
        (
            Doubt(ATTITUDE + 2, 0.0 if held else doubt),
            Doubt(INS_ERROR + 2, doubt if held or agreed_s >= LEAST_RECONSIDERED_S else 0.0),
        ),
    )


@equation
def magnetic_heading(forward_n: float, forward_e: float, declination_rad: float, m: HeadingMemory) -> float:
    """The heading that the latest level field and the filter's tilt give, from true north [rad]."""
    angle: float = arctan2(forward_e, forward_n) - m.field_rad + declination_rad
    return angle


@on_lanes(calls.judge_field)
def judge_field(
    reading: Reading, start: StartMemory, own: Attitude, m: HeadingMemory, *, t_s: float, declination_rad: float,
    s: AttitudeSettings,
) -> HeadingVerdict:  # fmt: skip
    """A magnetometer: the level field points to magnetic north."""
    running = start.started > 0.0
    rotation = rotation_from_quaternion(
        own.qw if running else start.qw,
        own.qx if running else start.qx,
        own.qy if running else start.qy,
        own.qz if running else start.qz,
    )
    north, east, _ = to_earth(rotation, reading.value_0, reading.value_1, reading.value_2)
    level = np.sqrt(north * north + east * east)
    seen = reading.arrived > 0.0 and level > LEAST_FIELD_GAUSS
    after = with_field(m, field_rad=arctan2(east, north) if seen else m.field_rad)
    reason = usable_in_flight(reading, level, 0.0, start.started)
    read_rad = magnetic_heading(rotation[0], rotation[3], declination_rad, after)
    return offered_heading(t_s, read_rad, np.nan, reason if seen else SILENT, after, s)


@on_lanes(calls.judge_yaw)
def judge_yaw(
    reading: Reading, start: StartMemory, m: HeadingMemory, *, t_s: float, stated_apart: bool, s: AttitudeSettings
) -> HeadingVerdict:
    """An external heading; before the start it is noted as the angle to north, as that of a level field is.

    stated_apart: the filter's first heading is to be this one.
    """
    reason = usable_in_flight(reading, reading.value_0, 0.0, start.started)
    noted = stated_apart and start.started == 0.0 and is_received(reading) and bool(np.isfinite(reading.value_0))
    after = with_field(m, field_rad=-reading.value_0 if noted else m.field_rad)
    return offered_heading(t_s, reading.value_0, reading.variance_0, reason, after, s)


@procedure
def conclude_heading(work: Work, lanes: Lanes, t_s: float, sensor: int, s: AttitudeSettings, o: Output) -> None:
    """The heading that was judged is held against the gate of one, fused and written down."""
    heading(work, lanes, 0)
    sign_all(work, lanes, HEADING_OFF, 1.0)
    offer_what_is_sound(work, lanes)
    expect(work, lanes, states_of(lanes), True)
    weigh_heading(work, lanes, t_s, gate_sigma=s.gate_sigma)
    conclude(work, lanes, t_s, sensor, 0, s.gate_sigma, o)


@procedure
def take_heading(work: Work, lanes: Lanes, t_s: float, sensor: int, fitted: Equipment, p: Work, o: Output) -> None:
    """A magnetometer, or a heading from elsewhere."""
    s = load_attitude_settings(p)
    if sensor == Sensor.MAG:
        judge_field(work, lanes, t_s, declination_rad=fitted.declination_rad, s=s)
    else:
        judge_yaw(work, lanes, t_s, fitted.heading == FROM_YAW, s)
    conclude_heading(work, lanes, t_s, sensor, s, o)
