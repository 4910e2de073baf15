"""The datasheets of all sensors that a vehicle carries: what simulation draws from and what the navigator is told."""

from __future__ import annotations

from flownav.core.parameter_files import ParameterModel
from flownav.sensors.barometer import BarometerSheet, load_barometer_sheet
from flownav.sensors.datasheet import FlowSensor, load_sensor
from flownav.sensors.flow_camera_sheet import FlowCameraSheet, load_flow_camera_sheet
from flownav.sensors.gps_receiver_sheet import GpsReceiverSheet, load_gps_receiver_sheet
from flownav.sensors.inertial_sheet import InertialSheet, load_inertial_sheet
from flownav.sensors.magnetometer import MagneticField, MagnetometerSheet, load_magnetometer_sheet
from flownav.sensors.pad_camera_sheet import PadCameraSheet, load_pad_camera_sheet
from flownav.sensors.range_sensor import RangeSensorSheet, load_range_sensor_sheet
from flownav.sensors.skid_switch import SkidSwitchSheet, load_skid_switch_sheet


class SensorSheets(ParameterModel):
    """One sheet of each sensor; None where the vehicle has none. Only the IMU must be there.

    flow_sensor: the sensor file (dynamics, noise, limits) that the flow camera goes with.
    magnetic_field: the place's.
    """

    inertial: InertialSheet
    magnetometer: MagnetometerSheet | None = None
    magnetic_field: MagneticField = MagneticField()
    barometer: BarometerSheet | None = None
    gps_receiver: GpsReceiverSheet | None = None
    flow_camera: FlowCameraSheet | None = None
    flow_sensor: FlowSensor | None = None
    range_sensor: RangeSensorSheet | None = None
    pad_camera: PadCameraSheet | None = None
    skid_switch: SkidSwitchSheet | None = None


def shipped_sheets() -> SensorSheets:
    """The sheets that ship with flownav: a small helicopter with everything on board."""
    return SensorSheets(
        inertial=load_inertial_sheet(),
        magnetometer=load_magnetometer_sheet(),
        barometer=load_barometer_sheet(),
        gps_receiver=load_gps_receiver_sheet(),
        flow_camera=load_flow_camera_sheet(),
        flow_sensor=load_sensor(),
        range_sensor=load_range_sensor_sheet(),
        pad_camera=load_pad_camera_sheet(),
        skid_switch=load_skid_switch_sheet(),
    )
