"""The sensors of a vehicle in one kernel: a flight has the same bits alone, among sixteen, and as plain Python."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from flownav.core.compile import LANES, ONE_LANE, equation, kernel, lane_access
from flownav.core.frames import rotation_from_quaternion
from flownav.sensors.barometer import (
    BarometerNormals,
    BarometerParameters,
    BarometerReading,
    BarometerStartNormals,
    BarometerState,
    BarometerTruth,
    BarometerUnit,
    draw_barometer,
    start_barometer,
    step_barometer,
)
from flownav.sensors.datasheet import load_sensor
from flownav.sensors.flow import FlowParameters
from flownav.sensors.flow_camera import (
    FlowCameraNormals,
    FlowCameraParameters,
    FlowCameraReading,
    FlowCameraStartNormals,
    FlowCameraState,
    FlowCameraTruth,
    FlowCameraUnit,
    draw_flow_camera,
    pad_texture,
    start_flow_camera,
    step_flow_camera,
)
from flownav.sensors.geometry import Ground, LensPose, beam_distance
from flownav.sensors.gps_receiver import (
    GpsReceiverNormals,
    GpsReceiverParameters,
    GpsReceiverReading,
    GpsReceiverStartNormals,
    GpsReceiverState,
    GpsReceiverTruth,
    GpsReceiverUnit,
    draw_gps_receiver,
    start_gps_receiver,
    step_gps_receiver,
)
from flownav.sensors.inertial import (
    ImuReading,
    InertialNormals,
    InertialParameters,
    InertialReading,
    InertialStartNormals,
    InertialState,
    InertialUnit,
    draw_inertial,
    start_inertial,
    step_inertial,
)
from flownav.sensors.magnetometer import (
    MagnetometerNormals,
    MagnetometerParameters,
    MagnetometerReading,
    MagnetometerUnit,
    draw_magnetometer,
    read_magnetometer,
)
from flownav.sensors.pad_camera import (
    PadCameraNormals,
    PadCameraParameters,
    PadCameraReading,
    PadCameraUnit,
    draw_pad_camera,
    read_pad_camera,
)
from flownav.sensors.range_sensor import (
    RangeSensorNormals,
    RangeSensorParameters,
    RangeSensorReading,
    RangeSensorState,
    RangeSensorUnit,
    draw_range_sensor,
    start_range_sensor,
    step_range_sensor,
)
from flownav.sensors.settings import FlowSettings
from flownav.sensors.sheets import shipped_sheets
from flownav.sensors.skid_switch import (
    SkidSwitchNormals,
    SkidSwitchParameters,
    SkidSwitchReading,
    SkidSwitchState,
    SkidSwitchUnit,
    draw_skid_switch,
    start_skid_switch,
    step_skid_switch,
)

EPOCHS = 60


class Suite(NamedTuple):
    inertial: InertialParameters
    gps: GpsReceiverParameters
    camera: FlowCameraParameters
    flow: FlowParameters
    ranging: RangeSensorParameters
    barometer: BarometerParameters
    magnetometer: MagnetometerParameters
    pad: PadCameraParameters
    skids: SkidSwitchParameters
    ground: Ground


class Motion(NamedTuple):
    """Where a lane's vehicle is and how it moves."""

    qw: float
    qx: float
    qy: float
    qz: float


READINGS = (
    InertialReading, GpsReceiverReading, FlowCameraReading, RangeSensorReading, BarometerReading,
    MagnetometerReading, PadCameraReading, SkidSwitchReading,
)  # fmt: skip
STATES = (InertialState, GpsReceiverState, FlowCameraState, RangeSensorState, BarometerState, SkidSwitchState)
UNITS = (
    InertialUnit, GpsReceiverUnit, FlowCameraUnit, RangeSensorUnit, BarometerUnit, MagnetometerUnit, PadCameraUnit,
    SkidSwitchUnit,
)  # fmt: skip
DRAWN = (
    *UNITS, InertialStartNormals, GpsReceiverStartNormals, FlowCameraStartNormals, BarometerStartNormals,
    InertialNormals, GpsReceiverNormals, FlowCameraNormals, RangeSensorNormals, BarometerNormals, MagnetometerNormals,
    PadCameraNormals, SkidSwitchNormals,
)  # fmt: skip

