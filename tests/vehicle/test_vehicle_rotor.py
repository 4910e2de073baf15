"""The rotor: inflow against Brent's method, thrust, torque, flapping, and the series that replace libm."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from flownav.vehicle import rotor as equations
from flownav.vehicle.kinds import load_vehicle

VEHICLE = load_vehicle()
MAIN = equations.main_rotor(VEHICLE, 1.0)
TAIL = equations.tail_rotor(VEHICLE, 1.0)
induced_velocity = equations.induced_velocity
thrust = equations.thrust
torque = equations.torque
blowback = equations.blowback
thrustless_inflow = equations.thrustless_inflow


def momentum_imbalance(induced, pitch, inplane, axial, rotor):
    """λ0 - C_T / (2·√(μ² + (λ0 - μ_z)²)), reference equations 2.1 and 2.2 in their own non-dimensional form."""
    tip = rotor.tip_speed_m_s
    a_sigma = 8.0 * rotor.inflow_speed_m_s / tip
    mu, mu_z, lam = inplane / tip, axial / tip, induced / tip
    c_t = a_sigma / 2.0 * (pitch * (1.0 / 3.0 + mu**2 / 2.0) + (mu_z - lam) / 2.0)
    return 2.0 * lam * math.hypot(mu, lam - mu_z) - c_t


def envelope(count, seed=1):
    rng = np.random.default_rng(seed)
    return zip(
        np.radians(rng.uniform(0.0, 12.0, count)),
        rng.uniform(0.0, 12.0, count),
        rng.uniform(-4.0, 1.5, count),
        strict=True,
    )


def inflow_error(pitch, inplane, axial):
    """The error of λ0 against Brent's method."""
    args = (pitch, inplane, axial, MAIN)
    upper = thrustless_inflow(pitch, inplane**2, axial, MAIN)
    exact = brentq(momentum_imbalance, min(upper, 0.0), max(upper, 0.0), args=args, xtol=1e-13, rtol=1e-14)
    return abs(induced_velocity(pitch, inplane**2, axial, MAIN) - exact) / MAIN.tip_speed_m_s


def test_inflow_agrees_with_brent_over_the_envelope():
    """12 m/s in plane, -4..1.5 m/s axial, collective from 0.2 degrees; and to zero where it climbs below 3 m/s."""
    errors = [
        inflow_error(pitch, inplane, axial)
        for pitch, inplane, axial in envelope(4000)
        if pitch > math.radians(0.2) or axial > -3.0
    ]
    assert len(errors) > 3900
    assert max(errors) < 1e-9


def test_inflow_agrees_with_brent_where_the_climb_drives_the_rotor():
    """No collective and 3 to 4 m/s of climb: the rotor brakes, and the balance is nearly degenerate."""
    rng = np.random.default_rng(5)
    pitch, inplane, axial = np.radians(rng.uniform(0, 0.2, 2000)), rng.uniform(0, 2, 2000), rng.uniform(-4, -3, 2000)
    assert max(inflow_error(*case) for case in zip(pitch, inplane, axial, strict=True)) < 1e-5


def test_inflow_balances_momentum_in_hover_and_climb_to_rounding():
    for pitch in np.radians([-4.0, -1.0, 0.0, 0.5, 4.2, 12.0]):
        for axial in (-4.0, -1.0, 0.0, 1.0):
            induced = induced_velocity(pitch, 0.0, axial, MAIN)
            balance = momentum_imbalance(induced, pitch, 0.0, axial, MAIN)
            assert abs(balance) < 1e-9, (pitch, axial)


def test_tail_rotor_inflow_balances_momentum_in_side_winds():
    for pitch in np.radians([-20.0, -5.0, 0.0, 8.5, 25.0]):
        for inplane in (0.0, 1.0, 6.0, 12.0):
            for axial in (-8.0, -1.0, 0.0, 3.0):
                induced = induced_velocity(pitch, inplane**2, axial, TAIL)
                assert abs(momentum_imbalance(induced, pitch, inplane, axial, TAIL)) < 1e-7


def test_inflow_is_odd_in_thrust_and_flow():
    for pitch, inplane, axial in envelope(50):
        forward = induced_velocity(pitch, inplane**2, axial, MAIN)
        assert induced_velocity(-pitch, inplane**2, -axial, MAIN) == pytest.approx(-forward, abs=1e-12)


