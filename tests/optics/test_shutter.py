"""Rolling shutter and motion blur: widths and shears are rate x time x focal length."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.lab.optics.projection import (
    FlightMotion,
    Pose,
    image_point,
    moved,
    part_time_s,
    pose_looking_down,
    row_time_s,
)
from flownav.sensors.geometry import image_rate_rad_s
from optical_oracles import CameraMotion, motion_field

STILL = FlightMotion(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def test_rows_are_read_about_the_frames_middle() -> None:
    times = np.array([row_time_s(row, 480, 0.016) for row in range(480)])
    assert times.mean() == pytest.approx(0.0, abs=1e-12)
    assert times[-1] - times[0] == pytest.approx(0.016 * 479 / 480)
    assert {row_time_s(row, 480, 0.0) for row in range(480)} == {0.0}
    parts = np.array([part_time_s(k, 4, 0.01) for k in range(4)])
    np.testing.assert_allclose(parts, [-3.75e-3, -1.25e-3, 1.25e-3, 3.75e-3])


def test_a_moved_pose_is_the_rotation_and_the_way() -> None:
    from scipy.spatial.transform import Rotation

    pose = pose_looking_down(0.3, -0.2, 1.4, roll_rad=0.1, pitch_rad=-0.05, yaw_rad=0.7)
    motion = FlightMotion(0.4, -0.3, 0.2, 0.5, -0.3, 0.8)
    after = moved(pose, motion, 0.01)
    exact = np.array(pose[3:]).reshape(3, 3) @ Rotation.from_rotvec(0.01 * np.array(motion[3:])).as_matrix()
    np.testing.assert_allclose(np.array(after[3:]).reshape(3, 3), exact, atol=6e-5)
    assert after[:3] == pytest.approx((0.304, -0.203, 1.398))
    assert moved(pose, STILL, 1.0) == pose


@pytest.mark.parametrize("turn", range(4))
def test_the_image_rate_is_that_of_the_ground_below(turn: int) -> None:
    """Against the motion field, for each of two velocities and two rates alone."""
    u, v, p, q = np.eye(4)[turn]
    x, y = motion_field(CameraMotion(u, v, 0.0, p, q, 0.0), 2.0, 0.0, 0.0, 1.0)
    assert image_rate_rad_s(u, v, p, q, 2.0) == pytest.approx((x, y))


def test_a_point_moves_in_the_image_by_rate_times_time() -> None:
    pose: Pose = pose_looking_down(height_m=2.0)
    motion = STILL._replace(velocity_x_m_s=0.6, rate_y_rad_s=-0.1)
    before, after = (
        image_point(moved(pose, motion, -0.005), 0.0, 0.0, 312.0),
        image_point(moved(pose, motion, 0.005), 0.0, 0.0, 312.0),
    )
    rate = image_rate_rad_s(0.6, 0.0, 0.0, -0.1, 2.0)[0]
    assert after[0] - before[0] == pytest.approx(312.0 * rate * 0.01, rel=1e-3)
