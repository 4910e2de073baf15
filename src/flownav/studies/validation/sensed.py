"""The log of simulated sensors on a path: every stream at the log's own instants, of the log's own kinds.

A reading that the log holds at t is taken on the path at t less the sensor's latency; gaps of the log stay gaps. The
equations are those that the simulator flies (`flownav.sensors`), called reading by reading.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from flownav.core.frames import Rotation as Matrix
from flownav.core.frames import rotation_from_quaternion
from flownav.core.measurement import Array, Sensor, Stream
from flownav.logs.log import Log
from flownav.sensors.barometer import BarometerTruth
from flownav.sensors.flow import PERIOD_S as FLOW_STEP_S
from flownav.sensors.flow import FlowParameters
from flownav.sensors.flow_camera import FlowCameraTruth, step_flow_camera
from flownav.sensors.geometry import LEVEL, BeamHit, beam_distance
from flownav.sensors.gps_ins import attitude_with_error
from flownav.sensors.gps_receiver import GpsReceiverTruth
from flownav.sensors.inertial import ImuReading, InertialParameters, step_inertial
from flownav.sensors.magnetometer import MagneticField, declination_rad
from flownav.sensors.processes import gauss_markov_coefficients
from flownav.sensors.settings import FlowSettings, GpsInsSettings
from flownav.sensors.sheet import SensorSheet
from flownav.sensors.sheets import SensorSheets
from flownav.studies.validation.drawn import (
    AssumedVehicle,
    Flight,
    Seen,
    drawn_sheets,
    kept_of,
    rate_hz,
    readings,
    sheets_of,
)
from flownav.studies.validation.path import FlownPath

COARSEST_UNSEEN_M = 0.05  # steps of a recorded position below it are the receiver's, not the log's


class Scene(NamedTuple):
    """Who senses what: the log whose instants serve, the path, this flight's sheets and draws, the vehicle."""

    log: Log
    path: FlownPath
    sheets: SensorSheets
    flight: Flight
    vehicle: AssumedVehicle

    def instants_s(self, stream: Stream, sheet: SensorSheet, name: str) -> Array:
        """When each reading of a stream was taken: its stamp less latency and jitter."""
        even = 2.0 * np.mod(np.abs(self.flight.normals(f"{name} jitter", len(stream), 1)[:, 0]), 1.0) - 1.0
        return np.asarray(stream.t_s - float(sheet.latency_s) - float(sheet.jitter_s) * even)


def simulated_log(log: Log, path: FlownPath, flight: Flight, vehicle: AssumedVehicle) -> Log:
    """The log of a flight of the same path with simulated sensors, drawn anew."""
    base = sheets_of(log, vehicle).model_copy(update={"magnetic_field": field_of(log)})
    scene = Scene(log, path, drawn_sheets(base, flight), flight, vehicle)
    streams: dict[Sensor, Stream] = {}
    for sensor in log.streams:
        if sensor in SENSED:
            for stream in SENSED[sensor](scene):
                streams[stream.sensor] = stream
    ordered = {sensor: streams[sensor] for sensor in log.streams if sensor in streams}
    notes = (*log.notes, f"simulated on the path of {log.path.name}, seed {flight.seed}, flight {flight.number}")
    return replace(log, streams=ordered, truth=None, heading_truth=None, autopilot=None, inputs={}, notes=notes)


# -- one sensor each ------------------------------------------------------------------------------------------
def _inertial(scene: Scene) -> list[Stream]:
    """Means over the IMU's own period; the log holds every n-th of them."""
    stream, sheet = scene.log.streams[Sensor.IMU], scene.sheets.inertial
    kept, period_s = kept_of(stream), sheet.period_s
    vehicle = scene.vehicle
    off = vehicle.rotor_speed_spread * (2.0 * scene.flight.uniform("rotor speed") - 1.0)
    p = every_nth(sheet.parameters(vehicle.rotor_speed_rad_s * (1.0 + off), vehicle.blades), kept)
    t_s = scene.instants_s(stream, sheet, "inertial")
    motion = np.column_stack([scene.path.turn_rad_s(t_s, period_s), scene.path.force_m_s2(t_s, period_s)])
    seen = [{ImuReading: ImuReading(*truth)} for truth in motion.tolist()]
    values = [read[:6] for read in readings(scene.flight, "inertial", "inertial", p, seen, step_inertial)]
    return [Stream.of(Sensor.IMU, stream.t_s, np.array(values))]


def every_nth(p: InertialParameters, n: int) -> InertialParameters:
    """Coefficients of a unit of whose readings every n-th is kept: biases walk and tones turn n periods a step."""
    rev, blade = (complex(c, s) ** n for c, s in ((p.rev_cosine, p.rev_sine), (p.blade_cosine, p.blade_sine)))
    return p._replace(
        gyro_walk_rad_s=p.gyro_walk_rad_s * math.sqrt(n), accel_walk_m_s2=p.accel_walk_m_s2 * math.sqrt(n),
        rev_cosine=rev.real, rev_sine=rev.imag, rev_turn_rad=n * p.rev_turn_rad,
        blade_cosine=blade.real, blade_sine=blade.imag, blade_turn_rad=n * p.blade_turn_rad,
    )  # fmt: skip


