"""The ground below walks: with new ground that passes below, and with a sensor's lasting error as the height
changes.
"""

from __future__ import annotations

import math

import pytest

from flownav.estimation.named import VelocityNed
from flownav.estimation.states import GROUND, PAD
from flownav.navigation.ground import DRIFT_S, drifting, lasting_walk, terrain_walk, walk_below
from flownav.navigation.kernel_settings import NO_HEADING, Equipment
from flownav.navigation.motion_records import DriftMemory
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.verdicts import GroundBelow

TOLD = NavigatorSettingsFile(
    ground_walk_m_rt_s=0.05, range_scale_sigma=0.01, pad_boresight_sigma_rad=0.008, pad_scale_sigma=0.005
).settings(Equipment(True, False, NO_HEADING, False, -math.inf))
STEP_S = 0.01
LEVEL = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


@pytest.mark.parametrize(("north_m_s", "east_m_s", "share"), [
    (0.0, 0.0, 0.0), (0.3, -0.4, 0.5), (-0.6, 0.8, 1.0), (9.0, 0.0, 1.0),
])  # fmt: skip
def test_the_ground_walks_as_much_as_passes_below(north_m_s, east_m_s, share):
    assert terrain_walk(DriftMemory(north_m_s, east_m_s, 5.0), 0.05) == pytest.approx(share * 0.05**2)


def test_a_sway_about_one_place_passes_over_a_tenth_of_the_new_ground_that_a_steady_speed_does():
    """1 m/s at 0.3 Hz, and 1 m/s all the time."""
    swaying = steady = DriftMemory()
    walked = [0.0, 0.0]
    for k in range(6000):
        speed_m_s = math.sin(2.0 * math.pi * 0.3 * k * STEP_S)
        swaying = drifting(VelocityNed(speed_m_s, 0.0, 0.0), swaying, STEP_S)
        steady = drifting(VelocityNed(0.0, -1.0, 0.0), steady, STEP_S)
        walked[0] += terrain_walk(swaying, 1.0) * STEP_S
        walked[1] += terrain_walk(steady, 1.0) * STEP_S
    assert walked[1] == pytest.approx(60.0 - DRIFT_S, rel=0.01)
    assert walked[0] < 0.1 * walked[1]


@pytest.mark.parametrize("climb_m_s", [0.5, -0.5])
def test_what_lasts_of_an_error_sums_up_to_its_share_of_the_height_from_the_ground_up_and_down_to_it(climb_m_s):
    drift, height_m, variance = DriftMemory(0.0, 0.0, -climb_m_s), 0.0 if climb_m_s > 0.0 else 3.0, 0.0
    for _ in range(round(6.0 / STEP_S)):
        variance += lasting_walk(height_m + 0.5 * climb_m_s * STEP_S, drift, 0.01) * STEP_S
        height_m += climb_m_s * STEP_S
    assert variance == pytest.approx((0.01 * 3.0) ** 2)


def test_below_the_ground_nothing_lasts():
    assert lasting_walk(-1.0, DriftMemory(0.0, 0.0, 1.0), 0.01) == 0.0


def test_ground_and_pad_walk_with_a_descent_each_by_what_lasts_in_its_sensor():
    after = walk_below.law(
        DriftMemory(0.0, 0.0, 0.5), VelocityNed(0.0, 0.0, 0.5), GroundBelow(2.0, 0.0, LEVEL), dt_s=0.1,
        height=TOLD.height, place=TOLD.place,
    )  # fmt: skip
    assert after.drift == DriftMemory(0.0, 0.0, 0.5)
    share = 2.0 * 2.0 * 0.5 * 0.1
    assert [(doubt.state, doubt.variance) for doubt in after.walked] == [
        (GROUND, pytest.approx(share * 0.01**2)), (PAD, pytest.approx(share * 0.008**2)),
        (PAD + 1, pytest.approx(share * 0.008**2)), (PAD + 2, pytest.approx(share * 0.005**2)),
    ]  # fmt: skip
