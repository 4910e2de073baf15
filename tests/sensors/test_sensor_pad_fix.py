"""The pad fix as a vehicle's camera gives it: geometry of the lens over the pad, noise across the sight, limits."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flownav.core.frames import quaternion_from_euler, rotation_from_quaternion, to_earth
from flownav.sensors.pad_camera import PadFixNormals, PadFixParameters, PadFixReading, read_pad

CAMERA = PadFixParameters(1.0, 0.003, 0.02, 0.3, 3.0, math.tan(0.6), math.tan(0.6), 0.0)
SILENT = PadFixNormals(0.0, 0.0, 0.0, 0.0)
LEVEL = rotation_from_quaternion(1.0, 0.0, 0.0, 0.0)


def sight_of(reading: PadFixReading) -> np.ndarray:
    """The unit vector from the lens to the pad, in the body."""
    sight = np.array([reading.tan_forward, reading.tan_right, 1.0])
    return sight / np.linalg.norm(sight)


def test_a_pad_ahead_and_to_the_left_of_a_level_lens() -> None:
    reading = read_pad(-0.4, 0.6, -2.0, LEVEL, SILENT, CAMERA)
    assert reading == pytest.approx((0.2, -0.3, math.sqrt(0.4**2 + 0.6**2 + 2.0**2), 1.0))


@given(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(0.5, 2.9), st.floats(-0.2, 0.2), st.floats(-0.2, 0.2),
       st.floats(-3.0, 3.0))  # fmt: skip
def test_sight_and_distance_lead_back_to_the_pad(
    north: float, east: float, height: float, roll: float, pitch: float, yaw: float
) -> None:
    rotation = rotation_from_quaternion(*quaternion_from_euler(roll, pitch, yaw))
    reading = read_pad(north, east, -height, rotation, SILENT, CAMERA)
    to_pad = to_earth(rotation, *(reading.distance_m * sight_of(reading)))
    np.testing.assert_allclose(to_pad, (-north, -east, height), atol=1e-12)


@pytest.mark.parametrize(("north", "east"), [(0.0, 0.0), (-0.8, 0.0), (0.5, -0.9)])
def test_the_noise_turns_the_sight_by_the_same_angle_both_ways_and_never_along_it(north: float, east: float) -> None:
    tiny = CAMERA._replace(angle_sigma_rad=1e-7)
    straight = sight_of(read_pad(north, east, -2.0, LEVEL, SILENT, tiny))
    turns = [
        (sight_of(read_pad(north, east, -2.0, LEVEL, SILENT._replace(**{name: 1.0}), tiny)) - straight) / 1e-7
        for name in ("forward", "right")
    ]
    one, two = turns
    assert np.linalg.norm(one) == pytest.approx(1.0, abs=1e-6)
    assert np.linalg.norm(two) == pytest.approx(1.0, abs=1e-6)
    assert one @ two == pytest.approx(0.0, abs=1e-6)
    assert one @ straight == pytest.approx(0.0, abs=1e-6)
    assert two @ straight == pytest.approx(0.0, abs=1e-6)


def test_the_distance_errs_by_a_share_of_itself() -> None:
    noisy = SILENT._replace(distance=1.0)
    for height in (0.5, 2.5):
        assert read_pad(0.0, 0.0, -height, LEVEL, noisy, CAMERA).distance_m == pytest.approx(1.02 * height)


@pytest.mark.parametrize(
    ("lens", "seen"),
    [
        ((0.0, 0.0, -0.31), 1.0),
        ((0.0, 0.0, -0.29), 0.0),
        ((0.0, 0.0, -2.99), 1.0),
        ((0.0, 0.0, -3.01), 0.0),
        ((1.36, 0.0, -2.0), 1.0),
        ((1.38, 0.0, -2.0), 0.0),
        ((0.0, -1.38, -2.0), 0.0),
    ],
)
def test_it_is_seen_between_two_heights_and_within_the_view(lens: tuple[float, float, float], seen: float) -> None:
    assert read_pad(*lens, LEVEL, SILENT, CAMERA).valid == seen
    assert read_pad(*lens, LEVEL, SILENT, CAMERA._replace(fitted=0.0)).valid == 0.0


@pytest.mark.parametrize(("turn", "reach"), [(0.0, 0.2), (math.pi / 4.0, 0.2 * math.sqrt(2.0)), (math.pi / 2.0, 0.2)])
def test_a_mark_must_be_whole_in_a_view_that_is_narrower_to_the_right(turn: float, reach: float) -> None:
    camera = CAMERA._replace(half_view_right_tangent=0.5, side_m=0.4)
    rotation = rotation_from_quaternion(*quaternion_from_euler(0.0, 0.0, turn))

    def seen(forward_m: float, right_m: float) -> float:
        north, east, _ = to_earth(rotation, forward_m, right_m, 0.0)
        return read_pad(-north, -east, -2.0, rotation, SILENT, camera).valid

    ahead = 2.0 * math.tan(0.6) - reach
    assert [seen(s * (ahead + d), 0.0) for s in (-1, 1) for d in (-0.01, 0.01)] == [1.0, 0.0, 1.0, 0.0]
    assert [seen(0.0, s * (1.0 - reach + d)) for s in (-1, 1) for d in (-0.01, 0.01)] == [1.0, 0.0, 1.0, 0.0]
