"""The magnetometer: the place's field, hard and soft iron, current, noise, its datasheet."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation as Turn

from flownav.core.errors import InputError
from flownav.core.parameter_files import check
from flownav.sensors.magnetometer import (
    MagneticField,
    MagnetometerNormals,
    MagnetometerSheet,
    MagnetometerUnit,
    draw_magnetometer,
    read_magnetometer,
)
from sensor_normals import draws, moved_by, silent

SHEET = MagnetometerSheet.read()
FIELD = MagneticField(strength_gauss=0.5, declination_deg=10.0, inclination_deg=60.0)
P = SHEET.parameters(FIELD)
PERFECT, QUIET = silent(MagnetometerUnit), silent(MagnetometerNormals)


def rows(turn: Turn) -> tuple[float, ...]:
    return tuple(float(x) for x in turn.as_matrix().ravel())


def test_a_perfect_one_reads_the_field_in_body_axes() -> None:
    turn = Turn.from_euler("ZYX", [math.radians(70.0), 0.2, -0.3])
    reading = read_magnetometer(PERFECT, rows(turn), 500.0, QUIET, P)
    earth = turn.apply(reading[:3])
    assert np.linalg.norm(earth) == pytest.approx(0.5)
    assert math.degrees(math.atan2(earth[1], earth[0])) == pytest.approx(10.0)
    assert math.degrees(math.asin(earth[2] / 0.5)) == pytest.approx(60.0)
    assert reading[3:] == (255.0, 1.0)


def test_level_the_field_tells_the_heading() -> None:
    x, y, z, *_ = read_magnetometer(PERFECT, rows(Turn.from_euler("Z", math.radians(100.0))), 0.0, QUIET, P)
    assert math.degrees(math.atan2(-y, x)) + 10.0 == pytest.approx(100.0)
    assert z > 0.0  # northern hemisphere: downwards


def test_iron_and_current_bend_it() -> None:
    unit = MagnetometerUnit(*(0.01 * (i + 1) for i in range(9)), 0.02, -0.03, 0.04, 1e-5, -2e-5, 3e-5, 0.0)
    turn = Turn.from_euler("ZYX", [0.5, 0.2, -0.3])
    field = turn.inv().apply(FIELD.ned_gauss)
    soft = 0.01 * np.arange(1, 10).reshape(3, 3)
    expected = field + soft @ field + [0.02, -0.03, 0.04] + 1300.0 * np.array([1e-5, -2e-5, 3e-5])
    np.testing.assert_allclose(read_magnetometer(unit, rows(turn), 1300.0, QUIET, P)[:3], expected, rtol=1e-13)


def test_units_are_drawn_with_the_sheets_sizes() -> None:
    unit = draw_magnetometer(MagnetometerUnit(*(1.0,) * 16), P)
    expected = [0.015, 0.01, 0.01, 0.01, 0.015, 0.01, 0.01, 0.01, 0.015, *[0.008] * 3, *[1e-5] * 3, 0.0]
    np.testing.assert_allclose(unit, expected)
    for name, fields in moved_by(MagnetometerUnit, lambda n: draw_magnetometer(n, P)).items():
        assert fields == (set() if name == "spare" else {name})


def test_noise_is_white_and_each_axis_has_its_own() -> None:
    upright = rows(Turn.identity())
    readings = np.array(
        [read_magnetometer(PERFECT, upright, 0.0, n, P)[:3] for n in draws(MagnetometerNormals, 4000, 17)]
    )
    np.testing.assert_allclose(readings.std(axis=0), 0.004, rtol=4.0 / math.sqrt(8000))
    for name, fields in moved_by(MagnetometerNormals, lambda n: read_magnetometer(PERFECT, upright, 0.0, n, P)).items():
        assert fields == (set() if name == "spare" else {f"mag_{name}_gauss"})


def test_the_default_place_is_sharjah() -> None:
    north, east, down = MagneticField().ned_gauss
    assert math.hypot(north, east, down) == pytest.approx(0.4455)
    assert math.degrees(math.atan2(east, north)) == pytest.approx(2.2)
    assert math.degrees(math.atan2(down, math.hypot(north, east))) == pytest.approx(40.0)


def test_what_the_datasheets_refuse() -> None:
    with pytest.raises(InputError, match=r"^m: hard_iron_mgauss: Input should be greater than or equal to 0"):
        check(SHEET.model_dump() | {"hard_iron_mgauss": -1}, MagnetometerSheet, "m")
    with pytest.raises(InputError, match=r"^m: inclination_deg: Input should be less than or equal to 90"):
        check({"inclination_deg": 100.0}, MagneticField, "m")
