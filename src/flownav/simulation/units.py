"""Before a flight: every sensor as it is on this flight, and its state at rest or from its stationary distribution."""

from __future__ import annotations

from flownav.compile import Lanes, Work, lane_access, procedure
from flownav.frames import rotation_from_quaternion
from flownav.sensors.barometer import BarometerStartNormals, BarometerUnit, draw_barometer, start_barometer
from flownav.sensors.flow_camera import FlowCameraStartNormals, FlowCameraUnit, draw_flow_camera, start_flow_camera
from flownav.sensors.gps_receiver import GpsReceiverStartNormals, GpsReceiverUnit, draw_gps_receiver, start_gps_receiver
from flownav.sensors.inertial import InertialStartNormals, InertialUnit, draw_inertial, start_inertial
from flownav.sensors.magnetometer import MagnetometerUnit, draw_magnetometer
from flownav.sensors.pad_camera import PadCameraUnit, draw_pad_camera
from flownav.sensors.range_sensor import RangeSensorUnit, draw_range_sensor, start_range_sensor
from flownav.sensors.skid_switch import SkidSwitchUnit, draw_skid_switch, start_skid_switch
from flownav.simulation import layout
from flownav.simulation.draws import (
    BARO_START,
    CAMERA_START,
    INERTIAL_START,
    MAG_START,
    PAD_START,
    RANGE_START,
    RECEIVER_START,
    SKID_START,
    draw,
)
from flownav.simulation.layout import (
    baro_as_is,
    camera_as_is,
    ground_as_is,
    inertial_as_is,
    load_baro_unit,
    load_helicopter,
    mag_as_is,
    pad_as_is,
    ranger_as_is,
    receiver_as_is,
    skid_as_is,
    store_baro,
    store_baro_unit,
    store_camera,
    store_camera_unit,
    store_inertial,
    store_inertial_unit,
    store_mag_unit,
    store_pad_unit,
    store_range_unit,
    store_ranger,
    store_receiver,
    store_receiver_unit,
    store_skid,
    store_skid_unit,
)
from flownav.simulation.onboard import Onboard, baro_truth, beam_of, receiver_truth

drawn_inertial_unit, _ = lane_access(InertialUnit, layout.INERTIAL_DRAWN)
drawn_inertial_start, _ = lane_access(InertialStartNormals, layout.INERTIAL_BEGUN)
drawn_receiver_unit, _ = lane_access(GpsReceiverUnit, layout.RECEIVER_DRAWN)
drawn_receiver_start, _ = lane_access(GpsReceiverStartNormals, layout.RECEIVER_BEGUN)
drawn_camera_unit, _ = lane_access(FlowCameraUnit, layout.CAMERA_DRAWN)
drawn_camera_start, _ = lane_access(FlowCameraStartNormals, layout.CAMERA_BEGUN)
drawn_range_unit, _ = lane_access(RangeSensorUnit, layout.RANGE_DRAWN)
drawn_baro_unit, _ = lane_access(BarometerUnit, layout.BARO_DRAWN)
drawn_baro_start, _ = lane_access(BarometerStartNormals, layout.BARO_BEGUN)
drawn_mag_unit, _ = lane_access(MagnetometerUnit, layout.MAG_DRAWN)
drawn_pad_unit, _ = lane_access(PadCameraUnit, layout.PAD_DRAWN)
drawn_skid_unit, _ = lane_access(SkidSwitchUnit, layout.SKID_DRAWN)


@procedure
def draw_units(work: Work, lanes: Lanes, seed: int, flight: int, step: int) -> None:
    """The normals of every unit and of its state before the flight."""
    draw(work, lanes, layout.INERTIAL_DRAWN, 28, seed, flight, step, INERTIAL_START)
    draw(work, lanes, layout.INERTIAL_BEGUN, 10, seed, flight, step + 1, INERTIAL_START)
    draw(work, lanes, layout.RECEIVER_DRAWN, 4, seed, flight, step, RECEIVER_START)
    draw(work, lanes, layout.RECEIVER_BEGUN, 10, seed, flight, step + 1, RECEIVER_START)
    draw(work, lanes, layout.CAMERA_DRAWN, 10, seed, flight, step, CAMERA_START)
    draw(work, lanes, layout.CAMERA_BEGUN, 2, seed, flight, step + 1, CAMERA_START)
    draw(work, lanes, layout.RANGE_DRAWN, 2, seed, flight, step, RANGE_START)
    draw(work, lanes, layout.BARO_DRAWN, 4, seed, flight, step, BARO_START)
    draw(work, lanes, layout.BARO_BEGUN, 2, seed, flight, step + 1, BARO_START)
    draw(work, lanes, layout.MAG_DRAWN, 16, seed, flight, step, MAG_START)
    draw(work, lanes, layout.PAD_DRAWN, 6, seed, flight, step, PAD_START)
    draw(work, lanes, layout.SKID_DRAWN, 2, seed, flight, step, SKID_START)


