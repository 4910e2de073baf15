"""Trim and the signs of the controls, on the shipped helicopter and on a different one."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flownav.core.errors import InputError
from flownav.core.frames import euler_from_quaternion, quaternion_from_euler
from flownav.vehicle import helicopter
from flownav.vehicle.kinds import load_vehicle
from flownav.vehicle.state import CALM, HelicopterState, in_wind
from flownav.vehicle.trim import accelerations, trim
from vehicle_files import X_CELL

VEHICLE = load_vehicle()
HOVER = trim(VEHICLE)
derivative = helicopter.derivative_in_balance


def rates(state, controls, vehicle=VEHICLE):
    return derivative(state, controls, CALM, vehicle)


def test_the_shipped_helicopter_trims_as_the_reference_says():
    assert math.degrees(HOVER.collective_rad) == pytest.approx(4.20, abs=0.1)
    assert math.degrees(HOVER.roll_rad) == pytest.approx(5.68, abs=0.2)
    assert HOVER.power_w == pytest.approx(1280.0, rel=0.05)
    assert HOVER.induced_velocity_m_s == pytest.approx(3.54, abs=0.06)


@pytest.mark.parametrize(
    "velocity",
    [(0, 0, 0), (3, 0, 0), (12, 0, 0), (-4, 0, 0), (0, 5, 0), (0, -5, 0), (0, 0, -2), (0, 0, 0.3), (2, 1, 0.5)],
)
@pytest.mark.parametrize("height", [0.6, 3.0, 1e6])
def test_trim_leaves_no_acceleration(velocity, height):
    found = trim(VEHICLE, velocity, height)
    rate = rates(found.state, found.controls)
    assert np.abs(accelerations(rate)).max() < 1e-9
    assert (found.state.u, found.state.v, found.state.w) == velocity
    assert rate[15:] == pytest.approx([0.0] * 11, abs=1e-12)


def test_the_trim_state_says_what_the_trim_says():
    state = HOVER.state
    roll, pitch, yaw = euler_from_quaternion(state.qw, state.qx, state.qy, state.qz)
    assert (roll, pitch, yaw) == pytest.approx((HOVER.roll_rad, HOVER.pitch_rad, 0.0), abs=1e-12)
    assert (state.col, state.ped, state.a1, state.b1) == (HOVER.collective_rad, HOVER.pedal_rad, HOVER.a1, HOVER.b1)
    assert all(type(value) is float for value in state)


def test_near_the_ground_hover_takes_less_collective():
    assert trim(VEHICLE, height_m=0.6).collective_rad < HOVER.collective_rad - math.radians(0.2)


def test_a_flight_beyond_the_controls_is_refused():
    with pytest.raises(InputError, match="ask for a slower"):
        trim(VEHICLE, (0.0, 0.0, -60.0))


def test_collective_climbs():
    rate = rates(HOVER.state._replace(col=HOVER.collective_rad + 0.01), HOVER.controls)
    assert rate.w == pytest.approx(-1.8, abs=0.2)


def test_pedal_turns_the_nose_right_and_pushes_left():
    rate = rates(HOVER.state._replace(ped=HOVER.pedal_rad + 0.01), HOVER.controls)
    assert rate.r > 0.1
    assert rate.v < -0.05


@pytest.mark.parametrize(("control", "flap", "spin"), [("lat", "b1", "p"), ("lon", "a1", "q")])
def test_cyclic_tilts_the_disc_and_the_body_the_same_way(control, flap, spin):
    """lat > 0: disc right, roll right; lon > 0: disc back, nose up."""
    settled = HOVER.state._replace(**{control: getattr(HOVER, control) + 0.01})
    assert getattr(rates(settled, HOVER.controls), flap) == pytest.approx(0.01 * VEHICLE.flap_rate_1_s, rel=1e-6)
    tilted = HOVER.state._replace(**{flap: getattr(HOVER.state, flap) + 0.01})
    assert getattr(rates(tilted, HOVER.controls), spin) > 1.0


def test_a_tilted_disc_pulls_its_way():
    back = rates(HOVER.state._replace(a1=HOVER.a1 + 0.01), HOVER.controls)
    right = rates(HOVER.state._replace(b1=HOVER.b1 + 0.01), HOVER.controls)
    assert back.u < -0.05
    assert right.v > 0.05


def test_motion_is_resisted_and_the_disc_blows_back():
    for axis in ("u", "v", "w"):
        moved = rates(HOVER.state._replace(**{axis: 1.0}), HOVER.controls)
        assert getattr(moved, axis) < -0.02
    assert rates(HOVER.state._replace(u=1.0), HOVER.controls).a1 > 0.0
    assert rates(HOVER.state._replace(v=1.0), HOVER.controls).b1 < 0.0


def test_body_rates_are_resisted_by_the_lagging_disc():
    assert rates(HOVER.state._replace(p=0.1), HOVER.controls).b1 == pytest.approx(-0.1)
    assert rates(HOVER.state._replace(q=0.1), HOVER.controls).a1 == pytest.approx(-0.1)
    assert rates(HOVER.state._replace(r=0.1), HOVER.controls).r < 0.0


finite = st.floats(-1.0, 1.0)


@settings(max_examples=200, deadline=None)
@given(unit=st.lists(finite, min_size=26, max_size=26), wind=st.tuples(finite, finite, finite))
def test_no_state_or_wind_makes_it_not_a_number(unit, wind):
    scale = (5, 5, 3, 20, 20, 20, 1, 1, 1, 1, 6, 6, 6, 0.4, 0.4, 0.3, 0.3, 0.5, 0.6, 1, 1, 1, 6, 9, 300, 4e3)
    values = [x * s for x, s in zip(unit, scale, strict=True)]
    values[6:10] = quaternion_from_euler(3.0 * unit[6], 1.5 * unit[7], 3.0 * unit[8])
    around = in_wind(*(20.0 * x for x in wind))
    for rates_of in (helicopter.derivative, derivative):
        assert np.isfinite(rates_of(HelicopterState(*values), HOVER.controls, around, VEHICLE)).all()


def test_a_different_helicopter_loads_trims_and_obeys_momentum_theory(tmp_path):
    path = tmp_path / "x_cell.toml"
    path.write_text(X_CELL)
    vehicle = load_vehicle(path)
    hover = trim(vehicle)
    assert np.abs(accelerations(rates(hover.state, hover.controls, vehicle))).max() < 1e-9
    ideal = math.sqrt(hover.thrust_n / (2.0 * 1.225 * math.pi * 0.775**2))
    assert hover.induced_velocity_m_s == pytest.approx(ideal, rel=1e-6)
    assert hover.thrust_n > 8.2 * 9.80665 * math.cos(hover.roll_rad)
    assert hover.collective_rad != pytest.approx(HOVER.collective_rad, abs=1e-3)
    assert rates(hover.state._replace(col=hover.collective_rad + 0.01), hover.controls, vehicle).w < -1.0