row, load, store, first = 0, {}, {}, {}
for kind, bundles in (
    ("", READINGS),
    ("", STATES),
    ("", UNITS),
    ("normal", DRAWN),
    ("", (GpsReceiverTruth, ImuReading)),
):
    for bundle in bundles:
        name = kind + bundle.__name__
        first[name] = row
        load[name], store[name] = lane_access(bundle, row)
        row += len(bundle._fields)
load["Motion"], store["Motion"] = lane_access(Motion, row)
ROWS = row + 4
READING_ROWS = range(first["InertialState"])
NORMAL_ROWS = range(first["normalInertialUnit"], first["GpsReceiverTruth"])

load_truth, load_force, load_motion = load["GpsReceiverTruth"], load["ImuReading"], load["Motion"]
(unit_imu, unit_gps, unit_camera, unit_range, unit_baro, unit_mag, unit_pad, unit_skid) = (
    load[u.__name__] for u in UNITS
)
(keep_imu, keep_gps, keep_camera, keep_range, keep_baro, keep_mag, keep_pad, keep_skid) = (
    store[u.__name__] for u in UNITS
)
(
    n_imu_unit, n_gps_unit, n_camera_unit, n_range_unit, n_baro_unit, n_mag_unit, n_pad_unit, n_skid_unit,
    n_imu_start, n_gps_start, n_camera_start, n_baro_start,
    n_imu, n_gps, n_camera, n_range, n_baro, n_mag, n_pad, n_skid,
) = (load["normal" + bundle.__name__] for bundle in DRAWN)  # fmt: skip
s_imu, s_gps, s_camera, s_range, s_baro, s_skid = (load[s.__name__] for s in STATES)
put_imu, put_gps, put_camera, put_range, put_baro, put_skid = (store[s.__name__] for s in STATES)
(out_imu, out_gps, out_camera, out_range, out_baro, out_mag, out_pad, out_skid) = (store[r.__name__] for r in READINGS)


@equation
def rotation_of(work, lanes, lane):
    m = load_motion(work, lanes, lane)
    return rotation_from_quaternion(m.qw, m.qx, m.qy, m.qz)


@equation
def hit_of(work, lanes, lane, suite):
    truth, rotation = load_truth(work, lanes, lane), rotation_of(work, lanes, lane)
    return beam_distance(truth.pos_n_m, truth.pos_e_m, -truth.pos_d_m, rotation, suite.ground)


@equation
def start_lane(work, lanes, lane, suite):
    truth, rotation = load_truth(work, lanes, lane), rotation_of(work, lanes, lane)
    keep_imu(work, lanes, lane, draw_inertial(n_imu_unit(work, lanes, lane), suite.inertial))
    keep_gps(work, lanes, lane, draw_gps_receiver(n_gps_unit(work, lanes, lane), suite.gps))
    keep_camera(work, lanes, lane, draw_flow_camera(n_camera_unit(work, lanes, lane), suite.camera))
    keep_range(work, lanes, lane, draw_range_sensor(n_range_unit(work, lanes, lane), suite.ranging))
    keep_baro(work, lanes, lane, draw_barometer(n_baro_unit(work, lanes, lane), suite.barometer))
    keep_mag(work, lanes, lane, draw_magnetometer(n_mag_unit(work, lanes, lane), suite.magnetometer))
    keep_pad(work, lanes, lane, draw_pad_camera(n_pad_unit(work, lanes, lane), suite.pad))
    keep_skid(work, lanes, lane, draw_skid_switch(n_skid_unit(work, lanes, lane), suite.skids))
    put_imu(work, lanes, lane, start_inertial(n_imu_start(work, lanes, lane), suite.inertial))
    put_gps(work, lanes, lane, start_gps_receiver(truth, rotation, n_gps_start(work, lanes, lane), suite.gps))
    put_camera(work, lanes, lane, start_flow_camera(n_camera_start(work, lanes, lane), suite.camera))
    put_range(work, lanes, lane, start_range_sensor(hit_of(work, lanes, lane, suite), suite.ranging))
    air = BarometerTruth(-truth.pos_d_m, -truth.pos_d_m, 77.0)
    start_normals = n_baro_start(work, lanes, lane)
    put_baro(work, lanes, lane, start_barometer(air, unit_baro(work, lanes, lane), start_normals, suite.barometer))
    put_skid(work, lanes, lane, start_skid_switch(0.0, suite.skids))


