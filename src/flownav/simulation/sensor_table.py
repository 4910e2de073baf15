"""The sensors that a vehicle carries for its navigator: one table, a row each.

From a row follow where the sensor lies in the lane buffer and how it is drawn, started and read there (`layout`,
`carriage`), how it is fitted and its timetable (`fitting`), the names of its noise (`sources`), its truth and what may
be dispersed of it (`truth`, `ensemble`), its part of a scenario's file (`scenario`), and what validation makes of it.
docs/how-to/add-a-sensor.md adds one.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple, get_type_hints

from flownav.core.compile import depends_also
from flownav.core.measurement import Sensor
from flownav.sensors.barometer import BarometerReading, BarometerSheet, draw_barometer, start_barometer, step_barometer
from flownav.sensors.camera_sheets import FlowCameraSheet, PadCameraSheet
from flownav.sensors.flow_camera import draw_flow_camera, start_flow_camera
from flownav.sensors.gps_receiver import GpsReceiverReading, draw_gps_receiver, start_gps_receiver, step_gps_receiver
from flownav.sensors.inertial import InertialReading, draw_inertial, start_inertial
from flownav.sensors.magnetometer import (
    MagneticField,
    MagnetometerReading,
    MagnetometerSheet,
    draw_magnetometer,
    read_magnetometer,
)
from flownav.sensors.pad_camera import PadCameraReading, draw_pad_camera
from flownav.sensors.range_sensor import (
    RangeSensorReading,
    RangeSensorSheet,
    draw_range_sensor,
    start_range_sensor,
    step_range_sensor,
)
from flownav.sensors.sheet import SensorSheet
from flownav.sensors.sheets import GpsReceiverSheet, InertialSheet
from flownav.sensors.skid_switch import SkidSwitchReading, SkidSwitchSheet, draw_skid_switch, start_skid_switch
from flownav.simulation import onboard, views
from flownav.simulation.views import reads

if TYPE_CHECKING:
    from flownav.vehicle.kinds import AnyVehicle, RotorFacts

BLADES = 2.0  # of the main rotor


class Channels(NamedTuple):
    """Where a sensor's normals begin in the noise counter, in pairs: of a reading, of a start, of a fault."""

    reading: int
    start: int
    fault: int


class Output(NamedTuple):
    """One of the readings that a sensor gives at a time. say: makes it of what was read; None: the step does."""

    kind: Sensor
    say: Callable[..., Any] | None


class Carrier(NamedTuple):
    """The carrier of the sensors: vehicle, rotor, and the magnetic field at its place."""

    vehicle: AnyVehicle
    rotor: RotorFacts
    field: MagneticField


class SensorRow(NamedTuple):
    """One sensor. Its records are those that its laws are annotated with.

    draw(n: Unit, p: Parameters) -> Unit; start(n: normals, p, ...) -> State, None where it has no state; step(state,
    unit, n: normals, p, inputs ...) -> (State, reading), or the reading, or a named tuple of records; see: laws that
    return the inputs; says: in the order of their slots; after_reading: a law of the reading as it arrives, after a
    fault; lever: the datasheet's table with the place of its lens; late: whether its readings may be later than its
    datasheet says; phase: of its clock, in epochs.
    """

    name: str  # of its datasheet: in scenarios, dispersions, records and the names of its noise
    sheet: type[SensorSheet]
    says: tuple[Output, ...]
    draw: Callable[..., Any]
    start: Callable[..., Any] | None
    step: Callable[..., Any]
    see: tuple[Callable[..., Any], ...]
    channels: Channels
    phase: int = 0
    late: bool = False
    lever: str = ""
    after_reading: Callable[..., Any] | None = None
    wanted: Callable[[onboard.Wishes, Any, float], Any] = onboard.as_filed
    readings: Callable[[onboard.Wishes], int] | None = None  # how many of `says` it gives; None: all
    coefficients: Callable[[Any, Carrier], Any] = lambda sheet, _: sheet.parameters()

    @property
    def unit(self) -> Any:
        """The record of what differs from unit to unit; as it is drawn, a normal a field."""
        return get_type_hints(self.draw)["return"]

    @property
    def parameters(self) -> Any:
        """The record of its coefficients."""
        return get_type_hints(self.draw)["p"]

    @property
    def state(self) -> Any:
        """The record of its state; None where it has none."""
        return get_type_hints(self.start)["return"] if self.start else None

    @property
    def begun(self) -> Any:
        """The record of the normals that its state starts from; None where it needs none."""
        return get_type_hints(self.start).get("n") if self.start else None

    @property
    def normals(self) -> Any:
        """The record of the normals of one reading."""
        return get_type_hints(self.step)["n"]

    @property
    def on_epochs(self) -> bool:
        """Whether it reads by a clock of epochs; the inertial unit reads at the end of each of its periods."""
        return self.says[0].kind != Sensor.IMU


