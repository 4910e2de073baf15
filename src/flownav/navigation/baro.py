"""Pressure heights: the barometer with its offset, which the first reading finds."""

from typing import NamedTuple

from flownav.core.compile import Lanes, Work, equation, procedure, replacing
from flownav.estimation.covariance import consider, consider_none
from flownav.estimation.laws.height import baro_altitude
from flownav.estimation.named import PositionNed
from flownav.estimation.states import ACCEL_BIAS, BARO, GROUND, POSITION, VELOCITY
from flownav.navigation import calls
from flownav.navigation.kernel_settings import HeightSettings
from flownav.navigation.memory import GROUNDED
from flownav.navigation.offers import conclude, note_height
from flownav.navigation.packed import load_height_settings
from flownav.navigation.reasons import FUSED, judged, stated_or, usable_in_flight
from flownav.navigation.records import Reading, StartMemory, WitnessMemory
from flownav.navigation.tape import BARO_FOUND, Output
from flownav.navigation.trust import OF_BARO, follow_noise
from flownav.navigation.verdicts import UNKNOWN_M, Event, Offer, Reset, on_lanes

with_datum = replacing(WitnessMemory, "known")


class BaroVerdict(NamedTuple):
    """Verdict on a pressure height: memory, reset of the datum, event, and offer to the filter."""

    baro: WitnessMemory
    reset: Reset
    found: Event
    offer: Offer


@on_lanes(calls.judge_baro)
def judge_baro(
    reading: Reading, start: StartMemory, position: PositionNed, m: WitnessMemory, *, s: HeightSettings
) -> BaroVerdict:
    """Height from pressure [m]; the first reading finds the offset."""
    variance = stated_or(reading.variance_0, s.baro_sigma_m * s.baro_sigma_m)
    reason = judged(usable_in_flight(reading, reading.value_0, variance, start.started), FUSED, False, FUSED)
    first = reason == FUSED and m.known == 0.0
    offset_m = reading.value_0 + position.pos_d
    return BaroVerdict(
        with_datum(m, known=1.0 if first else m.known),
        Reset(BARO if first else -1, offset_m, UNKNOWN_M * UNKNOWN_M),
        Event(BARO_FOUND if first else -1, offset_m),
        Offer(reading.value_0, variance * m.factor, reason),
    )


@equation
def consider_height(work: Work, lanes: Lanes) -> None:
    """Pressure is no judge of the height of a vehicle that stands, or not yet known to stand or to fly: it determines
    the barometer's offset then. One that began 10 m wrong had lifted a vehicle off its pad before the first window
    ended.
    """
    consider(work, lanes, POSITION + 2, GROUNDED)
    consider(work, lanes, VELOCITY + 2, GROUNDED)
    consider(work, lanes, ACCEL_BIAS + 2, GROUNDED)
    consider(work, lanes, GROUND, GROUNDED)


@procedure
def take_baro(work: Work, lanes: Lanes, t_s: float, sensor: int, p: Work, o: Output) -> None:
    """Height from pressure."""
    s = load_height_settings(p)
    judge_baro(work, lanes, t_s, s, OF_BARO, o)
    consider_height(work, lanes)
    baro_altitude(work, lanes, 0)
    conclude(work, lanes, t_s, sensor, 0, s.gate_sigma, o)
    consider_none(work, lanes)
    follow_noise(work, lanes, t_s, OF_BARO, gate_sigma=s.gate_sigma)
    note_height(work, lanes, t_s)
