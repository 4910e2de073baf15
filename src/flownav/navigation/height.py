"""Height readings: the rangefinder over ground whose level is a state, and the barometer with its offset."""

from __future__ import annotations

import numpy as np

from flownav.compile import ONE_LANE, procedure
from flownav.estimation.landing.algebra import settle
from flownav.estimation.landing.observe import BARO_STATES, RANGE_STATES, observe_baro, observe_range, rotation_of
from flownav.estimation.landing.states import BARO, GROUND, POSITION, STATES, VELOCITY
from flownav.navigation.journal import reset_state
from flownav.navigation.offers import (
    DATUM,
    FUSED,
    INNOVATION_GATE,
    OUT_OF_RANGE,
    STUCK,
    TILTED,
    conclude,
    put,
    usable,
)
from flownav.navigation.state import (
    BARO_FOUND,
    BARO_KNOWN,
    GROUND_FOUND,
    GROUND_RESET,
    GROUND_SET,
    HEIGHT_CLOCK,
    RANGE_CLOCK,
    RANGE_DOUBTED,
    RANGE_DOWN,
    RANGE_LAST,
    RANGE_SAID,
    RANGE_SAME_SINCE,
    RANGE_SINCE,
    RANGE_STUCK,
    ROWS,
    STARTED,
    VALUE,
    Reading,
    Running,
    write_event,
)
from flownav.navigation.vibration import doubt

UNKNOWN_M = 100.0
DOUBTING_S = 0.05  # a range that alone tells the height and is rejected so long is believed, not the accelerometer
ALONE = 5.0  # times the travel, where nothing else tells the height


@procedure
def range_variance(range_m: float, on: Running) -> float:
    """Variance of a range reading [m2]: a floor and a share of the range."""
    share = on.settings.range_relative_sigma * range_m
    return on.settings.range_sigma_m * on.settings.range_sigma_m + share * share


@procedure
def repeats(reading: Reading, on: Running) -> bool:
    """Whether the range has repeated one value to the last digit for long: no news, whatever the vehicle does.

    Where no barometer, GPS or pad has told the height lately, the range is all there is, and it is believed unless
    the height travels by more than the filter's own drift.
    """
    memory, settings, range_m = on.memory, on.settings, reading.value[0]
    if range_m != memory[RANGE_LAST]:
        memory[RANGE_LAST], memory[RANGE_SAME_SINCE] = range_m, reading.t_s
        memory[RANGE_DOWN] = on.work[ROWS.state + POSITION + 2]
        return False
    lasting_s = reading.t_s - memory[RANGE_SAME_SINCE]
    alone = reading.t_s - memory[HEIGHT_CLOCK] > settings.height_hold_s
    drift = 3.0 * np.sqrt(on.work[ROWS.covariance + (VELOCITY + 2) * (STATES + 1)]) * lasting_s
    least = ALONE * settings.range_stuck_travel_m + drift if alone else 0.0
    repeating: bool = lasting_s >= settings.range_stuck_s and travelled(on) >= least
    return repeating


@procedure
def travelled(on: Running) -> float:
    """How far the height has gone since the range began to repeat itself [m]."""
    travel: float = np.abs(on.work[ROWS.state + POSITION + 2] - on.memory[RANGE_DOWN])
    return travel


