"""The datasheets of all sensors that a vehicle carries: what simulation draws from and what the navigator is told."""

from flownav.core.parameter_files import ParameterModel
from flownav.sensors.barometer import BarometerSheet
from flownav.sensors.camera_sheets import FlowCameraSheet, PadCameraSheet
from flownav.sensors.datasheet import FlowSensor, load_sensor
from flownav.sensors.gps_receiver_sheet import GpsReceiverSheet
from flownav.sensors.inertial_sheet import InertialSheet
from flownav.sensors.magnetometer import MagneticField, MagnetometerSheet
from flownav.sensors.range_sensor import RangeSensorSheet
from flownav.sensors.skid_switch import SkidSwitchSheet


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
        inertial=InertialSheet.read(),
        magnetometer=MagnetometerSheet.read(),
        barometer=BarometerSheet.read(),
        gps_receiver=GpsReceiverSheet.read(),
        flow_camera=FlowCameraSheet.read(),
        flow_sensor=load_sensor(),
        range_sensor=RangeSensorSheet.read(),
        pad_camera=PadCameraSheet.read(),
        skid_switch=SkidSwitchSheet.read(),
    )
