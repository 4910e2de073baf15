"""The noise of a flow reading: the noise of the sensor's reports by the sensor file or the settings, and a factor by
the innovations.
"""

import numpy as np

from flownav.core.compile import clamp, equation, larger, smaller
from flownav.navigation.height import range_variance
from flownav.navigation.kernel_settings import FlowSettings
from flownav.navigation.records import FlowMemory, Look
from flownav.sensors.flow import flow_noise_sigma

SMALLEST_EXCESS, LARGEST_EXCESS = 0.25, 400.0  # half and 20 times sigma: chosen; both ends held by test_trust
# Huber's 2.5 sigma, and E min(x^2, 6.25) of a normal x (test_trust). Unbounded, one spike in 20 readings makes the flow
# 400 times noisier, the spikes are fused, and 38 s of flight end 1.5 m off instead of 0.2.
LARGEST_CHANGE, MEAN_CHANGE = 6.25, 0.9776
AGREEMENT_S = 1.0  # chosen, held by test_judges; integrity.md has what it makes of the fault catalogue
# on average 1; chosen: by them 213 of 1002 clean flights doubt the flow, most of them landed (integrity.md)
DOUBTED_RATIO, TRUSTED_RATIO = 4.0, 2.0
# a reversed flow agrees as the speed passes through 0; fused then, it went 20 m off beside GPS (test_protection)
DOUBT_S = 5.0
LONGEST_STEP_S = 1.0  # chosen: readings further apart are independent
FULL_QUALITY = 255.0
LEAST_RANGE_M = 0.05  # keeps a share finite: no flow is fused so near
LEAST_STEP_S = 1e-3  # keeps a division finite
BETTER_S, WORSE_S = 1.0, 30.0  # texture is lost for 2 to 6 s; followed in 1 s, that is usual (test_outages_of_all_aid)


@equation
def flow_variance(range_m: float, speed_m_s: float, quality: float, angular: bool, s: FlowSettings) -> float:
    """Variance of a flow velocity as the sensor reports it [m2/s2], its gain and all: the sensor file's noise at this
    height, or (sigma_flow r)^2 + floor^2.

    sigma_flow goes with the quality (as PX4's EKF2). A metric sensor multiplied by a range of its own, whose error
    scales its velocity. speed_m_s: as reported.
    """
    low, good = s.flow_low_quality_sigma_rad_s, s.flow_sigma_rad_s
    sigma = (low + (good - low) * quality / FULL_QUALITY) * range_m
    modelled = sigma * sigma + s.flow_floor_m_s * s.flow_floor_m_s
    stated = flow_noise_sigma(range_m, s.noise)  # type: ignore[arg-type]  # it reads the noise alone
    spread = range_variance(range_m, s.range_sigma_m, s.range_relative_sigma) / (range_m * range_m)
    scaled = 0.0 if angular else speed_m_s * speed_m_s * spread
    return (stated * stated if s.noise.stated > 0.0 else modelled) + scaled


@equation
def disputed_variance(look: Look, speed_m_s: float) -> float:
    """Variance of an angular flow's velocity due to an error of the height [m2/s2]: the speed times the share by which
    the newest range disputes that height, squared. speed_m_s: as reported.

    Over a table's edge, or a ledge, flow and range see different ground for a moment, and neither is known to be below.
    """
    share = look.disputed_m / larger(look.range_m, LEAST_RANGE_M)
    return speed_m_s * speed_m_s * share * share


@equation
def blindness(quality: float, usual: float) -> float:
    """0 for a sensor that sees at least half as well as it usually does, 1 for one that sees nothing."""
    return larger(0.0, 1.0 - quality / (0.5 * larger(usual, 1.0)))


@equation
def blind_variance(range_m: float, quality: float, usual: float, step_s: float, s: FlowSettings) -> float:
    """Variance added where a sensor's quality is less than half of its usual one [m2/s2], in what it reports.

    Ground without texture is read as ground that stands still, however often it is read: such an error lasts, and does
    not average out as noise does.
    """
    blind = s.flow_low_quality_sigma_rad_s * blindness(quality, usual) * range_m
    return blind * blind * larger(1.0, s.flow_low_quality_s / larger(step_s, LEAST_STEP_S))