@equation
def step_lane(work, lanes, lane, suite):
    truth, force = load_truth(work, lanes, lane), load_force(work, lanes, lane)
    rotation, hit = rotation_of(work, lanes, lane), hit_of(work, lanes, lane, suite)
    imu, inertial = step_inertial(
        s_imu(work, lanes, lane), unit_imu(work, lanes, lane), force, n_imu(work, lanes, lane), suite.inertial
    )
    put_imu(work, lanes, lane, imu)
    out_imu(work, lanes, lane, inertial)
    gps, fix = step_gps_receiver(
        s_gps(work, lanes, lane), unit_gps(work, lanes, lane), truth, rotation, n_gps(work, lanes, lane), suite.gps
    )
    put_gps(work, lanes, lane, gps)
    out_gps(work, lanes, lane, fix)
    height = -truth.pos_d_m
    lens = LensPose(truth.pos_n_m, truth.pos_e_m, height, rotation)
    texture = pad_texture(lens, 0.8, suite.flow)
    seen = FlowCameraTruth(
        truth.vel_n_m_s, truth.vel_e_m_s, truth.vel_d_m_s, force.gyro_x_rad_s, force.gyro_y_rad_s, force.gyro_z_rad_s,
        hit.distance_m, height, rotation[8], texture,
    )  # fmt: skip
    camera, flow = step_flow_camera(
        s_camera(work, lanes, lane), unit_camera(work, lanes, lane), seen, n_camera(work, lanes, lane), suite.flow,
        suite.camera,
    )  # fmt: skip
    put_camera(work, lanes, lane, camera)
    out_camera(work, lanes, lane, flow)
    sonar, distance = step_range_sensor(
        s_range(work, lanes, lane), unit_range(work, lanes, lane), hit, n_range(work, lanes, lane), suite.ranging
    )
    put_range(work, lanes, lane, sonar)
    out_range(work, lanes, lane, distance)
    air = BarometerTruth(height, height + 0.3, 77.0)
    baro, altitude = step_barometer(
        s_baro(work, lanes, lane), unit_baro(work, lanes, lane), air, n_baro(work, lanes, lane), suite.barometer
    )
    put_baro(work, lanes, lane, baro)
    out_baro(work, lanes, lane, altitude)
    field = read_magnetometer(
        unit_mag(work, lanes, lane), rotation, 1300.0, n_mag(work, lanes, lane), suite.magnetometer
    )
    out_mag(work, lanes, lane, field)
    pad = read_pad_camera(unit_pad(work, lanes, lane), lens, 0.3, n_pad(work, lanes, lane), suite.pad, suite.pad)
    out_pad(work, lanes, lane, pad)
    skid, landed = step_skid_switch(
        s_skid(work, lanes, lane), unit_skid(work, lanes, lane), 40.0 - 20.0 * height, n_skid(work, lanes, lane),
        suite.skids,
    )  # fmt: skip
    put_skid(work, lanes, lane, skid)
    out_skid(work, lanes, lane, landed)


@kernel
def start_all(work, lanes, suite):
    for lane in range(len(lanes)):
        start_lane(work, lanes, lane, suite)


@kernel
def step_all(work, lanes, suite):
    for lane in range(len(lanes)):
        step_lane(work, lanes, lane, suite)