_table: list[SensorRow] = [
    SensorRow(
        "gps_receiver", GpsReceiverSheet,
        (Output(Sensor.GPS_POSITION, reads(
            GpsReceiverReading, ("pos_n_m", "pos_e_m", "pos_d_m"),
            ("horizontal_variance_m2", "horizontal_variance_m2", "vertical_variance_m2"))),
         Output(Sensor.GPS_VELOCITY, reads(
             GpsReceiverReading, ("vel_n_m_s", "vel_e_m_s", "vel_d_m_s"), ("speed_variance_m2_s2",) * 3))),
        draw_gps_receiver, start_gps_receiver, step_gps_receiver, (views.see_motion,), Channels(110, 175, 150),
        phase=1, late=True, wanted=onboard.receiver_sheet, readings=onboard.receiver_readings,
    ),
    SensorRow(
        "barometer", BarometerSheet, (Output(Sensor.BARO, reads(BarometerReading, ("alt_m",))),),
        draw_barometer, start_barometer, step_barometer, (views.see_altitude,), Channels(136, 192, 156), phase=1,
        coefficients=lambda sheet, on: sheet.parameters(on.rotor.radius_m, on.vehicle.air_density_kg_m3),
    ),
    SensorRow(
        "magnetometer", MagnetometerSheet,
        (Output(Sensor.MAG, reads(MagnetometerReading, ("mag_x_gauss", "mag_y_gauss", "mag_z_gauss"))),),
        draw_magnetometer, None, read_magnetometer, (views.see_power,), Channels(138, 196, 159),
        coefficients=lambda sheet, on: sheet.parameters(on.field),
    ),
    SensorRow(
        "range_sensor", RangeSensorSheet, (Output(Sensor.RANGE, reads(RangeSensorReading, ("range_m",))),),
        draw_range_sensor, start_range_sensor, step_range_sensor, (views.see_beam,), Channels(130, 190, 162),
        phase=2, late=True, lever="lens", wanted=onboard.range_sheet,
    ),
    SensorRow(
        "flow_camera", FlowCameraSheet, (Output(Sensor.FLOW_RATE, None),),
        draw_flow_camera, start_flow_camera, views.look, (views.mean_rates, views.see_flow),
        Channels(120, 183, 165), phase=1, late=True, lever="lens", wanted=onboard.camera_sheet,
    ),
    SensorRow(
        "pad_camera", PadCameraSheet,
        (Output(Sensor.PAD, reads(PadCameraReading, ("tan_forward", "tan_right", "distance_m"),
                               ("forward_variance", "right_variance", "distance_variance_m2"))),),
        draw_pad_camera, None, views.look_for_pad, (views.see_pad,), Channels(142, 205, 168),
        phase=3, late=True, lever="lens", after_reading=views.note_seen, wanted=onboard.pad_sheet,
    ),
    SensorRow(
        "skid_switch", SkidSwitchSheet, (Output(Sensor.LANDED, reads(SkidSwitchReading, ("landed",))),),
        draw_skid_switch, start_skid_switch, views.touch, (views.see_load,), Channels(148, 208, 171),
        coefficients=lambda sheet, on: sheet.parameters(on.vehicle.mass_kg * on.vehicle.gravity_m_s2),
    ),
    SensorRow(
        "inertial", InertialSheet,
        (Output(Sensor.IMU, reads(InertialReading, (
            "gyro_x_rad_s", "gyro_y_rad_s", "gyro_z_rad_s", "accel_x_m_s2", "accel_y_m_s2", "accel_z_m_s2"))),),
        draw_inertial, start_inertial, views.feel_motion, (), Channels(40, 160, 174), wanted=onboard.inertial_sheet,
        coefficients=lambda sheet, on: sheet.parameters(on.rotor.speed_rad_s, BLADES),
    ),
]  # fmt: skip
_fixed: list[tuple[SensorRow, ...]] = []


def carry(sensor: SensorRow) -> None:
    """Add a sensor to every vehicle, read after the others; before anything of the simulator is imported."""
    if _fixed:
        raise RuntimeError(f"{sensor.name}: what vehicles carry is known once the simulator is imported")
    says = [output.say for output in sensor.says]
    laws = [law for law in (sensor.draw, sensor.start, sensor.step, *sensor.see, sensor.after_reading, *says) if law]
    depends_also(__name__, laws, f"{sensor.name} {sensor.channels} {sensor.late} {sensor.lever}")
    _table.append(sensor)


def sensor_rows() -> tuple[SensorRow, ...]:
    """Every carried sensor, in the order in which those that are due in one epoch read."""
    if not _fixed:
        _fixed.append(tuple(_table))
    return _fixed[0]