@procedure
def start_onboard(work: Work, lanes: Lanes, s: Onboard) -> None:
    """Every unit as it is on this flight, and its state at rest or from its stationary distribution.

    Their normals lie in their rows.
    """
    start_inertials(work, lanes)
    start_receivers(work, lanes)
    start_cameras(work, lanes)
    start_rest(work, lanes, s)


@procedure
def start_inertials(work: Work, lanes: Lanes) -> None:
    """The inertial units."""
    for lane in range(len(lanes)):
        store_inertial_unit(
            work, lanes, lane, draw_inertial(drawn_inertial_unit(work, lanes, lane), inertial_as_is(work, lanes, lane))
        )
    for lane in range(len(lanes)):
        store_inertial(
            work,
            lanes,
            lane,
            start_inertial(drawn_inertial_start(work, lanes, lane), inertial_as_is(work, lanes, lane)),
        )


@procedure
def start_receivers(work: Work, lanes: Lanes) -> None:
    """The GPS receivers."""
    for lane in range(len(lanes)):
        store_receiver_unit(
            work,
            lanes,
            lane,
            draw_gps_receiver(drawn_receiver_unit(work, lanes, lane), receiver_as_is(work, lanes, lane)),
        )
    for lane in range(len(lanes)):
        state = load_helicopter(work, lanes, lane)
        rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
        normals = drawn_receiver_start(work, lanes, lane)
        store_receiver(
            work,
            lanes,
            lane,
            start_gps_receiver(receiver_truth(state, 0.0), rotation, normals, receiver_as_is(work, lanes, lane)),
        )


@procedure
def start_cameras(work: Work, lanes: Lanes) -> None:
    """The flow cameras."""
    for lane in range(len(lanes)):
        store_camera_unit(
            work, lanes, lane, draw_flow_camera(drawn_camera_unit(work, lanes, lane), camera_as_is(work, lanes, lane))
        )
    for lane in range(len(lanes)):
        store_camera(
            work, lanes, lane, start_flow_camera(drawn_camera_start(work, lanes, lane), camera_as_is(work, lanes, lane))
        )


@procedure
def start_rest(work: Work, lanes: Lanes, s: Onboard) -> None:
    """Rangefinders, barometers, magnetometers, pad cameras and skid switches."""
    for lane in range(len(lanes)):
        store_range_unit(
            work, lanes, lane, draw_range_sensor(drawn_range_unit(work, lanes, lane), ranger_as_is(work, lanes, lane))
        )
        hit = beam_of(load_helicopter(work, lanes, lane), s.range_place, ground_as_is(work, lanes, lane))
        store_ranger(work, lanes, lane, start_range_sensor(hit, ranger_as_is(work, lanes, lane)))
    for lane in range(len(lanes)):
        store_baro_unit(
            work, lanes, lane, draw_barometer(drawn_baro_unit(work, lanes, lane), baro_as_is(work, lanes, lane))
        )
    for lane in range(len(lanes)):
        truth, unit = baro_truth(work, lanes, lane, s), load_baro_unit(work, lanes, lane)
        store_baro(
            work,
            lanes,
            lane,
            start_barometer(truth, unit, drawn_baro_start(work, lanes, lane), baro_as_is(work, lanes, lane)),
        )
    for lane in range(len(lanes)):
        store_mag_unit(
            work, lanes, lane, draw_magnetometer(drawn_mag_unit(work, lanes, lane), mag_as_is(work, lanes, lane))
        )
    for lane in range(len(lanes)):
        store_pad_unit(
            work, lanes, lane, draw_pad_camera(drawn_pad_unit(work, lanes, lane), pad_as_is(work, lanes, lane))
        )
    for lane in range(len(lanes)):
        store_skid_unit(
            work, lanes, lane, draw_skid_switch(drawn_skid_unit(work, lanes, lane), skid_as_is(work, lanes, lane))
        )
        load_n = work[layout.CONTACT * len(lanes) + lane]
        store_skid(work, lanes, lane, start_skid_switch(load_n, skid_as_is(work, lanes, lane)))
