"""Causes that identification measures: a wrong integration time, an offset, and a scale against a reference."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from flownav.core.measurement import Sensor
from flownav.logs.log import Log
from flownav.studies.explain import flow_cures, flow_signs, measured_signs
from flownav.studies.explain.case import Case
from flownav.studies.explain.judge import explain
from flownav.studies.explain.sign import Lack, Sign
from planted.planted import logged
from planted.spoil import spoilt
from planted_logs import fault, sound


@cache
def whole(which: str, name: str) -> Log:
    """The log of a fault with the flight's truth."""
    return logged(fault(which, name))


@cache
def yard() -> Log:
    return logged(sound("yard", "px4", 21))


def spoilt_yard(*readings: dict[str, object], truth: bool = True) -> Case:
    log = replace(yard(), streams=spoilt(yard(), [dict(one) for one in readings], 7))
    return Case(log if truth else replace(log, truth=None))


def sign_of(found: Sign | Lack) -> Sign:
    assert isinstance(found, Sign), found
    return found


@pytest.mark.parametrize("factor", [0.5, 0.67, 1.5, 2.0])
@pytest.mark.parametrize("truth", [True, False], ids=["with a reference", "with GPS alone"])
def test_flow_and_its_gyro_off_by_one_factor_are_divided_by_a_wrong_time(factor, truth):
    case = spoilt_yard({"does": "flow_over_time", "factor": factor}, truth=truth)
    found = sign_of(measured_signs.interval(case))
    assert found.strength > 1.0
    assert found.figures["slope"] == pytest.approx(1.0 / factor, rel=0.03)
    assert found.figures["factor"] == pytest.approx(max(factor, 1.0 / factor), rel=0.03)
    assert found.figures["stated"] == ("long" if factor > 1.0 else "short")
    first = explain(case.log).first
    assert first is not None
    assert first.name == "flow_interval"


@pytest.mark.parametrize(
    "readings",
    [
        {"does": "flow_gyro", "x": 0.5, "y": 0.5},  # the flow itself reads as it should
        {"does": "flow_scaled", "x": 0.5, "y": 0.5},  # the gyro turns as it should
        {"does": "flow_over_time", "factor": 1.1},  # within what counts as alike
    ],
)
def test_a_gyro_or_a_scale_that_is_off_alone_is_no_wrong_time(readings):
    assert sign_of(measured_signs.interval(spoilt_yard(readings))).strength == 0.0


def test_a_sensor_without_a_gyro_lacks_what_shows_a_wrong_time():
    flow = yard().streams[Sensor.FLOW_RATE]
    value = flow.value.copy()
    value[:, 2:4] = np.nan
    log = replace(yard(), streams={**yard().streams, Sensor.FLOW_RATE: replace(flow, value=value)})
    assert isinstance(measured_signs.interval(Case(log)), Lack)


@pytest.mark.parametrize(("x", "y"), [(0.06, 0.0), (0.0, -0.06), (0.05, 0.05)])
def test_an_offset_is_found_about_the_axis_that_has_it(x, y):
    case = spoilt_yard({"does": "flow_offset", "x": x, "y": y})
    found = sign_of(measured_signs.offset(case))
    assert found.strength > 1.0
    assert (found.figures["x"], found.figures["y"]) == (pytest.approx(x, abs=0.005), pytest.approx(y, abs=0.005))
    assert [one.name for one in explain(case.log).findings] == ["flow_offset"]
    clean = sign_of(measured_signs.offset(spoilt_yard()))
    assert clean.strength < 0.3


def test_without_a_reference_and_gps_nothing_shows_an_offset():
    streams = {k: v for k, v in yard().streams.items() if k not in (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY)}
    assert isinstance(measured_signs.offset(Case(replace(yard(), streams=streams, truth=None))), Lack)