def suite_of(chances: bool) -> Suite:
    """The shipped sensors; with `chances` everything that happens by chance happens often."""
    s = shipped_sheets()
    ranging, camera, gps, pad = (
        s.range_sensor.parameters(), s.flow_camera.parameters(), s.gps_receiver.parameters(), s.pad_camera.parameters()
    )  # fmt: skip
    if chances:
        often = {"lost_begins_above": 1.0, "held_begins_above": 1.0, "echo_above": 1.0}
        ranging = ranging._replace(**often)
        camera = camera._replace(low_begins_above=1.0, outlier_above=1.0, lost_above=1.0)
        gps = gps._replace(outage_begins_above=1.0)
        pad = pad._replace(false_above=1.0, missed_above=0.5)
    return Suite(
        s.inertial.parameters(152.4, 2), gps, camera,
        FlowSettings(sonar_overscale=False).parameters(load_sensor()), ranging, s.barometer.parameters(0.89, 1.225),
        s.magnetometer.parameters(s.magnetic_field), pad, s.skid_switch.parameters(77.0),
        Ground(0.03, -0.02, 0.2, 0.1, 0.05, 0.6, 0.8),
    )  # fmt: skip


def motion(flight: int, epoch: int) -> tuple[GpsReceiverTruth, ImuReading, Motion]:
    """A descent over the step that differs between flights."""
    phase = 0.1 * epoch + flight
    roll, pitch = 0.1 * np.sin(phase), 0.05 * np.cos(phase)
    shrink = 1.0 / np.sqrt(1.0 + roll**2 + pitch**2)
    truth = GpsReceiverTruth(
        0.3 * np.sin(phase), 0.2 * np.cos(phase), -(2.6 - 0.04 * epoch), 0.5 * np.cos(phase), -0.2, 0.3, 0.1, 0.2, -0.3
    )
    return truth, ImuReading(0.1, 0.2, -0.3, np.sin(phase), 0.1, -9.7), Motion(shrink, roll * shrink, pitch * shrink, 0)


def fill(work: NDArray[np.float64], width: int, flight: int, epoch: int) -> None:
    for lane in range(width):
        drawn = np.random.default_rng([flight + lane, epoch]).standard_normal(len(NORMAL_ROWS))
        for r, normal in zip(NORMAL_ROWS, drawn, strict=True):
            work[r * width + lane] = normal
        lanes = (0,) * width
        for bundle in motion(flight + lane, epoch):
            store[type(bundle).__name__](work, lanes, lane, bundle)


def fly(lanes: tuple[int, ...], flight: int, suite: Suite, compiled: bool = True) -> NDArray[np.float64]:
    """Every reading of every epoch and lane: (EPOCHS, readings, lanes)."""
    width = len(lanes)
    work = np.zeros(ROWS * width)
    fill(work, width, flight, 0)
    if compiled:
        start_all(work, lanes, suite)
    else:
        start_lane(work, lanes, 0, suite)
    out = []
    for epoch in range(EPOCHS):
        fill(work, width, flight, epoch)
        if compiled:
            step_all(work, lanes, suite)
        else:
            step_lane(work, lanes, 0, suite)
        out.append(work.reshape(ROWS, width)[READING_ROWS].copy())
    return np.array(out)


@pytest.mark.parametrize("chances", [False, True])
def test_a_flight_has_the_same_bits_alone_and_among_sixteen(chances: bool) -> None:
    suite = suite_of(chances)
    together = fly(LANES, 0, suite)
    assert np.isfinite(together).all()
    varies = np.ptp(together, axis=(0, 2)) > 0.0
    constant = {"InertialReading": 2, "BarometerReading": 2, "MagnetometerReading": 2, "SkidSwitchReading": 2}
    at = 0
    for reading in READINGS:
        fields = len(reading._fields)
        expected = fields - constant.get(reading.__name__, 0)
        assert varies[at : at + expected].all() or not chances, reading.__name__
        at += fields
    for flight in range(len(LANES)):
        alone = fly(ONE_LANE, flight, suite)
        assert alone[:, :, 0].tobytes() == together[:, :, flight].tobytes()


@pytest.mark.parametrize("chances", [False, True])
def test_the_compiled_sensors_are_the_plain_ones(chances: bool) -> None:
    suite = suite_of(chances)
    np.testing.assert_allclose(fly(ONE_LANE, 3, suite), fly(ONE_LANE, 3, suite, compiled=False), rtol=1e-12, atol=1e-13)
