"""The usual attitude of a vehicle, for one whose tilt no sensor determines: who takes off vertically flies level, more
or less.

It is a witness that is used only where there is no better one: a filter that knows its tilt keeps every bit. A gyro
that reads its vibration at its aliases, beside an accelerometer that does, determines no tilt, and beyond its limit no
range or flow would be used again.
"""

from flownav.core.compile import Lanes, Work, equation, procedure, squared
from flownav.estimation.laws.attitude import level
from flownav.navigation import calls
from flownav.navigation.attitude import AttitudeVariance
from flownav.navigation.offers import fuse_offered, observe_innovation
from flownav.navigation.reasons import FUSED, SILENT
from flownav.navigation.records import StartMemory
from flownav.navigation.tape import Output
from flownav.navigation.verdicts import Anywhere, Offer, on_lanes

LOST_TILT_RAD, USUAL_TILT_RAD = 0.2, 0.3  # chosen: small drones hover within 0.1 rad, and few lean by more than 0.5


@equation
def is_lost(start: StartMemory, variance: AttitudeVariance) -> bool:
    """Whether a lane's tilt is as unsure as that of any vehicle that takes off vertically."""
    return start.started > 0.0 and variance.about_n + variance.about_e > squared(LOST_TILT_RAD)


@on_lanes(calls.is_tilt_lost)
def is_tilt_lost(start: StartMemory, variance: AttitudeVariance) -> Anywhere:
    """Whether any lane does not know how it is tilted."""
    return Anywhere(is_lost(start, variance))


@on_lanes(calls.offer_level)
def offer_level(start: StartMemory, variance: AttitudeVariance) -> Offer:
    """It flies level, more or less."""
    return Offer(0.0, squared(USUAL_TILT_RAD), FUSED if is_lost(start, variance) else SILENT)


@procedure
def assume_usual(work: Work, lanes: Lanes, gate_sigma: float, o: Output) -> None:
    """Offer a level attitude, in the lanes where nothing better determines the tilt."""
    if is_tilt_lost(work, lanes):
        for axis in range(2):
            offer_level(work, lanes)
            level(work, lanes, axis)
            observe_innovation(work, lanes)
            fuse_offered(work, lanes, gate_sigma, o)
