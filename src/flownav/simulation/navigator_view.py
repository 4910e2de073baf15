"""The simulator's view of the navigator: records of the navigator's buffer, which laws take as `nav`."""

from typing import NamedTuple

from flownav.core.compile import Lanes, Layout, Work, equation
from flownav.estimation.covariance import covariance_of, variance_of
from flownav.estimation.motion import rotation_of
from flownav.estimation.states import GROUND, PAD, POSITION, STATE
from flownav.navigation.memory import MEMORY, PAD_KNOWN
from flownav.navigation.rows import body_velocity_variance
from flownav.simulation.layout import PLANT
from flownav.simulation.records import Spread


class PadEstimate(NamedTuple):
    """Where the pad is, NED; known above 0 where it has been seen or stood upon."""

    known: float
    north_m: float
    east_m: float


class GroundEstimate(NamedTuple):
    """Where the ground below is."""

    down_m: float


class StatedVariance(Spread):
    """The variances of position NED and of body velocity."""


class PadVariance(NamedTuple):
    """Variances of the position NED, and of that over the pad."""

    own_n_m2: float
    own_e_m2: float
    over_n_m2: float
    over_e_m2: float


@equation
def stated_variance(nav: Work, lanes: Lanes, lane: int) -> StatedVariance:
    """The filter's stated variances of position and body velocity."""
    r = rotation_of(nav, lanes, lane)
    return StatedVariance(
        variance_of(nav, lanes, POSITION, lane),
        variance_of(nav, lanes, POSITION + 1, lane),
        variance_of(nav, lanes, POSITION + 2, lane),
        body_velocity_variance(nav, lanes, lane, r[0], r[3], r[6]),
        body_velocity_variance(nav, lanes, lane, r[1], r[4], r[7]),
        body_velocity_variance(nav, lanes, lane, r[2], r[5], r[8]),
    )


@equation
def pad_variance(nav: Work, lanes: Lanes, lane: int) -> PadVariance:
    """The filter's stated variances of its position, and of that over the pad."""
    north, east = variance_of(nav, lanes, POSITION, lane), variance_of(nav, lanes, POSITION + 1, lane)
    return PadVariance(north, east, north + of_pad(nav, lanes, 0, lane), east + of_pad(nav, lanes, 1, lane))


@equation
def of_pad(nav: Work, lanes: Lanes, axis: int, lane: int) -> float:
    """Contribution of the pad's place to the variance of the position over it, along north (0) or east (1) [m2]."""
    beside = covariance_of(nav, lanes, POSITION + axis, PAD + axis, lane)
    pad: float = variance_of(nav, lanes, PAD + axis, lane) - 2.0 * beside
    return pad


_NAVIGATOR = Layout(below=MEMORY)
_NAVIGATOR.name(PadEstimate, PAD_KNOWN, STATE + PAD, STATE + PAD + 1)
_NAVIGATOR.name(GroundEstimate, STATE + GROUND)
_NAVIGATOR.derive(StatedVariance, stated_variance)
_NAVIGATOR.derive(PadVariance, pad_variance)

_BOTH = Layout(below=PLANT)
_BOTH.beside(_NAVIGATOR, "nav")
on_both = _BOTH.on_lanes