@procedure
def take_range(reading: Reading, on: Running) -> None:
    """Height over the ground below. Where range is rejected for long, the ground has a step."""
    t_s, memory, settings, work = reading.t_s, on.memory, on.settings, on.work
    range_m, noise = reading.value[0], reading.variance[0]
    if np.isnan(noise):
        noise = range_variance(range_m, on)
    reason = usable(reading.quality, range_m, noise, on)
    if memory[STARTED] == 0.0:
        return
    upright = rotation_of(work, ONE_LANE, ROWS, 0)[8]
    if reason == FUSED and not settings.range_min_m <= range_m <= settings.range_max_m:
        reason = OUT_OF_RANGE
    if reason == FUSED and upright < np.cos(settings.tilt_limit_rad):
        reason = TILTED
    if reason == FUSED and repeats(reading, on):
        reason = STUCK
        if travelled(on) >= settings.range_stuck_travel_m and memory[RANGE_SAID] != memory[RANGE_SAME_SINCE]:
            write_event(t_s, RANGE_STUCK, range_m, on.tape)
            memory[RANGE_SAID] = memory[RANGE_SAME_SINCE]
    below = work[ROWS.state + POSITION + 2] + (range_m + settings.range_below_m) * upright
    if reason == FUSED and memory[GROUND_SET] == 0.0:
        set_ground(below, on)
        memory[GROUND_SET] = 1.0
        write_event(t_s, GROUND_FOUND, below, on.tape)
    offer_range(range_m, noise, reason, on)
    reason = conclude(reading, 0, range_m, reason, on)
    if reason == FUSED or reason == DATUM:  # noqa: SIM109
        memory[RANGE_CLOCK], memory[RANGE_SINCE] = t_s, np.nan
    elif reason == INNOVATION_GATE:
        if np.isnan(memory[RANGE_SINCE]):
            memory[RANGE_SINCE] = t_s
            memory[RANGE_DOUBTED] = 0.0
        alone = t_s - memory[HEIGHT_CLOCK] > settings.height_hold_s
        if alone and memory[RANGE_DOUBTED] == 0.0 and t_s - memory[RANGE_SINCE] >= DOUBTING_S:
            doubt(t_s, work[ROWS.innovation], on)
            memory[RANGE_DOUBTED] = 1.0  # once: doubted at each reading, a short echo would be believed too
        if t_s - memory[RANGE_SINCE] >= settings.ground_reset_s:
            set_ground(below, on)
            offer_range(range_m, noise, FUSED, on)
            settle(work, ONE_LANE, ROWS, settings.filter.gate_sigma)
            memory[RANGE_CLOCK], memory[RANGE_SINCE] = t_s, np.nan
            write_event(t_s, GROUND_RESET, below, on.tape)


@procedure
def offer_range(range_m: float, noise: float, reason: int, on: Running) -> None:
    """The law of a range, put for its test."""
    on.work[VALUE] = range_m
    observe_range(on.work, ONE_LANE, ROWS, VALUE, on.settings.range_below_m)
    put(noise, reason, RANGE_STATES, on.work)


@procedure
def set_ground(below_m: float, on: Running) -> None:
    """The ground is unknown but for this reading, which is about to be fused."""
    on.work[ROWS.state + GROUND] = below_m
    reset_state(GROUND, UNKNOWN_M * UNKNOWN_M, on)


@procedure
def take_baro(reading: Reading, on: Running) -> None:
    """Height from pressure; the first reading finds the offset."""
    work, memory = on.work, on.memory
    altitude_m, noise = reading.value[0], reading.variance[0]
    if np.isnan(noise):
        noise = on.settings.baro_sigma_m * on.settings.baro_sigma_m
    reason = usable(reading.quality, altitude_m, noise, on)
    if memory[STARTED] == 0.0:
        return
    if reason == FUSED and memory[BARO_KNOWN] == 0.0:
        work[ROWS.state + BARO] = altitude_m + work[ROWS.state + POSITION + 2]
        reset_state(BARO, UNKNOWN_M * UNKNOWN_M, on)
        memory[BARO_KNOWN] = 1.0
        write_event(reading.t_s, BARO_FOUND, work[ROWS.state + BARO], on.tape)
    work[VALUE] = altitude_m
    observe_baro(work, ONE_LANE, ROWS, VALUE)
    put(noise, reason, BARO_STATES, on.work)
    if conclude(reading, 0, altitude_m, reason, on) == FUSED:
        memory[HEIGHT_CLOCK] = reading.t_s