def _receiver(scene: Scene) -> list[Stream]:
    """Position and velocity; positions in the steps of the log, where those are coarser than the receiver's."""
    stream, sheet = scene.log.streams[Sensor.GPS_POSITION], scene.sheets.gps_receiver
    assert sheet is not None
    t_s = scene.instants_s(stream, sheet, "receiver")
    motion = np.column_stack([
        scene.path.position_m(t_s), scene.path.velocity_m_s(t_s), scene.path.turn_rad_s(t_s, sheet.period_s)
    ]).tolist()  # fmt: skip
    turned = rotations_of(scene.path.attitude(t_s))
    seen = [
        {GpsReceiverTruth: GpsReceiverTruth(*truth), Matrix: rotation}
        for truth, rotation in zip(motion, turned, strict=True)
    ]
    fixes = readings(scene.flight, "gps_receiver", "receiver", sheet.parameters(), seen)
    values = np.array([(*read[:6], read.arrived) for read in fixes])
    arrived = values[:, 6] > 0.5
    position = stepped(values[:, :3], stream.value)[arrived]
    found = [Stream.of(Sensor.GPS_POSITION, stream.t_s[arrived], position)]
    if Sensor.GPS_VELOCITY in scene.log.streams:
        found.insert(0, Stream.of(Sensor.GPS_VELOCITY, stream.t_s[arrived], values[arrived, 3:6]))
    return found


def stepped(position: Array, recorded: Array) -> Array:
    """Positions (n, 3) in whole steps of each axis of a recording."""
    found = position.copy()
    for axis in range(3):
        step_m = step_of(recorded[:, axis])
        if step_m >= COARSEST_UNSEEN_M:
            found[:, axis] = np.rint(position[:, axis] / step_m) * step_m
    return found


def step_of(values: Array) -> float:
    """The smallest difference between recorded values [their unit], to a centimetre; 0 of a constant."""
    steps = np.diff(np.unique(np.round(values, 2)))
    steps = steps[steps > 0.015]  # rounding splits a level in two
    return float(np.min(steps)) if len(steps) else 0.0


def _camera(scene: Scene) -> list[Stream]:
    """Angular flow: the lens's velocity through the identified dynamics, then the camera."""
    stream, sheet, file = scene.log.streams[Sensor.FLOW_RATE], scene.sheets.flow_camera, scene.sheets.flow_sensor
    assert sheet is not None
    assert file is not None
    dynamics = FlowSettings(shake=False).parameters(file)._replace(sonar_floor_m=0.0)
    t_s = scene.instants_s(stream, sheet, "camera")
    attitude = scene.path.attitude(t_s)
    cosine = attitude.as_matrix()[:, 2, 2]
    height_m = -scene.path.position_m(t_s)[:, 2]
    speed = seen_velocity(scene.path, dynamics, t_s)
    rates = scene.path.turn_rad_s(t_s, float(sheet.exposure_s))
    truths = np.column_stack([speed, rates, height_m / cosine, height_m, cosine, np.ones(len(t_s))]).tolist()
    seen = [{FlowCameraTruth: FlowCameraTruth(*truth), FlowParameters: dynamics} for truth in truths]
    values = np.array(readings(scene.flight, "flow_camera", "camera", sheet.parameters(), seen, step_flow_camera))
    arrived = values[:, 5] > 0.5
    value = values[:, :4].copy()
    value[~np.isfinite(stream.value)] = np.nan  # a sensor without gyro has none here either
    return [Stream.of(Sensor.FLOW_RATE, stream.t_s[arrived], value[arrived], quality=values[arrived, 4])]


def seen_velocity(path: FlownPath, dynamics: FlowParameters, t_s: Array) -> Array:
    """Body velocity (n, 3) as the identified dynamics make it, from rest at the path's start."""
    grid_s = np.arange(path.span_s[0], path.span_s[1], FLOW_STEP_S)
    velocity = path.body_velocity_m_s(grid_s)
    d = dynamics
    # x1 of the two states: the hold's transfer function from u to x1
    numerator = [0.0, d.lag_g1, d.lag_f12 * d.lag_g2 - d.lag_f22 * d.lag_g1]
    denominator = [1.0, -(d.lag_f11 + d.lag_f22), d.lag_f11 * d.lag_f22 - d.lag_f12 * d.lag_f21]
    seen = d.gain * lfilter(numerator, denominator, velocity, axis=0)
    return np.column_stack([np.interp(t_s, grid_s, column) for column in seen.T])


def _ranger(scene: Scene) -> list[Stream]:
    """Distances along body z to level ground; readings without an echo are not logged, as in the CSV folders."""
    stream, sheet = scene.log.streams[Sensor.RANGE], scene.sheets.range_sensor
    assert sheet is not None
    seen = [{BeamHit: hit} for hit in hits_of(scene.path, scene.instants_s(stream, sheet, "ranger"))]
    values = np.array(readings(scene.flight, "range_sensor", "ranger", sheet.parameters(), seen))
    valid = (values[:, 1] > 0.0) & (values[:, 2] > 0.5)
    return [Stream.of(Sensor.RANGE, stream.t_s[valid], values[valid, :1])]