@given(pitch=st.floats(-0.45, 0.45), inplane=st.floats(0.0, 60.0), axial=st.floats(-40.0, 40.0), main=st.booleans())
def test_inflow_stays_finite_and_between_none_and_thrustless_everywhere(pitch, inplane, axial, main):
    rotor = MAIN if main else TAIL
    induced = induced_velocity(pitch, inplane**2, axial, rotor)
    thrustless = thrustless_inflow(pitch, inplane**2, axial, rotor)
    assert min(0.0, thrustless) <= induced <= max(0.0, thrustless)
    assert math.isfinite(thrust(pitch, inplane**2, axial, induced, rotor))


def test_inflow_passes_zero_thrust_without_a_jump():
    pitches = np.linspace(-1e-3, 1e-3, 201)
    for axial in (-1.0, 0.0, 0.5):
        inflows = np.array([induced_velocity(p, 0.25, axial, MAIN) for p in pitches])
        assert np.abs(np.diff(inflows)).max() < 0.02


def test_thrust_is_the_blade_element_integral():
    """ρ·b·c·a/2 ∫ (Ωr)²·(θ - inflow/(Ωr)) dr, averaged over a turn in forward flight, by quadrature."""
    pitch, inplane, axial, induced = 0.07, 8.0, -0.5, 3.0
    omega, radius = VEHICLE.main_speed_rad_s, VEHICLE.main_radius_m
    r = (np.arange(2000) + 0.5) / 2000 * radius
    psi = (np.arange(360) + 0.5) / 360 * 2 * np.pi
    tangential = omega * r[:, None] + inplane * np.sin(psi)[None, :]
    lift = 1.225 * 2 * 0.063 * 5.5 / 2 * (tangential**2 * pitch - tangential * (induced - axial))
    expected = lift.mean() * radius
    assert thrust(pitch, inplane**2, axial, induced, MAIN) == pytest.approx(expected, rel=1e-6)


def test_thrust_is_held_to_the_stall_limit():
    assert thrust(0.5, 0.0, 0.0, 0.0, MAIN) == MAIN.thrust_limit_n
    assert thrust(-0.5, 0.0, 0.0, 0.0, MAIN) == -MAIN.thrust_limit_n


def test_torque_is_induced_and_profile_power():
    induced, load = 3.5, 77.0
    power = load * induced + MAIN.profile_torque_n_m * MAIN.speed_rad_s
    assert torque(load, 0.0, 0.0, induced, MAIN) * MAIN.speed_rad_s == pytest.approx(power)
    climbing = torque(load, 0.0, -1.0, induced, MAIN) - torque(load, 0.0, 0.0, induced, MAIN)
    assert climbing * MAIN.speed_rad_s == pytest.approx(load * 1.0)


def test_profile_torque_grows_with_the_advance_ratio_as_gavrilets_mettler_and_feron_print_it():
    """C_Q = C_T·(λ0 - μ_z) + σ·C_D0/8·(1 + 7/3·μ²) (AIAA 2001-4003); without thrust its second part."""
    for share in (0.05, 0.1, 0.3):
        inplane = share * MAIN.tip_speed_m_s
        grown = torque(0.0, inplane**2, 0.7, 2.0, MAIN) / torque(0.0, 0.0, 0.7, 2.0, MAIN) - 1.0
        assert grown / share**2 == pytest.approx(7.0 / 3.0, rel=1e-9)


def test_blowback_is_the_references_derivative():
    """2·(4/3·θ0 - λ0) plus 16·μ·μ_z / ((1 - μ²/2)·(8μ + a·σ))."""
    tip, a_sigma = VEHICLE.main_tip_speed_m_s, VEHICLE.main_lift_solidity
    pitch, inplane, axial, induced = 0.073, 6.0, 0.8, 3.0
    mu, mu_z, lam = inplane / tip, axial / tip, induced / tip
    expected = 2 * (4 / 3 * pitch - lam) + 16 * mu * mu_z / ((1 - mu**2 / 2) * (8 * mu + a_sigma))
    assert blowback(pitch, inplane**2, axial, induced, a_sigma, tip) == pytest.approx(expected, rel=1e-9)


def test_series_replace_sine_and_cosine_of_flapping_angles():
    angles = np.linspace(-0.2, 0.2, 4001)
    sine, cosine = equations.sine_of_tilt, equations.cosine_of_tilt
    assert np.abs(sine(angles) - np.sin(angles)).max() < 3e-9
    assert np.abs(cosine(angles) - np.cos(angles)).max() < 1e-7
