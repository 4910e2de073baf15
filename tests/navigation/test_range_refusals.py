"""The consequence of a range that is refused, as a function of plain records: the accelerometer doubted, or nothing."""

from __future__ import annotations

import math

import pytest

from flownav.estimation.states import ACCEL_BIAS, GROUND, POSITION, VELOCITY
from flownav.navigation import verdicts
from flownav.navigation.height import judge_refusal
from flownav.navigation.kernel_settings import NO_HEADING, Equipment
from flownav.navigation.motion_records import ImuMemory
from flownav.navigation.reasons import FUSED, INNOVATION_GATE
from flownav.navigation.records import AidMemory, EchoMemory, GroundMemory, RangeMemory, RangingMemory, Reading
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.tape import IMU_DOUBTED

NAN = math.nan
HEIGHT = NavigatorSettingsFile().settings(Equipment(True, False, NO_HEADING, False, -math.inf)).height
RANGE = Reading(2.0, *[NAN] * 8, 255.0, 1.0, 0.0)


def refusal(
    crept_sigmas=2.0, sigmas=6.0, refused_s=NAN, last_fix_s=0.0, reason=INNOVATION_GATE, stray=0.0, doubted=0.0
):
    """The consequence of a range whose innovation is this number of standard deviations of 0.1 m, at 1 s."""
    return judge_refusal.law(
        verdicts.Tested(reason, 0.1 * sigmas, 0.01, 0.005), RANGE, verdicts.Height(-2.0, 0.1, 1.0),
        AidMemory(height_s=1.0 - last_fix_s),
        RangingMemory(
            RangeMemory(sigmas=crept_sigmas, refused_s=refused_s, doubted=doubted), EchoMemory(stray=stray),
            GroundMemory(known=1.0),
        ),
        ImuMemory(doubt_m_s2=0.0), t_s=1.0, s=HEIGHT,
    )  # fmt: skip


def freed(found) -> dict[int, float]:
    """Standard deviations that a refusal adds, of what state."""
    return {doubt.state: math.sqrt(doubt.variance) for doubt in found.doubts if doubt.variance > 0.0}


def test_a_range_that_crept_out_and_stays_out_frees_height_ground_climb_and_every_axis_of_the_accelerometer():
    assert freed(refusal()) == {}  # one reading may be noise
    found = refusal(refused_s=0.9)
    assert freed(found) == {
        POSITION + 2: pytest.approx(1.8), GROUND: pytest.approx(1.8), VELOCITY + 2: 1.0,
        ACCEL_BIAS: 2.0, ACCEL_BIAS + 1: 2.0, ACCEL_BIAS + 2: 2.0,
    }  # fmt: skip
    assert found.doubted == (IMU_DOUBTED, pytest.approx(0.6))
    assert found.imu.doubt_m_s2 == 2.0
    assert found.memory.range.doubted == 1.0


def test_a_range_that_jumped_and_alone_tells_the_height_frees_the_vertical_alone():
    """The ground stays: it may be an echo."""
    found = refusal(crept_sigmas=0.5, refused_s=0.9, last_fix_s=99.0)
    assert set(freed(found)) == {POSITION + 2, VELOCITY + 2, ACCEL_BIAS + 2}
    assert freed(refusal(crept_sigmas=0.5, refused_s=0.97, last_fix_s=99.0)) == {}  # too soon


@pytest.mark.parametrize("what", [
    {"crept_sigmas": 0.5}, {"crept_sigmas": -2.0}, {"sigmas": 11.0}, {"stray": 0.03}, {"doubted": 1.0},
    {"reason": FUSED},
])  # fmt: skip
def test_a_range_that_jumped_out_or_strays_or_was_heard_before_makes_nothing_doubted(what):
    assert freed(refusal(refused_s=0.9, **what)) == {}