def hits_of(path: FlownPath, t_s: Array) -> list[BeamHit]:
    """Where the beam meets the ground at each time."""
    places = path.position_m(t_s).tolist()
    turned = rotations_of(path.attitude(t_s))
    return [beam_distance(n, e, -d, rotation, LEVEL) for (n, e, d), rotation in zip(places, turned, strict=True)]


def _barometer(scene: Scene) -> list[Stream]:
    """Altitude over the place where the log begins."""
    stream, sheet = scene.log.streams[Sensor.BARO], scene.sheets.barometer
    assert sheet is not None
    p = sheet.parameters(scene.vehicle.rotor_radius_m, AIR_DENSITY_KG_M3)
    t_s = scene.instants_s(stream, sheet, "barometer")
    height_m = -scene.path.position_m(t_s)[:, 2]
    thrust_n = scene.vehicle.thrust_n
    seen = [{BarometerTruth: BarometerTruth(h - height_m[0], h, thrust_n)} for h in height_m.tolist()]
    values = [read.alt_m for read in readings(scene.flight, "barometer", "barometer", p, seen)]
    return [Stream.of(Sensor.BARO, stream.t_s, np.array(values))]


def _magnetometer(scene: Scene) -> list[Stream]:
    """The place's field as the log's compass has it."""
    stream, sheet = scene.log.streams[Sensor.MAG], scene.sheets.magnetometer
    assert sheet is not None
    p = sheet.parameters(scene.sheets.magnetic_field)
    t_s = scene.instants_s(stream, sheet, "magnetometer")
    power_w = scene.vehicle.hover_power_w
    seen: list[Seen] = [{Matrix: rotation, float: power_w} for rotation in rotations_of(scene.path.attitude(t_s))]
    values = [read[:3] for read in readings(scene.flight, "magnetometer", "magnetometer", p, seen)]
    return [Stream.of(Sensor.MAG, stream.t_s, np.array(values))]


def _attitude(scene: Scene) -> list[Stream]:
    """An autopilot's attitude, with the errors of the paper's GPS/INS: tilt and heading, Gauss-Markov."""
    stream, settings = scene.log.streams[Sensor.ATTITUDE], GpsInsSettings(model="midg")
    normals = scene.flight.normals("attitude", len(stream), 3)
    errors = []
    for axis, (sigma_deg, tau_s) in enumerate((
        (settings.tilt_sigma_deg, settings.tilt_tau_s),
        (settings.tilt_sigma_deg, settings.tilt_tau_s),
        (settings.heading_sigma_deg, settings.heading_tau_s),
    )):  # fmt: skip
        decay, drive = gauss_markov_coefficients(float(tau_s), 1.0 / rate_hz(stream))
        pushed = drive * normals[:, axis]
        pushed[0] = normals[0, axis]
        errors.append(math.radians(float(sigma_deg)) * lfilter([1.0], [1.0, -decay], pushed))
    truth = scene.path.attitude(stream.t_s).as_quat()[:, [3, 0, 1, 2]].tolist()
    values = [
        attitude_with_error((w, x, y, z), *error)
        for (w, x, y, z), error in zip(truth, np.column_stack(errors).tolist(), strict=True)
    ]
    return [Stream.of(Sensor.ATTITUDE, stream.t_s, np.array(values))]


# -- what they share ------------------------------------------------------------------------------------------
AIR_DENSITY_KG_M3 = 1.225
SENSED: dict[Sensor, Callable[[Scene], list[Stream]]] = {
    Sensor.IMU: _inertial,
    Sensor.GPS_POSITION: _receiver,
    Sensor.FLOW_RATE: _camera,
    Sensor.RANGE: _ranger,
    Sensor.BARO: _barometer,
    Sensor.MAG: _magnetometer,
    Sensor.ATTITUDE: _attitude,
}


def rotations_of(attitude: Rotation) -> list[Matrix]:
    """R_EB of each attitude as the equations take it."""
    return [rotation_from_quaternion(w, x, y, z) for x, y, z, w in attitude.as_quat().tolist()]


def field_of(log: Log) -> MagneticField:
    """The place's field: declination of the World Magnetic Model, size and dip as the log's compass shows them."""
    east_deg = math.degrees(declination_rad(log.origin_deg_m))
    if Sensor.MAG not in log.streams or Sensor.ATTITUDE not in log.streams:
        return MagneticField(declination_deg=east_deg)
    compass, attitude = log.streams[Sensor.MAG], log.streams[Sensor.ATTITUDE]
    nearest = np.clip(np.searchsorted(attitude.t_s, compass.t_s), 0, len(attitude) - 1)
    earth = Rotation.from_quat(attitude.value[nearest][:, [1, 2, 3, 0]]).apply(compass.value)
    level, down = float(np.median(np.hypot(earth[:, 0], earth[:, 1]))), float(np.median(earth[:, 2]))
    return MagneticField(
        strength_gauss=math.hypot(level, down),
        declination_deg=east_deg,
        inclination_deg=math.degrees(math.atan2(down, level)),
    )
