"""When the flow sensor sees and follows the landing pattern."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from flownav.core.frames import quaternion_from_euler, rotation_from_quaternion
from flownav.sensors.datasheet import load_sensor
from flownav.sensors.flow import engage_flow, engagement, pattern_reach, start_flow
from flownav.sensors.geometry import LensPose
from flownav.sensors.settings import FlowSettings

SENSOR = load_sensor()
P = FlowSettings().parameters(SENSOR)
LIMITS = SENSOR.limits
T = SENSOR.optics.half_fov_tangent
LEVEL = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)

position, height = st.floats(-1.0, 1.0), st.floats(0.1, 3.4)
tilt, heading = st.floats(-0.4, 0.4), st.floats(-math.pi, math.pi)


def attitude(roll: float, pitch: float, yaw: float) -> tuple[float, ...]:
    return rotation_from_quaternion(*quaternion_from_euler(roll, pitch, yaw))


def test_the_image_is_5_5_degrees_wide_and_covers_29_cm_at_3_m() -> None:
    assert math.degrees(2.0 * math.atan(T)) == pytest.approx(5.5, abs=0.02)
    assert 2.0 * pattern_reach(LensPose(0.0, 0.0, 3.0, LEVEL), T) == pytest.approx(0.288, abs=1e-3)


def test_a_one_metre_pad_leaves_the_image_after_36_cm_of_drift_at_3_m() -> None:
    assert pattern_reach(LensPose(0.355, 0.0, 3.0, LEVEL), T) < 0.5 < pattern_reach(LensPose(0.357, 0.0, 3.0, LEVEL), T)
    assert pattern_reach(LensPose(0.0, -0.357, 3.0, LEVEL), T) > 0.5


def test_an_image_turned_by_45_degrees_needs_a_larger_pad() -> None:
    straight = pattern_reach(LensPose(0.0, 0.0, 3.0, LEVEL), T)
    assert pattern_reach(LensPose(0.0, 0.0, 3.0, attitude(0.0, 0.0, math.pi / 4.0)), T) == pytest.approx(
        math.sqrt(2.0) * straight
    )
    assert pattern_reach(LensPose(0.0, 0.0, 3.0, attitude(0.0, 0.0, math.pi / 2.0)), T) == pytest.approx(straight)


def test_tilt_moves_the_view_to_the_side_of_the_lowered_lens() -> None:
    nose_up = attitude(0.0, 0.1, 0.0)  # the boresight swings forward, north
    centre_m = 3.0 * math.tan(0.1)
    assert pattern_reach(LensPose(0.0, 0.0, 3.0, nose_up), T) > centre_m
    assert pattern_reach(LensPose(-centre_m, 0.0, 3.0, nose_up), T) < 0.15


@given(n=position, e=position, h=height, roll=tilt, pitch=tilt, yaw=heading)
def test_reach_is_the_farthest_image_corner_on_the_ground(
    n: float, e: float, h: float, roll: float, pitch: float, yaw: float
) -> None:
    corners = np.array([[a * T, b * T, 1.0] for a in (-1, 1) for b in (-1, 1)])
    rays = Rotation.from_euler("ZYX", [yaw, pitch, roll]).apply(corners)
    ground = np.array([n, e]) + h * rays[:, :2] / rays[:, 2:]
    assert pattern_reach(LensPose(n, e, h, attitude(roll, pitch, yaw)), T) == pytest.approx(
        np.abs(ground).max(), rel=1e-12
    )


@given(n=position, e=position, h=height, roll=tilt, pitch=tilt, yaw=heading, a=st.floats(-1, 1), b=st.floats(-1, 1))
def test_no_point_of_the_image_lies_beyond_the_reach(
    n: float, e: float, h: float, roll: float, pitch: float, yaw: float, a: float, b: float
) -> None:
    ray = Rotation.from_euler("ZYX", [yaw, pitch, roll]).apply([a * T, b * T, 1.0])
    point = np.array([n, e]) + h * ray[:2] / ray[2]
    assert np.abs(point).max() <= pattern_reach(LensPose(n, e, h, attitude(roll, pitch, yaw)), T) + 1e-12


def judge(before: float, **changes: float) -> float:
    """Engagement of a sensor well inside every limit but for the changes."""
    at = {"height": 1.0, "cosine": 1.0, "reach": 0.2, "half": 0.5, "flow_x": 0.0, "flow_y": 0.0} | changes
    return engagement(before, at["height"], at["cosine"], at["reach"], at["half"], at["flow_x"], at["flow_y"], P)


def test_inside_every_limit_the_sensor_engages() -> None:
    assert judge(0.0) == judge(1.0) == 1.0


@pytest.mark.parametrize(
    ("quantity", "limit"),
    [
        ("height", LIMITS.max_height_m),
        ("flow_x", LIMITS.max_flow_rad_s),
        ("flow_x", -LIMITS.max_flow_rad_s),
        ("flow_y", -LIMITS.max_flow_rad_s),
        ("reach", 0.5),
    ],
)
def test_at_an_upper_limit_it_stays_but_does_not_engage_and_beyond_it_lets_go(quantity: str, limit: float) -> None:
    assert judge(1.0, **{quantity: 0.99 * limit}) == 1.0
    assert judge(0.0, **{quantity: 0.99 * limit}) == 0.0  # within the hysteresis
    assert judge(0.0, **{quantity: 0.94 * limit}) == 1.0
    assert judge(1.0, **{quantity: 1.01 * limit}) == 0.0


def test_the_same_holds_near_the_ground_and_for_tilt() -> None:
    low, steep = LIMITS.min_height_m, LIMITS.max_tilt_deg
    assert [judge(1.0, height=x * low) for x in (0.99, 1.01)] == [0.0, 1.0]
    assert [judge(0.0, height=x * low) for x in (1.01, 1.06)] == [0.0, 1.0]
    assert [judge(1.0, cosine=math.cos(math.radians(x * steep))) for x in (0.99, 1.01)] == [1.0, 0.0]
    assert [judge(0.0, cosine=math.cos(math.radians(x * steep))) for x in (0.94, 0.99)] == [1.0, 0.0]


@given(
    before=st.sampled_from([0.0, 1.0]), h=st.floats(-0.5, 5.0), r=st.floats(0.0, 2.0),
    half=st.floats(0.0, 2.0), more=st.floats(0.0, 1.0), flow=st.floats(-3.0, 3.0),
)  # fmt: skip
def test_a_larger_pad_and_having_been_engaged_never_hurt(
    before: float, h: float, r: float, half: float, more: float, flow: float
) -> None:
    now = engagement(before, h, 1.0, r, half, flow, 0.0, P)
    assert now in (0.0, 1.0)
    assert engagement(before, h, 1.0, r, half + more, flow, 0.0, P) >= now
    assert engagement(1.0, h, 1.0, r, half, flow, 0.0, P) >= now


def test_a_descent_engages_once_and_keeps_the_lag_untouched() -> None:
    state = start_flow(0.1, 0.2, 0.3, 9.81, P)
    history = []
    for lens_height_m in np.arange(6.0, 0.2, -0.01):
        after = engage_flow(state, LensPose(0.1, 0.0, float(lens_height_m), LEVEL), 0.0, 0.0, 0.5, P)
        assert after[:-1] == state[:-1]
        history.append(after.engaged)
        state = after
    changes = np.flatnonzero(np.diff(history))
    assert len(changes) == 1
    assert 6.0 - 0.01 * (changes[0] + 1) == pytest.approx(0.95 * LIMITS.max_height_m, abs=0.011)


def test_a_not_a_number_never_engages() -> None:
    assert judge(1.0, height=math.nan) == 0.0
    assert judge(1.0, reach=math.nan) == 0.0
