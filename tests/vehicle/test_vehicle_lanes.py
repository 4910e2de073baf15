"""The compiled helicopter: the same bits alone and in lanes, and the same numbers as plain Python."""

from __future__ import annotations

import numba
import numpy as np

from flownav.core.compile import LANES, ONE_LANE, lane_access, stepping
from flownav.vehicle import helicopter
from flownav.vehicle.helicopter import derivative
from flownav.vehicle.kinds import load_vehicle
from flownav.vehicle.state import Controls, HelicopterState, in_wind, normalised
from flownav.vehicle.trim import parked, trim

FIELDS = len(HelicopterState._fields)
moved = stepping(HelicopterState)
load, store = lane_access(HelicopterState, 0)
load_controls, _ = lane_access(Controls, FIELDS)
VEHICLE = load_vehicle()
HOVER = trim(VEHICLE, height_m=3.0)
WIND = in_wind(1.0, -2.0, 0.2)


@numba.njit(error_model="numpy")
def march(work, lanes, vehicle, dt, count):
    """Euler steps of the whole state in a gusty wind."""
    for _ in range(count):
        for lane in range(len(lanes)):
            state = load(work, lanes, lane)
            rate = derivative(state, load_controls(work, lanes, lane), WIND, vehicle)
            store(work, lanes, lane, normalised(moved(state, rate, dt)))


def starts(count):
    """Flights in the air and on the ground, each with its own state and controls."""
    rng = np.random.default_rng(3)
    ground = parked(VEHICLE, Controls(0.0, 0.0, 0.0, 0.1))
    for i in range(count):
        controls = np.array(HOVER.controls) + 0.01 * rng.normal(size=4)
        state = np.array(HOVER.state if i % 2 else ground) + 0.01 * rng.normal(size=FIELDS) * (np.arange(FIELDS) > 1)
        yield state, controls


def flown(lanes, flights, count):
    work = np.zeros((FIELDS + 4, len(lanes)))
    for lane, (state, controls) in enumerate(flights):
        work[:FIELDS, lane], work[FIELDS:, lane] = state, controls
    flat = work.reshape(-1)
    march(flat, lanes, VEHICLE, 1e-3, count)
    return flat.reshape(work.shape)[:FIELDS].T


def test_a_flight_is_the_same_bits_alone_and_among_fifteen_others():
    flights = list(starts(len(LANES)))
    together = flown(LANES, flights, 300)
    alone = np.array([flown(ONE_LANE, [flight], 300)[0] for flight in flights])
    assert np.isfinite(together).all()
    assert together.tobytes() == alone.tobytes()


def test_the_compiled_helicopter_is_the_plain_one():
    state, controls = next(starts(1))
    compiled = flown(ONE_LANE, [(state, controls)], 100)[0]
    now = HelicopterState(*state)
    for _ in range(100):
        rate = helicopter.derivative(now, Controls(*controls), WIND, VEHICLE)
        now = normalised(moved(now, rate, 1e-3))
    assert np.allclose(compiled, now, rtol=1e-12, atol=1e-14)
