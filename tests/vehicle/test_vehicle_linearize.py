"""The reduced models: the published derivatives, exactness against differences, and what stays frozen."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.vehicle import airframe, helicopter
from flownav.vehicle.complex_step import jacobian, solve
from flownav.vehicle.kinds import load_vehicle
from flownav.vehicle.linearize import INPUTS, STATES, eigenvalues, load_paper_model, reduced_model
from flownav.vehicle.state import CALM, Controls, HelicopterState, in_wind
from flownav.vehicle.trim import trim

VEHICLE = load_vehicle()
HOVER = trim(VEHICLE)
FROZEN = reduced_model(VEHICLE, HOVER, freeze_inflow=True)
SOLVED = reduced_model(VEHICLE, HOVER, freeze_inflow=False)
PAPER = load_paper_model()
derivative = helicopter.derivative_in_balance


def entry(matrix, row, column):
    names = STATES if matrix.shape[1] == len(STATES) else INPUTS
    return matrix[STATES.index(row), names.index(column)]


@pytest.mark.parametrize(
    ("model", "z_w", "z_col", "z_col_tolerance"), [(FROZEN, -3.28, -294.0, 3.0), (SOLVED, -1.03, -185.0, 5.0)]
)
def test_heave_derivatives_are_the_papers_and_the_references(model, z_w, z_col, z_col_tolerance):
    assert entry(model.a, "w", "w") == pytest.approx(z_w, abs=0.05)
    assert entry(model.b, "w", "col") == pytest.approx(z_col, abs=z_col_tolerance)


def test_side_force_derivatives_with_frozen_inflow_are_the_papers():
    assert entry(FROZEN.b, "v", "col") == pytest.approx(1.566, abs=0.05)
    assert entry(FROZEN.b, "v", "ped") == pytest.approx(-17.3314, abs=0.3)
    assert entry(FROZEN.b, "u", "col") == pytest.approx(0.0374, abs=0.005)


def test_steady_climb_per_collective_doubles_when_the_inflow_follows():
    def climb(model):
        return entry(model.b, "w", "col") / entry(model.a, "w", "w")

    assert climb(FROZEN) == pytest.approx(89.7, rel=0.02)
    assert climb(SOLVED) == pytest.approx(179.0, rel=0.03)


def test_tilting_reaches_the_velocities_through_flapping_only():
    for model in (FROZEN, SOLVED):
        assert (model.b[:, :2] == 0.0).all()


def test_position_moves_with_the_rotated_velocity_and_drives_nothing():
    state = HOVER.state
    rotation = np.reshape(airframe.attitude(state), (3, 3))
    assert FROZEN.a[:3, 3:] == pytest.approx(rotation, abs=1e-12)
    assert np.abs(FROZEN.a[:, :3]).max() < 1e-12
    assert PAPER.a[:3, 3:] == pytest.approx(rotation, abs=5e-3)


def test_the_quasi_steady_model_is_the_slope_of_the_derivative():
    """Central differences on the full derivative, one state and one input at a time."""
    step = 1e-4
    for name, column in zip((*STATES[3:], *INPUTS), np.hstack([SOLVED.a[:, 3:], SOLVED.b]).T, strict=True):
        ends = []
        for sign in (1.0, -1.0):
            state, controls = HOVER.state, HOVER.controls
            if name in INPUTS:
                controls = controls._replace(**{name: getattr(controls, name) + sign * step})
            state = state._replace(**{name: getattr(state, name) + sign * step})
            rate = derivative(state, controls, CALM, VEHICLE)
            ends.append(np.array([rate.pos_n, rate.pos_e, rate.pos_d, rate.u, rate.v, rate.w]))
        assert column == pytest.approx((ends[0] - ends[1]) / (2 * step), abs=2e-3), name


def test_complex_step_agrees_with_central_differences_on_all_states():
    hover = trim(VEHICLE, (4.0, 1.0, 0.5), height_m=3.0)
    point = np.array(hover.state)

    def rates(values):
        return derivative(HelicopterState(*values), hover.controls, in_wind(0.5, -0.5, 0.1), VEHICLE)

    exact = jacobian(rates, point)
    for i in range(len(point)):
        step = np.zeros(len(point))
        step[i] = 1e-5
        slope = (np.array(rates(point + step)) - np.array(rates(point - step))) / 2e-5
        assert np.abs(exact[:, i] - slope).max() < 1e-5 * max(1.0, np.abs(slope).max())


def test_complex_step_also_holds_on_the_ground():
    start = HOVER.state._replace(pos_d=-VEHICLE.cg_above_skid_m + 0.005, u=0.02, v=0.01, w=0.05, p=0.1)

    def rates(values):
        return derivative(HelicopterState(*values), Controls(0.0, 0.0, 0.01, 0.1), CALM, VEHICLE)

    point = np.array(start)
    exact = jacobian(rates, point)
    step = np.zeros(len(point))
    step[2] = 1e-7
    slope = (np.array(rates(point + step)) - np.array(rates(point - step))) / 2e-7
    assert np.abs(slope).max() > 100.0
    assert exact[:, 2] == pytest.approx(slope, rel=1e-5, abs=1e-3)


def test_newton_finds_a_root_of_several_equations():
    root = solve(lambda x: (x[0] ** 2 + x[1] - 3.0, x[0] - x[1] + 1.0), np.array([3.0, 0.0]), 1e-12, "none")
    assert root == pytest.approx([1.0, 2.0])


def test_the_papers_model_has_its_published_eigenvalues():
    slowest = eigenvalues(PAPER.a)
    assert slowest[0] == pytest.approx(-3.1868, abs=5e-5)
    assert sorted(slowest[1:3].real) == pytest.approx([-0.0708, -0.0708], abs=5e-5)
    assert sorted(slowest[1:3].imag) == pytest.approx([-0.1163, 0.1163], abs=5e-5)
    assert np.abs(slowest[3:]).max() < 1e-12


def test_the_papers_matrices_are_the_printed_ones(paper_folder):
    """Every number of equations 20 and 21 stands in the paper's text, row by row."""
    text = (paper_folder / "paper.txt").read_text().replace("\u2212", "-")
    for row in PAPER.a:
        assert " ".join("0" if x == 0.0 else f"{x:.4f}" for x in row).split("0 0 0 ")[-1] in text
    for printed in ("0.0374", "1.5680", "-17.3314", "-294.6074", "0.2236", "0.0022"):
        assert printed in text
    assert PAPER.b[3:, 2:].tolist() == [[0.0374, 0.0], [1.5680, -17.3314], [-294.6074, 0.0]]


def test_the_papers_noise_is_diagonal_and_its_skew_part_a_rotation():
    assert np.diag(PAPER.r).tolist() == [0.2236] * 3 + [0.09] * 3
    assert (PAPER.q == 0.0022 * np.eye(6)).all()
    block = PAPER.a[3:, 3:]
    skew = 0.5 * (block - block.T)
    assert (skew[1, 2], skew[0, 2] * -1, skew[0, 1]) == pytest.approx((0.5464, -0.0693, 0.1253), abs=5e-5)
    assert np.linalg.matrix_rank(np.hstack([np.linalg.matrix_power(PAPER.a, k) @ PAPER.b for k in range(6)])) == 5
