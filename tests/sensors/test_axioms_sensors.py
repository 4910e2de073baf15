"""Invariances of the sensors: quarter-turns, mirrors, the turn of north, steps that add up."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flownav.core.frames import angular_flow, quaternion_from_euler, rotation_from_quaternion, turned_about_down
from flownav.sensors.camera_sheets import FlowCameraSheet
from flownav.sensors.datasheet import load_sensor
from flownav.sensors.flow import FlowState, misread, pattern_reach, start_flow, step_flow
from flownav.sensors.flow_camera import (
    FlowCameraNormals,
    FlowCameraState,
    FlowCameraTruth,
    FlowCameraUnit,
    step_flow_camera,
)
from flownav.sensors.geometry import (
    LEVEL,
    BeamHit,
    Ground,
    LensPose,
    beam_distance,
    ground_height,
    in_turned_axes,
    lever_velocity,
    turned_rotation,
)
from flownav.sensors.gps_receiver import (
    GpsReceiverNormals,
    GpsReceiverStartNormals,
    GpsReceiverTruth,
    GpsReceiverUnit,
    start_gps_receiver,
    step_gps_receiver,
)
from flownav.sensors.inertial import (
    ImuReading,
    InertialNormals,
    InertialStartNormals,
    InertialUnit,
    start_inertial,
    step_inertial,
)
from flownav.sensors.magnetometer import (
    MagnetometerNormals,
    MagnetometerParameters,
    MagnetometerUnit,
    read_magnetometer,
)
from flownav.sensors.processes import gauss_markov_coefficients, hold_step, lag_weights, lagged, second_order_hold
from flownav.sensors.range_sensor import (
    RangeSensorNormals,
    RangeSensorSheet,
    RangeSensorState,
    RangeSensorUnit,
    step_range_sensor,
    wide_beam,
)
from flownav.sensors.settings import FlowSettings
from flownav.sensors.sheets import GpsReceiverSheet, InertialSheet
from sensor_normals import silent

SEEDS = pytest.mark.parametrize("seed", range(6))
FLOW = FlowSettings().parameters(load_sensor())


def floats(rng: np.random.Generator, count: int, size: float = 1.0) -> tuple[float, ...]:
    return tuple(float(x) for x in size * rng.normal(size=count))


def about_down(pair, angle):
    cosine, sine = math.cos(angle), math.sin(angle)
    return cosine * pair[0] - sine * pair[1], sine * pair[0] + cosine * pair[1]


def attitude(rng: np.random.Generator, angle: float = 0.0):
    """The attitude that these chances draw, in a world turned by an angle."""
    q = quaternion_from_euler(*floats(rng, 2, 0.3), float(rng.uniform(-3.0, 3.0)))
    return rotation_from_quaternion(*turned_about_down(q, angle))


# -- quarter-turns and mirrors -----------------------------------------------------------------------------------
@SEEDS
def test_flow_does_not_tell_forward_from_right(seed):
    """A quarter-turn of all that moves turns what is seen: angular flow, and what a late sonar makes of it."""
    u, v, w, p, q, height = *floats(np.random.default_rng(seed), 5), 1.7
    x, y = angular_flow(u, v, p, q, height)
    assert angular_flow(-v, u, -q, p, height) == pytest.approx((-y, x))
    settings = FLOW._replace(sonar_lag_s=0.1, rotation_leak=0.07)
    ahead, aside = misread(u, v, w, p, q, height, settings)
    assert misread(-v, u, w, -q, p, height, settings) == pytest.approx((-aside, ahead))
    state = FlowState(*floats(np.random.default_rng(seed), 6), 0.0, 0.0, 1.0)
    after = step_flow(state, u, v, w, height, 9.8, FLOW)
    turned = state._replace(u1=-state.v1, u2=-state.v2, v1=state.u1, v2=state.u2)
    other = step_flow(turned, -v, u, w, height, 9.8, FLOW._replace(shake_horizontal=0.0))
    level = step_flow(state, u, v, w, height, 9.8, FLOW._replace(shake_horizontal=0.0))
    assert (other.u1, other.u2, other.v1, other.v2) == pytest.approx((-level.v1, -level.v2, level.u1, level.u2))
    assert after[4:] == level[4:]


@SEEDS
def test_a_square_pad_fills_the_image_alike_after_a_quarter_turn_and_in_a_mirror(seed):
    rng = np.random.default_rng(seed)
    north, east = floats(rng, 2)
    q = quaternion_from_euler(*floats(rng, 2, 0.2), float(rng.uniform(-3.0, 3.0)))
    found = pattern_reach(LensPose(north, east, 2.0, rotation_from_quaternion(*q)), 0.4)
    for quarters in (1, 2, 3):
        angle = 0.5 * math.pi * quarters
        rotation = rotation_from_quaternion(*turned_about_down(q, angle))
        assert pattern_reach(LensPose(*about_down((north, east), angle), 2.0, rotation), 0.4) == pytest.approx(found)
    mirrored = rotation_from_quaternion(q[0], -q[1], q[2], -q[3])
    assert pattern_reach(LensPose(north, -east, 2.0, mirrored), 0.4) == pytest.approx(found)


@SEEDS
def test_small_turns_and_levers_are_cross_products(seed):
    rng = np.random.default_rng(seed)
    vector, angles, rates, lever = (floats(rng, 3) for _ in range(4))
    assert in_turned_axes(*vector, *angles) == pytest.approx(np.subtract(vector, np.cross(angles, vector)))
    rotation = attitude(rng)
    matrix = np.reshape(rotation, (3, 3))
    assert lever_velocity(rotation, *rates, *lever) == pytest.approx(matrix @ np.cross(rates, lever))
    skew = np.column_stack([np.cross(angles, axis) for axis in np.eye(3)])
    assert turned_rotation(rotation, *angles) == pytest.approx((matrix @ (np.eye(3) + skew)).ravel())


def test_a_rotating_force_is_a_quarter_ahead_along_x():
    """The force along x of a revolution appears along y a quarter of a turn later: the phase is that of one rotor."""
    p = InertialSheet.read().parameters(152.4, 2)
    unit, quiet = silent(InertialUnit, vibration=1.0), silent(InertialNormals)
    still = ImuReading(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for tone in ("rev", "blade"):
        other = "blade" if tone == "rev" else "rev"
        alone = p._replace(**{name: 0.0 for name in p._fields if name.startswith(f"{other}_") and "_s" in name})
        for phase in (0.0, 0.9, 2.0, 4.4):
            readings = []
            for angle in (phase, phase + 0.5 * math.pi):
                names = {f"{tone}_one": math.cos(angle), f"{tone}_two": math.sin(angle), f"{other}_one": 1.0}
                state = start_inertial(silent(InertialStartNormals, **names), alone)
                readings.append(step_inertial(state, unit, still, quiet, alone)[1])
            now, later = readings
            assert (later.gyro_y_rad_s, later.accel_y_m_s2) == pytest.approx((now.gyro_x_rad_s, now.accel_x_m_s2))
            assert (later.gyro_x_rad_s, later.accel_x_m_s2) == pytest.approx((-now.gyro_y_rad_s, -now.accel_y_m_s2))


# -- the turn of north ---------------------------------------------------------------------------------------------
@SEEDS
@pytest.mark.parametrize("angle", [0.5 * math.pi, -1.1])
def test_a_beam_meets_ground_that_is_turned_with_it_as_far_away(seed, angle):
    rng = np.random.default_rng(seed)
    slope, edge, place = floats(rng, 2, 0.1), floats(rng, 2), floats(rng, 2)
    toward = about_down((1.0, 0.0), float(rng.uniform(-3.0, 3.0)))
    state = rng.bit_generator.state

    def seen(turn: float, size: float):
        rng.bit_generator.state = state
        around = (about_down(pair, turn) for pair in (slope, np.multiply(edge, size), toward))
        (sn, se), (en, ee), (dn, de) = around
        ground = Ground(sn, se, 0.3 * size, en, ee, dn, de)
        here = about_down(np.multiply(place, size), turn)
        hit = beam_distance(*here, 2.0 * size, attitude(rng, turn), ground)
        return hit.distance_m / size, hit.incidence_cosine, ground_height(*here, ground) / size

    assert seen(angle, 1.0) == pytest.approx(seen(0.0, 1.0))
    assert seen(0.0, 7.0) == pytest.approx(seen(0.0, 1.0))  # and a world of larger metres has larger distances


@SEEDS
@pytest.mark.parametrize("angle", [0.5 * math.pi, 2.2])
def test_a_receiver_s_north_is_anybody_s(seed, angle):
    """Truth and errors turned alike: the fix turns, height and what it states stay; and a place far off is no other."""
    rng = np.random.default_rng(seed)
    p = (
        GpsReceiverSheet.read()
        .parameters()
        ._replace(position_quantum_m=0.0, velocity_quantum_m_s=0.0, lever_x_m=-0.3, lever_y_m=0.2, lever_z_m=-0.1)
    )
    truth, rates = floats(rng, 6, 3.0), floats(rng, 3)
    start, step = (floats(rng, len(kind._fields)) for kind in (GpsReceiverStartNormals, GpsReceiverNormals))
    state = rng.bit_generator.state

    def turned(record, turn):
        values = record._asdict()
        for name in list(values):
            east = name.replace("_n", "_e") if name.endswith("_n") else name.replace("_n_", "_e_")
            if east != name and east in values:
                values[name], values[east] = about_down((values[name], values[east]), turn)
        return type(record)(**values)

    def fixed(turn: float, away_m: float = 0.0):
        rng.bit_generator.state = state
        moved = turned(GpsReceiverTruth(*truth, *rates), turn)._replace(pos_d_m=truth[2] + away_m)
        rotation = attitude(rng, turn)
        first = turned(GpsReceiverStartNormals(*start), turn)
        began = start_gps_receiver(moved, rotation, first, p)
        normals = turned(GpsReceiverNormals(*step)._replace(outage=-9.0), turn)
        return step_gps_receiver(began, GpsReceiverUnit(1.2, 0.9, 1.1, 1.3), moved, rotation, normals, p)[1]

    here, there = fixed(0.0), fixed(angle)
    assert there[:2] == pytest.approx(about_down(here[:2], angle))
    assert there[3:5] == pytest.approx(about_down(here[3:5], angle))
    assert (there[2], *there[5:]) == pytest.approx((here[2], *here[5:]))
    assert fixed(0.0, 1000.0)[2] - here[2] == pytest.approx(1000.0)


@SEEDS
def test_a_magnetometer_reads_the_same_field_whichever_way_it_lies(seed):
    rng = np.random.default_rng(seed)
    sheet = MagnetometerParameters(*floats(rng, 3, 0.3), 0.0, 0.0, 0.0, 0.0, 0.0)
    quiet, perfect = silent(MagnetometerNormals), silent(MagnetometerUnit)
    found = read_magnetometer(perfect, attitude(rng), 100.0, quiet, sheet)
    assert np.linalg.norm(found[:3]) == pytest.approx(np.linalg.norm(sheet[:3]))


# -- scale -----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("scale", [0.1, 3.0, 1000.0])
@pytest.mark.parametrize("distance_m", [0.1, 1.0, 3.0, 30.0])
def test_a_rangefinder_in_other_units_reads_the_same_distance(scale, distance_m):
    p = RangeSensorSheet.read().parameters()._replace(resolution_m=0.0)
    lengths = ("floor_m", "ceiling_m", "sigma_m", "near_echo_m", "stuck_m")
    other = p._replace(**{name: scale * getattr(p, name) for name in lengths})
    n = silent(RangeSensorNormals, noise=0.7)
    unit, state = RangeSensorUnit(0.01, 0.02), RangeSensorState(1.0, 255.0, 0.0, 0.0)
    for cosine in (1.0, 0.95, 0.8):
        hit = BeamHit(distance_m, cosine)
        wide = hit._replace(distance_m=scale * distance_m)
        assert wide_beam(wide, other) == pytest.approx(scale * wide_beam(hit, p))
        one = step_range_sensor(state, unit, hit, n, p)[1]
        two = step_range_sensor(state, unit._replace(offset_m=scale * 0.02), wide, n, other)[1]
        assert two.range_m == pytest.approx(scale * one.range_m)
        assert two[1:] == one[1:]


def test_over_level_ground_a_narrow_beam_is_the_slant_and_a_wide_one_the_height():
    for tilt in (0.0, 0.1, 0.3):
        rotation = rotation_from_quaternion(*quaternion_from_euler(tilt, 0.0, 1.0))
        hit = beam_distance(0.3, -0.2, 2.0, rotation, LEVEL)
        assert hit.distance_m * hit.incidence_cosine == pytest.approx(2.0)


# -- steps that add up -----------------------------------------------------------------------------------------------
@SEEDS
def test_two_half_periods_are_a_whole_one(seed):
    """Of each process that is advanced exactly: the same place, whatever the step."""
    rng = np.random.default_rng(seed)
    b, c, period = 14.8, 191.9, 0.02
    x, u = floats(rng, 2), float(rng.normal())
    whole, half = second_order_hold(b, c, period), second_order_hold(b, c, 0.5 * period)
    assert hold_step(*hold_step(*x, u, half), u, half) == pytest.approx(hold_step(*x, u, whole))
    tau, (output, first, last) = 0.13, floats(rng, 3)
    middle = 0.5 * (first + last)
    once, twice = lag_weights(tau, period), lag_weights(tau, 0.5 * period)
    assert lagged(lagged(output, first, middle, *twice), middle, last, *twice) == pytest.approx(
        lagged(output, first, last, *once)
    )
    decay, drive = gauss_markov_coefficients(tau, period)
    decay_half, drive_half = gauss_markov_coefficients(tau, 0.5 * period)
    assert decay_half**2 == pytest.approx(decay)
    assert drive_half**2 * (1.0 + decay_half**2) == pytest.approx(drive**2)


def test_at_rest_in_a_steady_motion_nothing_changes():
    state = start_flow(0.7, -0.3, 0.2, 9.8, FLOW)
    assert step_flow(state, 0.7, -0.3, 0.2, 2.0, 9.8, FLOW) == pytest.approx(state, abs=1e-12)


def test_a_camera_that_leans_in_place_sees_as_well_as_before():
    """Quality and what is engaged go by the lens's height; the range along the boresight makes the flow alone."""
    p = (
        FlowCameraSheet.read()
        .parameters()
        ._replace(quality_lost_at_height=0.5, quality_lost_at_speed=0.0, quality_sigma=0.0, quality_best=250.0)
    )
    unit, quiet = silent(FlowCameraUnit, noise=1.0), silent(FlowCameraNormals)
    seeing = FlowCameraState(1.0, 0.0, 0.0, 0.0)
    level = FlowCameraTruth(0.4, -0.3, 0.0, 0.0, 0.0, 0.0, 1.2, 1.2, 1.0, 1.0)
    one = step_flow_camera(seeing, unit, level, quiet, FLOW, p)[1]
    two = step_flow_camera(seeing, unit, level._replace(range_m=1.5 * level.range_m), quiet, FLOW, p)[1]
    assert (two.quality, two.arrived) == (one.quality, one.arrived)
    assert 1.0 < one.quality < 250.0
    assert (one.flow_x_rad_s, one.flow_y_rad_s) == pytest.approx((1.5 * two.flow_x_rad_s, 1.5 * two.flow_y_rad_s))
    higher = step_flow_camera(seeing, unit, level._replace(height_m=2.0), quiet, FLOW, p)[1]
    assert higher.quality < one.quality
