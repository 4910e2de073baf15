"""The rotor's speed, its governor and its inflow: what lags, what droops, what an engine cut leaves."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flownav.control.design import gains_for
from flownav.control.margins import LEAST_GAIN_DB, LEAST_PHASE_DEG, margins_of
from flownav.core.errors import InputError
from flownav.vehicle import airframe, helicopter
from flownav.vehicle.corners import NOMINAL, corners
from flownav.vehicle.drive import shaft_power
from flownav.vehicle.kinds import load_vehicle
from flownav.vehicle.linearize import hover_plant, rotor_plant
from flownav.vehicle.state import CALM
from flownav.vehicle.trim import trim

VEHICLE = load_vehicle()
HOVER = trim(VEHICLE)
CUT = CALM._replace(engine=0.0)
FROZEN_1_S, SOLVED_1_S = 3.30, 1.04  # heave damping with the inflow held and in balance (test_vehicle_linearize)


def march(state, controls, seconds, vehicle=VEHICLE, around=CALM, dt=0.002):
    """The states on the way."""
    found = [state]
    for _ in range(round(seconds / dt)):
        found.append(helicopter.step(found[-1], controls, around, dt, vehicle))
    return found


def test_in_trim_nothing_of_the_rotor_changes():
    rate = helicopter.derivative(HOVER.state, HOVER.controls, CALM, VEHICLE)
    assert np.abs(np.array(rate)[3:]).max() < 1e-6
    assert HOVER.state.inflow == HOVER.induced_velocity_m_s
    assert HOVER.state.governed == pytest.approx(HOVER.power_w + HOVER.tail_power_w)


def test_inflow_follows_with_the_time_constant_of_its_mass():
    """dv'/dv = -(thrust slope + 2·2ρA·v)/m_a: Carpenter and Fridovich's lag, and the blades' own answer."""
    slope, mass = VEHICLE.main_thrust_slope_n_s_m, 1.0 / VEHICLE.per_inflow_mass_1_kg
    assert mass == pytest.approx(8.0 / 3.0 * 1.225 * 0.89**3, rel=1e-3)
    disc = slope / VEHICLE.main_inflow_speed_m_s
    assert VEHICLE.main_disc_kg_m == pytest.approx(disc)
    rates = [
        helicopter.derivative(
            HOVER.state._replace(inflow=HOVER.state.inflow + by), HOVER.controls, CALM, VEHICLE
        ).inflow
        for by in (1e-4, -1e-4)
    ]
    expected = -(slope + 2.0 * disc * HOVER.state.inflow) / mass
    assert (rates[0] - rates[1]) / 2e-4 == pytest.approx(expected, rel=1e-6)
    assert mass / (2.0 * disc * HOVER.state.inflow) == pytest.approx(0.053, abs=0.003)  # the reference's tau_i


def test_a_sinking_rotor_is_damped_as_held_at_first_and_as_balanced_later():
    sinking = HOVER.state._replace(w=0.1)
    at_once = helicopter.derivative(sinking, HOVER.controls, CALM, VEHICLE).w
    assert -at_once / 0.1 == pytest.approx(FROZEN_1_S, abs=0.06)
    settled = sinking
    for _ in range(400):  # the inflow alone goes on to its balance
        rate = helicopter.derivative(settled, HOVER.controls, CALM, VEHICLE)
        settled = settled._replace(inflow=settled.inflow + 0.002 * rate.inflow)
    assert -helicopter.derivative(settled, HOVER.controls, CALM, VEHICLE).w / 0.1 == pytest.approx(SOLVED_1_S, abs=0.02)
    balanced = helicopter.derivative_in_balance(sinking, HOVER.controls, CALM, VEHICLE)
    assert balanced.w == pytest.approx(helicopter.derivative(settled, HOVER.controls, CALM, VEHICLE).w, abs=1e-6)


def test_the_rotor_droops_under_collective_and_its_governor_brings_it_back():
    more = HOVER.controls._replace(col=HOVER.collective_rad + math.radians(1.0))
    speeds = np.array([state.speed for state in march(HOVER.state, more, 6.0)])
    droop = 1.0 - speeds.min() / VEHICLE.main_speed_rad_s
    assert 0.005 < droop < 0.03
    assert speeds[-1] == pytest.approx(VEHICLE.main_speed_rad_s, rel=2e-3)


def test_a_stiffer_governor_droops_less():
    more = HOVER.controls._replace(col=HOVER.collective_rad + math.radians(1.0))
    lowest = [
        min(state.speed for state in march(HOVER.state, more, 2.0, VEHICLE._replace(governor_w_s_rad=gain)))
        for gain in (40.0, 120.0)
    ]
    assert lowest[1] > lowest[0] + 0.5


