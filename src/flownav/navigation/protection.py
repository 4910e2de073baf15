"""How far off the position may be: levels over all that a sensor may do unseen.

The level of one hypothesis is what is left of the filter's own error, and what such a fault may have done: the effect
of one unit (`estimation.hypotheses`) times the size that innovations leave possible. The level is the largest of them.
After Brenner, Integrated GPS/Inertial Fault Detection Availability (Navigation 43(2), 1996), with effects that are
followed instead of one filter for each hypothesis. Unlike there no probability is promised:
docs/explanation/integrity.md measures how often the error is beyond the level.
"""

import numpy as np

from flownav.core.compile import Lanes, Work, equation, larger, procedure, row_of, smaller
from flownav.estimation.covariance import covariance_of
from flownav.estimation.hypotheses import (
    COUNT,
    FLOW_REVERSED,
    LEFT,
    followed,
    larger_axis,
)
from flownav.estimation.named import PositionNed
from flownav.estimation.states import MOST_HYPOTHESES, POSITION
from flownav.navigation.fault_sizes import largest_size, level_effect, moved_by, size_in
from flownav.navigation.memory import (
    MEMORY,
    SCALE_DOUBT,
    load_gps,
    load_range,
    load_suspicion,
    store_levels,
)
from flownav.navigation.records import Levels
from flownav.navigation.rows import position_variance

# Their joint effect is measured (make integrity, integrity.md), none of them alone.
OWN_ERROR_SIGMAS = 4.0  # of the filter's own error, where nothing fails: no step of the clean flights lies above
OWN_DOWN_SIGMAS = 2.5  # of the height: 2.48 at most, with sensors drawn for each flight (tools/height_over_sigma.py)
SIGMAS_BESIDE = 2.0  # of it, beside a fault
load_position, _ = MEMORY.access(PositionNed)


@equation
def disputed(newest_m: float, before_m: float, usual_m: float) -> float:
    """How far the height is off by two ranges in a row, fused or not [m]: one alone may be a stray.

    Beyond what is usual it may have gone on as it went from the one to the other.
    """
    least_m = smaller(abs(newest_m), abs(before_m)) if newest_m * before_m > 0.0 else 0.0
    return abs(newest_m) + larger(abs(newest_m) - abs(before_m), 0.0) if least_m > usual_m else least_m


@equation
def worst_fault(work: Work, lanes: Lanes, lane: int) -> Levels:
    """The most that any fault which is sought may have done by now [m]."""
    horizontal_m, vertical_m = 0.0, 0.0
    for k in range(COUNT):
        largest = largest_size(k, size_in(work, lanes, k, lane))
        moved_m = level_effect(work, lanes, k, lane)
        horizontal_m = larger(horizontal_m, moved_m * largest)
        vertical_m = larger(vertical_m, abs(moved_by(work, lanes, k, 2, lane)) * largest)
    return Levels(horizontal_m, vertical_m)


@equation
def levels(work: Work, lanes: Lanes, lane: int) -> Levels:
    """The protection levels of a lane at its instant."""
    doubt, position = row_of(work, lanes, SCALE_DOUBT, lane), load_position(work, lanes, lane)
    north_m, east_m = doubt * position.pos_n, doubt * position.pos_e
    own_m = larger_axis(
        position_variance(work, lanes, 0, lane),
        position_variance(work, lanes, 1, lane),
        covariance_of(work, lanes, POSITION, POSITION + 1, lane) + north_m * east_m,
    )
    down_m = np.sqrt(larger(position_variance(work, lanes, 2, lane), 0.0))
    own = Levels(OWN_ERROR_SIGMAS * own_m, OWN_DOWN_SIGMAS * down_m)
    if followed(work, lanes) == 0:
        return own
    gps, ranges, worst = load_gps(work, lanes, lane), load_range(work, lanes, lane), worst_fault(work, lanes, lane)
    reset_m = np.sqrt(gps.moved_n_m * gps.moved_n_m + gps.moved_e_m * gps.moved_e_m)
    over_m = load_suspicion(work, lanes, lane).left_over_m + reset_m
    off_m = disputed(ranges.contradiction_m, ranges.before_m, SIGMAS_BESIDE * down_m)
    left_m, left_down_m = level_effect(work, lanes, LEFT, lane), abs(moved_by(work, lanes, LEFT, 2, lane))
    return Levels(
        larger(own.horizontal_m, SIGMAS_BESIDE * own_m + left_m + larger(worst.horizontal_m, over_m)),
        larger(own.vertical_m, SIGMAS_BESIDE * down_m + left_down_m + larger(worst.vertical_m, off_m)),
    )


@procedure
def set_levels(work: Work, lanes: Lanes) -> None:
    """The levels of every lane at this instant."""
    if followed(work, lanes) == 0:
        return
    for lane in range(len(lanes)):
        store_levels(work, lanes, lane, levels(work, lanes, lane))


assert FLOW_REVERSED + 1 == COUNT == LEFT == MOST_HYPOTHESES - 1
