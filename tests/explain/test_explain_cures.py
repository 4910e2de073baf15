"""Cures: parameters of both autopilots, computed from what was set and found; they hold in another flight."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import explain as table  # tools/explain.py
from flownav.core.measurement import Sensor
from flownav.logs.log import Log
from flownav.studies.explain import flow_cures, height_cures
from flownav.studies.explain.case import Case
from flownav.studies.explain.cure import Cure
from flownav.studies.explain.judge import explain
from flownav.studies.explain.sign import Sign
from planted.planted import logged
from planted_logs import fault, log_of


def case_with(**parameters: float) -> Case:
    return Case(Log(Path("log"), {}, parameters=dict(parameters)))


def values(cure: Cure) -> dict[str, str]:
    return {setting.name: setting.text for setting in cure.settings}


def turned(deg: float) -> Sign:
    return Sign(3.0, (0.0, 1.0), {"turn_deg": deg, "mirrored": "", "axes": ""})


def read(x: float, y: float) -> Sign:
    return Sign(2.0, (0.0, 1.0), {"gain": (x * y) ** 0.5, "x": x, "y": y, "read": f"{x}, {y}"})


@pytest.mark.parametrize(
    ("was", "turn", "rotation"), [(0, -90.0, "2"), (2, -90.0, "4"), (0, 181.0, "4"), (6, -88.0, "0"), (1, 46.0, "0")]
)
def test_px4s_rotation_is_counted_from_what_is_set(was, turn, rotation):
    case = case_with(SENS_FLOW_ROT=was, EKF2_OF_CTRL=1)
    assert values(flow_cures.axes(case, turned(turn), "px4")) == {"SENS_FLOW_ROT": rotation}


@pytest.mark.parametrize(
    ("was", "turn", "yaw"), [(0, -90.0, "9000"), (9000, 92.0, "0"), (0, 30.0, "-3000"), (-9000, -90.0, "0")]
)
def test_ardupilots_yaw_takes_any_angle(was, turn, yaw):
    case = case_with(FLOW_ORIENT_YAW=was, EK3_ENABLE=1)
    assert values(flow_cures.axes(case, turned(turn), "ardupilot")) == {"FLOW_ORIENT_YAW": yaw}


def test_an_angle_that_px4_cannot_take_makes_no_parameter():
    cure = flow_cures.axes(case_with(EKF2_OF_CTRL=1), turned(24.0), "px4")
    assert cure.settings == ()
    assert not cure.holds


def test_no_rotation_cures_a_mirrored_sensor():
    sign = Sign(3.0, (0.0, 1.0), {"turn_deg": 0.0, "mirrored": "mirrored", "axes": ""})
    cure = flow_cures.axes(case_with(EKF2_OF_CTRL=1), sign, "px4")
    assert cure.settings == ()
    assert "mirrored" in cure.by_hand


def test_scale_multiplies_what_is_set_and_stays_within_what_can_be():
    sign = read(0.8, 0.8)
    assert values(flow_cures.scale(case_with(SENS_FLOW_SCALE=1.1, EKF2_OF_CTRL=1), sign, "px4")) == {
        "SENS_FLOW_SCALE": "1.375"
    }
    assert values(flow_cures.scale(case_with(FLOW_FXSCALER=0, FLOW_FYSCALER=-200), sign, "ardupilot")) == {
        "FLOW_FXSCALER": "250",
        "FLOW_FYSCALER": "0",
    }
    assert values(flow_cures.scale(case_with(EKF2_OF_CTRL=1), read(0.4, 0.4), "px4")) == {"SENS_FLOW_SCALE": "1.5"}


def test_axes_that_differ_are_scaled_apart_where_the_autopilot_can():
    sign = read(0.8, 1.25)
    assert values(flow_cures.scale(case_with(FLOW_FXSCALER=-200), sign, "ardupilot")) == {
        "FLOW_FXSCALER": "0",
        "FLOW_FYSCALER": "-200",
    }
    px4 = flow_cures.scale(case_with(EKF2_OF_CTRL=1), sign, "px4")
    assert px4.settings == ()
    assert not px4.holds
    assert "one factor for both axes" in px4.by_hand


def test_the_delay_leaves_ekf3_its_own_50_ms():
    sign = Sign(2.0, (0.0, 1.0), {"lag_ms": 130.0})
    assert values(flow_cures.delay(case_with(), sign, "ardupilot")) == {"EK3_FLOW_DELAY": "80"}
    assert values(flow_cures.delay(case_with(), sign, "px4")) == {"EKF2_OF_DELAY": "130"}


def test_a_deadlock_is_undone_by_the_barometer():
    assert values(height_cures.deadlock(case_with(), turned(0.0), "px4")) == {"EKF2_HGT_REF": "0", "EKF2_RNG_CTRL": "1"}


def test_the_file_is_one_that_ground_stations_load(tmp_path):
    px4 = explain(log_of(fault("forum", "sensor mounted a quarter turn round"), tmp_path))
    lines = px4.cure_text().splitlines()
    assert lines[0] == "# flownav explain, for px4"
    assert "1\t1\tSENS_FLOW_ROT\t2\t6" in lines
    assert all(line.startswith("#") or len(line.split("\t")) == 5 for line in lines)
    ardupilot = explain(log_of(fault("forum", "altitude noise of 100 m"), tmp_path))
    lines = ardupilot.cure_text().splitlines()
    assert "EK3_ALT_M_NSE,2" in lines
    assert all(line.startswith("#") or len(line.split(",")) == 2 for line in lines)


@pytest.mark.parametrize(
    ("which", "name"),
    [
        ("forum", "sensor mounted a quarter turn round"),
        ("forum", "sensor mounted backwards, indoors"),
        ("forum", "compass turned a quarter"),
        ("own", "flow off in EKF2 when GPS ended"),
        ("own", "flow limit of height below the flight"),
    ],
)
def test_a_cure_holds_in_another_flight_of_the_same_vehicle(tmp_path, which, name):
    planted = fault(which, name)
    flown = table.flown(planted, explain(log_of(planted, tmp_path)))
    assert flown is not None
    assert flown.harmed, flown
    assert flown.holds, flown
    assert flown.before[0] > 2.0 * flown.after[0] or flown.before[1] > 2.0 * flown.after[1]


def test_the_stand_in_believes_its_parameters(tmp_path):
    planted = fault("forum", "sensor mounted a quarter turn round")
    wrong, right = (table.error_of(logged(planted, told)) for told in ({}, {"SENS_FLOW_ROT": 2.0}))
    assert wrong[0] > 2.0 * right[0]
    sound = table.error_of(logged(replace(planted, readings=())))
    assert right[0] == pytest.approx(sound[0], abs=0.02)
    assert Sensor.FLOW_RATE in logged(planted).streams
