"""The rangefinder: beam, limits by slant range, noise, echoes, spells, a unit's errors, its datasheets."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation as Turn

from flownav.core.errors import InputError
from flownav.core.parameter_files import check, shipped
from flownav.sensors.geometry import LEVEL, BeamHit, beam_distance
from flownav.sensors.range_sensor import (
    RangeSensorNormals,
    RangeSensorParameters,
    RangeSensorReading,
    RangeSensorSheet,
    RangeSensorState,
    RangeSensorUnit,
    draw_range_sensor,
    start_range_sensor,
    step_range_sensor,
    wide_beam,
)
from sensor_normals import draws, moved_by, silent

SHEET = RangeSensorSheet.read()
EXACT = SHEET.parameters()._replace(resolution_m=0.0)
PERFECT = RangeSensorUnit(0.0, 0.0)
QUIET = silent(RangeSensorNormals)
WORKING = RangeSensorState(2.0, 255.0, 0.0, 0.0)


def down(distance_m: float, incidence_deg: float = 0.0) -> BeamHit:
    return BeamHit(distance_m, math.cos(math.radians(incidence_deg)))


def read(
    hit: BeamHit,
    n: RangeSensorNormals = QUIET,
    p: RangeSensorParameters = EXACT,
    unit: RangeSensorUnit = PERFECT,
    state: RangeSensorState = WORKING,
) -> RangeSensorReading:
    return step_range_sensor(state, unit, hit, n, p)[1]


def sheet_with(**changes: object) -> RangeSensorSheet:
    return check(SHEET.model_dump() | changes, RangeSensorSheet, "range.toml")


def test_over_ground_below_it_reads_the_distance() -> None:
    assert read(down(2.0)) == (2.0, 255.0, 1.0)


def nearest_in_cone(height: float, tilt: float, half_beam: float) -> float:
    """The shortest of many rays within the cone about a tilted boresight, to level ground."""
    about = Turn.from_euler("X", tilt)
    shortest = math.inf
    for off in np.linspace(0.0, half_beam, 61):
        for around in np.linspace(0.0, math.pi, 61):
            ray = [math.sin(off) * math.sin(around), -math.sin(off) * math.cos(around), math.cos(off)]
            below = float(about.apply(ray)[2])
            shortest = min(shortest, height / below if below > 0.0 else math.inf)
    return shortest


@pytest.mark.parametrize("tilt_deg", [0.0, 7.0, 14.9, 20.0, 30.0])
def test_a_wide_beam_reads_the_nearest_ground_in_its_cone(tilt_deg: float) -> None:
    slant = 2.0 / math.cos(math.radians(tilt_deg))
    expected = nearest_in_cone(2.0, math.radians(tilt_deg), math.radians(15.0))
    assert wide_beam(down(slant, tilt_deg), EXACT) == pytest.approx(expected, rel=2e-3)
    narrow = sheet_with(half_beam_deg=0.0).parameters()
    assert wide_beam(down(slant, tilt_deg), narrow) == pytest.approx(slant)


def test_the_ceiling_is_by_slant_range() -> None:
    p = sheet_with(half_beam_deg=0.0, resolution_m=0.0).parameters()
    turn = Turn.from_euler("X", math.radians(20.0))
    rotation = tuple(float(x) for x in turn.as_matrix().ravel())
    near, far = (beam_distance(0.0, 0.0, h, rotation, LEVEL) for h in (4.65, 4.75))
    assert near.distance_m < 5.0 < far.distance_m
    assert read(near, p=p) == (pytest.approx(near.distance_m), 255.0, 1.0)
    assert read(far, p=p) == (5.0, 0.0, 1.0)


def test_anything_nearer_than_the_floor_reads_as_the_floor() -> None:
    assert read(down(0.1)) == (0.3, 255.0, 1.0)
    assert read(down(0.31)) == (pytest.approx(0.31), 255.0, 1.0)


def test_a_grazing_beam_has_no_echo() -> None:
    assert read(down(2.0, 34.9)).quality == 255.0
    assert read(down(2.0, 35.1)) == (5.0, 0.0, 1.0)


def test_noise_grows_with_the_distance() -> None:
    p = EXACT._replace(echo_above=1e3, held_begins_above=1e3)
    for distance in (0.5, 4.0):
        readings = [read(down(distance), n, p).range_m for n in draws(RangeSensorNormals, 4000, 12)]
        assert np.std(readings) == pytest.approx(math.hypot(0.005, 0.005 * distance), rel=4 / math.sqrt(8000))
        assert np.mean(readings) == pytest.approx(distance, abs=2e-3)


def test_readings_come_in_whole_steps() -> None:
    p = SHEET.parameters()
    reading = read(down(1.2345678), silent(RangeSensorNormals, noise=0.3), p).range_m
    assert reading * 1000 == pytest.approx(np.rint(reading * 1000), abs=1e-9)


def test_a_unit_has_scale_and_offset() -> None:
    unit = draw_range_sensor(RangeSensorUnit(2.0, -3.0), EXACT)
    assert unit == pytest.approx((0.02, -0.015))
    assert read(down(2.0), unit=unit).range_m == pytest.approx(2.0 * 1.02 - 0.015)
    for name, fields in moved_by(RangeSensorUnit, lambda n: draw_range_sensor(n, EXACT)).items():
        assert fields == {name}


def test_echoes_are_twice_as_far_or_near() -> None:
    strong = silent(RangeSensorNormals, echo=3.0)
    assert read(down(2.0), strong._replace(echo_kind=1.0)) == (4.0, 255.0, 1.0)
    assert read(down(2.0), strong._replace(echo_kind=-1.0)) == (0.45, 255.0, 1.0)
    assert read(down(2.6), strong._replace(echo_kind=1.0)) == (5.0, 0.0, 1.0)  # beyond the ceiling: no echo
    assert read(down(9.0), strong._replace(echo_kind=-1.0)) == (0.45, 255.0, 1.0)
    p = sheet_with(echo_share=0.1, held={}).parameters()
    readings = np.array([read(down(2.0), n, p).range_m for n in draws(RangeSensorNormals, 6000, 13)])
    assert np.mean(np.abs(readings - 4.0) < 0.2) == pytest.approx(0.05, abs=0.012)
    assert np.mean(readings == 0.45) == pytest.approx(0.05, abs=0.012)


def fly(p: RangeSensorParameters, count: int, seed: int) -> np.ndarray:
    """Readings of a climb of 0.1 mm a reading."""
    state, out = start_range_sensor(down(1.0), p), np.empty((count, 3))
    for k, n in enumerate(draws(RangeSensorNormals, count, seed)):
        state, out[k] = step_range_sensor(state, PERFECT, down(1.0 + 1e-4 * k), n, p)
    return out


def test_a_held_value_stays_for_the_spell() -> None:
    p = sheet_with(held={"share": 0.2, "mean_s": 0.8}, echo_share=0.0, resolution_m=0.0).parameters()
    same = np.diff(fly(p, 8000, 14)[:, 0]) == 0.0
    assert same.mean() == pytest.approx(0.2, abs=0.03)
    assert same.sum() / np.count_nonzero(np.diff(same.astype(int)) > 0) * 0.1 == pytest.approx(0.8, rel=0.12)
    held = WORKING._replace(held=1.0, last_m=3.3, last_quality=0.0)
    assert read(down(2.0), state=held) == (3.3, 0.0, 1.0)


def test_drop_outs_fill_their_share() -> None:
    p = sheet_with(lost={"share": 0.2, "mean_s": 0.5}).parameters()
    arrived = fly(p, 8000, 15)[:, 2]
    assert arrived.mean() == pytest.approx(0.8, abs=0.03)
    gaps = np.count_nonzero(np.diff(arrived) > 0)
    assert (arrived == 0).sum() / gaps * 0.1 == pytest.approx(0.5, rel=0.12)


def test_a_stuck_unit_says_one_thing() -> None:
    p = sheet_with(stuck_at_m=0.7).parameters()
    for hit in (down(2.0), down(9.0), down(2.0, 50.0)):
        assert read(hit, silent(RangeSensorNormals, noise=1.0, echo=4.0), p) == (0.7, 255.0, 1.0)


def test_it_starts_on_what_it_sees() -> None:
    assert start_range_sensor(down(0.1), EXACT) == (0.3, 255.0, 0.0, 0.0)
    assert start_range_sensor(down(2.0), EXACT) == (2.0, 255.0, 0.0, 0.0)


def test_the_lidar_ships_too() -> None:
    lidar = RangeSensorSheet.read(shipped("sensors/range_lidar.toml"))
    assert lidar.floor_m < SHEET.floor_m
    assert lidar.ceiling_m > SHEET.ceiling_m
    assert read(down(10.0), p=lidar.parameters()) == (10.0, 255.0, 1.0)


def test_what_the_datasheet_refuses() -> None:
    for changes, message in (
        ({"ceiling_m": 0.2}, "ceiling_m: more than floor_m = 0.3 is needed"),
        ({"half_beam_deg": 60}, "half_beam_deg: Input should be less than or equal to 45"),
        ({"jitter_s": 0.04}, "jitter_s: at most latency_s = 0.03 is needed"),
        ({"lost": {"mean_s": 0}}, "lost.mean_s: Input should be greater than 0"),
    ):
        with pytest.raises(InputError, match=f"^range.toml: {message}"):
            sheet_with(**changes)
    with pytest.raises(InputError, match=r"nowhere\.toml: no such file"):
        RangeSensorSheet.read("nowhere.toml")
