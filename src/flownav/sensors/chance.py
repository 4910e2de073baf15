"""What happens to a sensor by chance: an event at one reading, a spell of many, and a factor that is somewhat off.

Every draw is a standard normal that the caller hands in. An event of probability P happens where the normal exceeds
the level q with 1 - Phi(q) = P, so that no uniform draw is needed and masks stay selects.

A spell (no fix, no texture, a value that sticks) is a two-state chain that is advanced once a reading (Gilbert, Bell
System Technical Journal 39, 1960, who modelled bursts of errors so): it ends with probability T/mean at each reading,
hence lasts `mean` on average, and begins with the probability that gives it its share of the time.
"""

from __future__ import annotations

from statistics import NormalDist

from flownav.core.compile import equation

BEYOND_ANY_NORMAL = 1e3  # the generator's normals end at 8.5


@equation
def spell(now: float, normal: float, begins_above: float, ends_above: float) -> float:
    """1 while the spell lasts, else 0, one reading on."""
    ended = 0.0 if normal > ends_above else 1.0
    begun = 1.0 if normal > begins_above else 0.0
    return ended if now > 0.5 else begun


@equation
def factor(share: float, normal: float) -> float:
    """A positive factor of median 1: 1 + share n upwards, and its reciprocal as far downwards."""
    above = 1.0 + share * normal
    below = 1.0 / (1.0 - share * normal if normal < 0.0 else 1.0)
    return above if normal >= 0.0 else below


def level_of(probability: float) -> float:
    """What a standard normal exceeds with this probability: for 0 it never does, for 1 always.

    ValueError where the probability is not between 0 and 1.
    """
    if not 0.0 <= probability <= 1.0:
        raise ValueError(f"a probability from 0 to 1 is needed, got {probability}")
    if probability in (0.0, 1.0):
        return BEYOND_ANY_NORMAL if probability == 0.0 else -BEYOND_ANY_NORMAL
    return -NormalDist().inv_cdf(probability)


def spell_levels(share: float, mean_s: float, period_s: float) -> tuple[float, float]:
    """`(begins_above, ends_above)` of spells that fill `share` of the time and last `mean_s` (one reading at least).

    ValueError where the share is not between 0 and 0.5.
    """
    if not 0.0 <= share <= 0.5:
        raise ValueError(f"a share from 0 to 0.5 is needed, got {share}")
    ending = min(1.0, period_s / mean_s) if mean_s > 0.0 else 1.0
    return level_of(ending * share / (1.0 - share)), level_of(ending)
