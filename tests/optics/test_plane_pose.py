"""A plane figure's pose from four of its points, against poses that are known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from flownav.lab.optics.projection import homography, mapped, plane_pose

SQUARE = 0.2 * np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])


def seen(rotation: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Tangents under which a camera sees the square's corners."""
    x, y, z = (SQUARE @ rotation[:, :2].T + place).T
    return np.column_stack([x / z, y / z])


@pytest.mark.parametrize("angles", [(0.0, 0.0, 0.0), (0.3, -0.2, 1.0), (-0.5, 0.4, -2.0)])
@pytest.mark.parametrize("place", [(0.0, 0.0, 1.0), (0.3, -0.2, 2.0)])
def test_a_known_pose_is_found_and_leaves_nothing(angles, place):
    rotation = Rotation.from_euler("xyz", angles).as_matrix()
    found = plane_pose(SQUARE, seen(rotation, np.array(place)))
    assert found.rotation == pytest.approx(rotation, abs=1e-6)
    assert found.place_m == pytest.approx(place, abs=1e-6)
    assert found.rms < 1e-9


def test_rms_is_what_each_coordinate_is_off_by():
    """A square of corners pulled apart along one diagonal and together along the other is no square's image."""
    level = seen(np.eye(3), np.array([0.0, 0.0, 1.0]))
    pulled = level * np.array([1.05, 0.95, 1.05, 0.95])[:, None]
    found = plane_pose(SQUARE, pulled)
    left = pulled - seen(found.rotation, found.place_m)
    assert found.rms > 1e-3
    assert found.rms == pytest.approx(np.sqrt(np.mean(left**2)), rel=1e-6)


def best_of_many_starts(tangents: np.ndarray) -> float:
    """The least rms that any pose leaves: least squares from tilts to all sides."""

    def left(unknown: np.ndarray) -> np.ndarray:
        return (seen(Rotation.from_rotvec(unknown[:3]).as_matrix(), unknown[3:]) - tangents).ravel()

    start = [0.1, 0.0, 3.0]
    tilts = [(0.4 * np.cos(a), 0.4 * np.sin(a), 0.0) for a in np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)]
    return min(float(np.sqrt(np.mean(least_squares(left, [*tilt, *start]).fun ** 2))) for tilt in tilts)


def test_of_a_small_figures_two_poses_the_better_one_is_found():
    """Tilted either way about the line of sight it looks almost alike (Schweighofer and Pinz 2006)."""
    random = np.random.default_rng(16)  # in the seventh draw the nearer start leads to the worse of the two
    rotation = Rotation.from_euler("xyz", (0.5, 0.1, 0.0)).as_matrix()
    for _ in range(10):
        noisy = seen(rotation, np.array([0.1, 0.0, 3.0])) + 3e-3 * random.standard_normal((4, 2))
        assert plane_pose(SQUARE, noisy).rms <= best_of_many_starts(noisy) * (1.0 + 1e-6) + 1e-12


def test_a_projective_map_takes_four_points_to_four():
    image = np.array([[0.1, 0.2], [-0.3, 0.25], [-0.2, -0.4], [0.5, -0.1]])
    assert mapped(homography(SQUARE, image), SQUARE) == pytest.approx(image)
    assert homography(np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [0.0, 1.0]]), image) is None
