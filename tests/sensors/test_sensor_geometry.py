"""Levers, mountings that are off, the beam on the ground, and the first-order lag: against independent geometry."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.signal import lsim
from scipy.spatial.transform import Rotation as Turn

from flownav.core.frames import rotation_from_quaternion
from flownav.sensors.geometry import (
    LEVEL,
    Ground,
    beam_distance,
    ground_height,
    in_turned_axes,
    lever_velocity,
    turned_rotation,
)
from flownav.sensors.processes import lag_weights, lagged


def rows(turn: Turn) -> tuple[float, ...]:
    """R_EB row by row, as the equations take it."""
    return tuple(float(x) for x in turn.as_matrix().ravel())


def test_a_lever_moves_with_the_turning_body() -> None:
    turn = Turn.from_euler("ZYX", [0.4, -0.2, 0.3])
    rates, lever = np.array([0.3, -0.5, 0.7]), np.array([-0.3, 0.1, -0.2])
    expected = turn.apply(np.cross(rates, lever))
    np.testing.assert_allclose(lever_velocity(rows(turn), *rates, *lever), expected, atol=1e-15)


def test_small_turns_are_rotations_to_first_order() -> None:
    angles, body = np.array([0.01, -0.008, 0.006]), Turn.from_euler("ZYX", [1.0, 0.2, -0.3])
    sensor = Turn.from_rotvec(angles)  # sensor axes to body axes
    vector = np.array([1.0, -2.0, 0.5])
    np.testing.assert_allclose(in_turned_axes(*vector, *angles), sensor.inv().apply(vector), atol=3e-4)
    np.testing.assert_allclose(turned_rotation(rows(body), *angles), rows(body * sensor), atol=2e-4)


def test_the_rotation_of_the_frames_is_the_one_meant_here() -> None:
    turn = Turn.from_euler("ZYX", [0.4, -0.2, 0.3])
    x, y, z, w = turn.as_quat()
    np.testing.assert_allclose(rotation_from_quaternion(w, x, y, z), rows(turn), atol=1e-15)


def marched(lens: np.ndarray, down: np.ndarray, ground: Ground) -> float:
    """Where a ray first is below the ground, by small steps."""
    step = 2e-4
    distance = np.arange(0.0, 12.0, step)
    points = lens + distance[:, None] * down
    beyond = (points[:, 0] - ground.edge_n_m) * ground.direction_n + (
        points[:, 1] - ground.edge_e_m
    ) * ground.direction_e
    height = ground.slope_n * points[:, 0] + ground.slope_e * points[:, 1] + np.where(beyond > 0.0, ground.step_m, 0.0)
    return float(distance[np.argmax(-points[:, 2] <= height)])


def test_the_beam_meets_what_a_marched_ray_meets() -> None:
    draw, kinds = np.random.default_rng(2), set()
    for _ in range(300):
        turn = Turn.from_euler("ZYX", [draw.uniform(-3, 3), draw.uniform(-0.5, 0.5), draw.uniform(-0.5, 0.5)])
        lens = np.array([draw.uniform(-1, 1), draw.uniform(-1, 1), -draw.uniform(1.5, 4.0)])
        angle = draw.uniform(0, 2 * math.pi)
        slopes, edge = draw.uniform(-0.15, 0.15, 2), draw.uniform(-0.7, 0.7, 2)
        ground = Ground(*slopes, draw.uniform(-0.6, 0.6), *edge, math.cos(angle), math.sin(angle))
        down = turn.as_matrix()[:, 2]
        hit = beam_distance(lens[0], lens[1], -lens[2], rows(turn), ground)
        assert hit.distance_m == pytest.approx(marched(lens, down, ground), abs=5e-4)
        point = lens + hit.distance_m * down
        off = -point[2] - ground_height(point[0], point[1], ground)
        kinds.add("face" if abs(off) > 1e-3 else "plane")
        normal = np.array([ground.slope_n, ground.slope_e, 1.0])  # towards the ground, in north, east, down
        assert hit.incidence_cosine == pytest.approx(down @ normal / np.linalg.norm(normal), rel=1e-12)
    assert kinds == {"face", "plane"}


def test_over_level_ground_it_is_height_over_cosine() -> None:
    turn = Turn.from_euler("ZYX", [0.7, 0.3, -0.2])
    hit = beam_distance(5.0, -3.0, 2.0, rows(turn), LEVEL)
    assert hit.distance_m == pytest.approx(2.0 / rows(turn)[8])
    assert hit.incidence_cosine == pytest.approx(rows(turn)[8])


def test_a_lens_below_the_ground_and_a_grazing_beam_stay_finite() -> None:
    upright = rows(Turn.identity())
    assert beam_distance(0.0, 0.0, -0.1, upright, LEVEL).distance_m == 0.0
    on_its_side = rows(Turn.from_euler("X", 1.6))
    assert beam_distance(0.0, 0.0, 1.0, on_its_side, LEVEL).distance_m == pytest.approx(10.0)


def test_the_lag_is_that_of_a_straight_line_between_readings() -> None:
    tau_s, period_s = 0.3, 0.2
    weights = lag_weights(tau_s, period_s)
    assert sum(weights) == pytest.approx(1.0)
    draw = np.random.default_rng(3)
    times = period_s * np.arange(40)
    u = draw.standard_normal(40)
    _, expected, _ = lsim(([1.0], [tau_s, 1.0]), u, times, X0=[0.0])
    output = 0.0
    for k in range(1, 40):
        output = lagged(output, u[k - 1], u[k], *weights)
        assert output == pytest.approx(expected[k], abs=1e-12)


def test_a_ramp_is_late_by_the_time_constant() -> None:
    weights, output = lag_weights(0.1, 0.2), -0.1
    for k in range(1, 60):
        output = lagged(output, 0.2 * (k - 1), 0.2 * k, *weights)
    assert output == pytest.approx(0.2 * 59 - 0.1)


def test_without_a_time_constant_there_is_no_lag() -> None:
    assert lagged(5.0, 3.0, 2.0, *lag_weights(0.0, 0.1)) == 2.0


@pytest.mark.parametrize(("tau_s", "period_s"), [(-1.0, 0.1), (1.0, 0.0)])
def test_an_impossible_lag_is_refused(tau_s: float, period_s: float) -> None:
    with pytest.raises(ValueError, match="a time constant >= 0 and a period > 0 are needed"):
        lag_weights(tau_s, period_s)


def test_a_beam_on_a_rough_surface_has_its_height_where_it_meets_the_plane() -> None:
    rough = Ground(0.05, -0.02, 0.0, 0.0, 0.0, 1.0, 0.0, 0.01, 3.0, 0.7)
    smooth = rough._replace(rough_m=0.0)
    turn = Turn.from_euler("ZYX", [0.4, 0.1, -0.2])
    down = turn.as_matrix()[:, 2]
    heights = []
    for north in np.linspace(-1.0, 1.0, 40):
        flat, hit = (beam_distance(north, 0.3, 2.0, rows(turn), one).distance_m for one in (smooth, rough))
        at = np.array([north, 0.3, -2.0]) + flat * down
        risen = ground_height(at[0], at[1], rough) - ground_height(at[0], at[1], smooth)
        assert (flat - hit) * (down[2] + 0.05 * down[0] - 0.02 * down[1]) == pytest.approx(risen, abs=1e-12)
        heights.append(risen)
    assert 0.004 < np.std(heights) < 0.02