def test_a_scale_against_a_reference_is_each_axis_own():
    found = sign_of(flow_signs.scale(Case(whole("unseen", "one axis scaled by a typing error"))))
    assert found.figures["x"] == pytest.approx(0.7, abs=0.06)
    assert found.figures["y"] == pytest.approx(1.0, abs=0.06)
    swapped = sign_of(flow_signs.scale(spoilt_yard({"does": "flow_scaled", "x": 1.0, "y": 0.7})))
    assert swapped.figures["x"] == pytest.approx(1.0, abs=0.06)
    assert swapped.figures["y"] == pytest.approx(0.7, abs=0.06)


def test_a_lying_accelerometer_does_not_move_a_scale_that_a_reference_shows():
    """By the inertial readings alone ten real flights had 0.67 to 0.70 where motion capture had 0.83 to 0.92."""
    case = spoilt_yard({"does": "accel_shaken", "noise_m_s2": 6.0, "clip_m_s2": 30.0, "shift_m_s2": [2.0, -1.5, 0.0]})
    assert sign_of(flow_signs.scale(case)).figures["gain"] == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("stretched", [0.6, 1.6])
def test_a_reference_whose_scale_is_wrong_makes_no_wrong_flow_beside_gps_and_imu(stretched):
    """A map of visual odometry without a scale, or a survey in feet: one witness alone names nothing."""
    truth = {name: np.asarray(column) * (stretched if name.startswith(("pos_", "vel_")) else 1.0)
             for name, column in yard().truth.items()}  # fmt: skip
    found = sign_of(flow_signs.scale(Case(replace(yard(), truth=truth))))
    assert found.strength < 0.5
    assert found.figures["gain"] == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize(
    ("reference", "inertial", "ratio"),
    [
        ((0.7, 0.02), (0.72, 0.02), 0.70),  # both see it
        ((0.7, 0.02), None, 0.70),
        ((0.31, 0.30), (0.87, 0.05), 1.0),  # a reference that is turned against the vehicle
        ((0.98, 0.02), (0.6, 0.05), 1.0),  # an accelerometer that lies
        (None, (0.6, 0.02), 0.60),
        (None, (0.9, 0.02), 1.0),
        (None, None, 1.0),
    ],
)
def test_axes_read_apart_by_what_each_witness_knows(monkeypatch, reference, inertial, ratio):
    monkeypatch.setattr(flow_signs, "_ratio_by_reference", lambda _: reference)
    monkeypatch.setattr(flow_signs, "_ratio_by_inertial", lambda _: inertial)
    assert flow_signs._uneven(spoilt_yard()) == pytest.approx(ratio, abs=0.02)


def test_inav_has_one_factor_that_grows_with_the_gain():
    sign = Sign(2.0, (0.0, 1.0), {"gain": 0.8, "x": 0.8, "y": 0.8, "read": "0.80 of what it should"})
    (factor,) = flow_cures.scale(Case(Log(yard().path, {}, parameters={"opflow_scale": 12.0})), sign, "inav").settings
    assert (factor.name, factor.text) == ("opflow_scale", "9.6")
    assert "where yours is another" not in factor.reason
    (unknown,) = flow_cures.scale(Case(Log(yard().path, {})), sign, "inav").settings
    assert unknown.text == "8.4"  # of INAV's own 10.5
    assert "where yours is another" in unknown.reason
    uneven = sign._replace(figures={**sign.figures, "x": 0.7, "y": 0.9})
    assert flow_cures.scale(Case(Log(yard().path, {})), uneven, "inav").settings == ()
    assert explain(Log(yard().path, {}, parameters={"opflow_scale": 12.0})).dialect == "inav"


def test_a_factor_that_is_cut_to_its_range_says_so():
    sign = Sign(2.0, (0.0, 1.0), {"gain": 0.4, "x": 0.4, "y": 0.4, "read": "0.40 of what it should"})
    case = Case(Log(yard().path, {}))
    for dialect, text, needed in (("px4", "1.5", 2.5), ("ardupilot", "800", 1500.0)):
        for one in flow_cures.scale(case, sign, dialect).settings:
            assert one.text == text
            assert one.needed == pytest.approx(needed)
            assert "cut to the parameter's range" in one.reason