@equation
def followed_quality(quality: float, step_s: float, usual: float) -> float:
    """How well a sensor usually sees, by its own scale: better quality is followed soon, worse slowly."""
    time_s = BETTER_S if quality > usual else WORSE_S
    return usual + smaller(larger(step_s, 0.0) / time_s, 1.0) * (quality - usual)


@equation
def followed_agreement(square: float, t_s: float, m: FlowMemory) -> float:
    """How well flow agrees with what the filter expects of it: nu^2 over its variance, 1 on average.

    A wrong sign, swapped axes or garbage stay within the gate reading by reading, but not on average.
    """
    share = smaller(larger(t_s - m.taken_s, 0.0) / AGREEMENT_S, 1.0)
    return m.ratio + 0.5 * share * (square - m.ratio)


@equation
def followed_likeness(product: float, t_s: float, m: FlowMemory) -> float:
    """How alike innovations are, one after the other (`alike`), on average."""
    share = smaller(larger(t_s - m.taken_s, 0.0) / AGREEMENT_S, 1.0)
    return m.likeness + 0.5 * share * (product - m.likeness)


@equation
def followed_excess(
    innovation: float, before: float, noise: float, t_s: float, m: FlowMemory, s: FlowSettings
) -> float:
    """How many times noisier than its model the flow is: the mean of half the square of what changes in its innovation
    from one reading to the next, over R.

    A poor lens or floor shows there, and a good one too. What lasts in an innovation is not the flow's noise: it is of
    the motion, and counts against the accelerometer (`trust`). Nor are spikes, which the gate refuses: a change counts
    as no more than 2.5 standard deviations (Huber, Robust Estimation of a Location Parameter, 1964, proposal 2).
    """
    change = innovation - before
    seen = m.excess * smaller(0.5 * change * change / noise, LARGEST_CHANGE) / MEAN_CHANGE
    share = smaller(larger(t_s - m.taken_s, 0.0), LONGEST_STEP_S) / s.flow_noise_time_s
    return clamp(m.excess + 0.5 * share * (seen - m.excess), SMALLEST_EXCESS, LARGEST_EXCESS)


@equation
def lasting_doubt(doubted: float, ratio: float) -> float:
    """Doubted above one ratio, trusted again below a smaller one."""
    return 1.0 if ratio > DOUBTED_RATIO else (0.0 if ratio < TRUSTED_RATIO else doubted)


@equation
def alike(innovation: float, before: float, total: float) -> float:
    """The product of two innovations of a component, one after the other, over their variance: 0 on average for noise
    of any size, 1 and more for innovations with the same error. None counts as more than 2.5 standard deviations.
    """
    limit = np.sqrt(LARGEST_CHANGE * total)
    return clamp(innovation, -limit, limit) * clamp(before, -limit, limit) / total


@equation
def wrong_since(t_s: float, likeness: float, wrong_s: float) -> float:
    """When a flow that is wrong in the same way again and again was so last [s], -infinity for one that is not.

    It is believed again after DOUBT_S: a flow of the wrong sign agrees while the vehicle happens to stand.
    """
    wrong = likeness > (DOUBTED_RATIO if np.isinf(wrong_s) else 0.5 * TRUSTED_RATIO)
    last_s = t_s if wrong else wrong_s
    return last_s if t_s - last_s <= DOUBT_S else -np.inf


@equation
def lasting_walk(range_m: float, speed_m_s: float, s: FlowSettings) -> float:
    """The walk of a position that flow alone determines [m2/s]: 2 e^2 tau of a velocity error e that lasts for tau.

    White noise averages out, and what lasts of a flow's error does not: a part as of a gyro, over the range, and a part
    of the speed.
    """
    turning, scaled = s.flow_lasting_rad_s * range_m, s.flow_lasting_share * speed_m_s
    return 2.0 * s.flow_lasting_s * (turning * turning + scaled * scaled)