def test_the_motor_gives_no_more_than_it_has_and_takes_nothing_back():
    weak = VEHICLE._replace(shaft_power_limit_w=1500.0)
    climbing = HOVER.controls._replace(col=HOVER.collective_rad + math.radians(3.0))
    end = march(HOVER.state, climbing, 2.0, weak)[-1]
    assert end.speed < 0.95 * weak.main_speed_rad_s
    assert shaft_power(end, 1.0, weak) == 1500.0
    assert end.governed < 1500.0 + 40.0  # it does not wind up
    fast = HOVER.state._replace(speed=1.5 * VEHICLE.main_speed_rad_s, governed=0.0)
    assert shaft_power(fast, 1.0, VEHICLE) == 0.0


def test_the_body_feels_what_turns_the_rotor():
    """Angular momentum about the mast: the body's torque is the rotor's drag and what makes it turn faster."""
    slow = HOVER.state._replace(speed=0.98 * VEHICLE.main_speed_rad_s)
    rate = helicopter.derivative(slow, HOVER.controls, CALM, VEHICLE)
    held = helicopter.derivative_at_inflow(
        slow, HOVER.controls, airframe.air_motion(slow, airframe.attitude(slow), CALM), airframe.attitude(slow),
        helicopter.inflow_of(slow, CALM, VEHICLE), CALM, VEHICLE,
    )  # fmt: skip
    assert rate.speed > 1.0
    turned = VEHICLE.inertia_zz_kg_m2 * (rate.r - held.r) + VEHICLE.rotor_inertia_kg_m2 * rate.speed
    assert turned == pytest.approx(0.0, abs=1e-9)


def test_without_its_engine_the_rotor_runs_down_and_the_helicopter_falls():
    states = march(HOVER.state._replace(pos_d=-50.0), HOVER.controls, 2.0, around=CUT)
    speeds = [state.speed for state in states]
    assert (np.diff(speeds) < 0.0).all()
    first = helicopter.derivative(HOVER.state, HOVER.controls, CUT, VEHICLE)
    taken = (HOVER.power_w + HOVER.tail_power_w) / VEHICLE.main_speed_rad_s
    assert first.speed == pytest.approx(-taken / VEHICLE.rotor_inertia_kg_m2, rel=1e-6)
    assert states[-1].w > 3.0
    assert np.isfinite(np.array(states[-1])).all()


def test_a_rotor_that_stands_is_no_error():
    still = HOVER.state._replace(speed=0.0, inflow=0.0, pos_d=-0.2)
    assert np.isfinite(np.array(helicopter.derivative(still, HOVER.controls, CUT, VEHICLE))).all()


def test_the_plant_with_its_rotor_lies_between_the_inflow_held_and_in_balance():
    """Heave by collective: at 100 rad/s as held, at 0.3 rad/s, where the governor has answered, as balanced."""
    held, solved = (hover_plant(VEHICLE, HOVER, freeze_inflow=frozen) for frozen in (True, False))
    whole = rotor_plant(VEHICLE, HOVER)
    assert whole.a.shape == (25, 25)

    def heave(plant, omega):
        n = len(plant.a)
        return abs((plant.c @ np.linalg.solve(1j * omega * np.eye(n) - plant.a, plant.b))[5, 2])

    assert heave(whole, 200.0) == pytest.approx(heave(held, 200.0), rel=0.1)
    assert heave(whole, 0.3) == pytest.approx(heave(solved, 0.3), rel=0.1)


def test_the_autopilot_keeps_its_margins_with_inflow_and_rotor_speed_as_states():
    """45 degrees and 6 dB at every corner of the box, as `flownav vehicle --margins` asks of the inflow's two ends."""
    gains = gains_for(VEHICLE, HOVER, 0.0)
    worst = {}
    for corner in corners():
        try:
            about = trim(corner.vehicle)
        except InputError:
            continue
        for row in margins_of(rotor_plant(corner.vehicle, about), gains, corner.name):
            phase, gain = worst.get(row.loop, (math.inf, math.inf))
            worst[row.loop] = (min(phase, row.margins.phase_deg), min(gain, row.margins.gain_db))
    assert min(phase for phase, _ in worst.values()) >= LEAST_PHASE_DEG
    assert min(gain for _, gain in worst.values()) >= LEAST_GAIN_DB
    assert NOMINAL in {corner.name for corner in corners()}
