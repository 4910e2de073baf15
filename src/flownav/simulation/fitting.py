"""From a scenario to the sensors that feed the navigator: datasheets, clocks, and what the navigator is told."""

from __future__ import annotations

import math
from typing import NamedTuple, TypeVar

import numpy as np

from flownav.measurement import Array, Sensor
from flownav.navigation.packed import pack
from flownav.navigation.settings_of import Told, settings_of
from flownav.navigation.told import FROM_MAG, Equipment
from flownav.sensors.barometer_sheet import load_barometer_sheet
from flownav.sensors.beam import LEVEL
from flownav.sensors.datasheet import FlowSensor
from flownav.sensors.flow import FlowParameters
from flownav.sensors.flow_camera_sheet import load_flow_camera_sheet
from flownav.sensors.gps_receiver_sheet import GpsReceiverSheet, load_gps_receiver_sheet
from flownav.sensors.identified import needs_lag_states
from flownav.sensors.inertial_sheet import InertialSheet, load_inertial_sheet
from flownav.sensors.magnetometer_sheet import MagneticField, load_magnetometer_sheet
from flownav.sensors.pad_camera_sheet import AngleNoise, DistanceNoise, PadCameraSheet, load_pad_camera_sheet
from flownav.sensors.range_sensor_sheet import load_range_sensor_sheet
from flownav.sensors.sheet import Lever, SensorSheet
from flownav.sensors.sheets import SensorSheets
from flownav.sensors.skid_switch_sheet import load_skid_switch_sheet
from flownav.simulation.navigating import Timetable
from flownav.simulation.onboard import EPOCH_S, PHYSICS_PERIOD_S, Clock, Onboard, Place
from flownav.simulation.scenario import Scenario
from flownav.simulation.schedule import Schedule, Timing, schedule_of
from flownav.vehicle.kinds import AnyVehicle, rotor_facts

Sheet = TypeVar("Sheet", bound=SensorSheet)
BLADES = 2.0  # of the main rotor
EPOCH_HZ = 1.0 / EPOCH_S
STEPS_AN_EPOCH = round(EPOCH_S / PHYSICS_PERIOD_S)
START_WAIT_S = 10.0


class Fitted(NamedTuple):
    """What flies: sensors, their timetable, the navigator's settings (and packed), its equipment, the sheets.

    ages_s: how old the navigator takes a reading to be on arrival, by `measurement.Sensor`.
    """

    onboard: Onboard
    schedule: Schedule
    told: Told
    equipment: Equipment
    settings: Array
    sheets: SensorSheets
    timing: dict[Sensor, Timing]
    ages_s: Array


def fitted(scenario: Scenario, flow_sensor: FlowSensor, vehicle: AnyVehicle, epochs: int) -> Fitted:
    """The vehicle's sensors as a scenario wants them. InputError as the sheets' loaders say."""
    sheets = sheets_of(scenario, flow_sensor, vehicle)
    onboard = onboard_of(scenario, sheets, scenario.flow.parameters(flow_sensor), vehicle)
    timing = timing_of(sheets, flow_sensor)
    schedule = schedule_of(epochs, onboard, timing)
    rotor_hz = rotor_facts(vehicle).speed_rad_s / (2.0 * math.pi)
    told = settings_of(flow_sensor, sheets, flow_noise_stated=True, rotor_hz=(rotor_hz, BLADES * rotor_hz))
    declination_rad = math.radians(sheets.magnetic_field.declination_deg)
    equipment = Equipment(True, False, FROM_MAG, True, START_WAIT_S, declination_rad)
    settings = packed(told, equipment)
    return Fitted(onboard, schedule, told, equipment, settings, sheets, timing, ages_of(timing))


def packed(told: Told, equipment: Equipment) -> Array:
    """What the navigator is told, as its kernels take it."""
    sigma = told.settings.start_sigma(has_heading=True, compass=True)
    return pack(told.settings.settings(equipment, told.noise), sigma)


def ages_of(timing: dict[Sensor, Timing]) -> Array:
    """How old a reading is on arrival [s], by `measurement.Sensor`."""
    ages_s = np.zeros(max(Sensor) + 1)
    for kind, late in timing.items():
        ages_s[kind] = late.lag_s + late.latency_s
    return ages_s


def refitted(
    carried: Fitted, epochs: int, *, told: Told | None = None, onboard: Onboard | None = None,
    stated: dict[Sensor, Timing] | None = None,
) -> Fitted:  # fmt: skip
    """The same vehicle whose navigator is told something else, or that carries something else; what is None stays.

    stated: how old readings are said to be; how old they are stays.
    """
    told, onboard, stated = told or carried.told, onboard or carried.onboard, stated or carried.timing
    return carried._replace(
        onboard=onboard,
        schedule=schedule_of(epochs, onboard, carried.timing, stated),
        told=told,
        settings=packed(told, carried.equipment),
        ages_s=ages_of(stated),
    )


# -- datasheets -----------------------------------------------------------------------------------------------
def sheets_of(scenario: Scenario, flow_sensor: FlowSensor, vehicle: AnyVehicle) -> SensorSheets:
    """Every sheet, the scenario's own figures above the files', at rates that the simulator's clock has."""
    files = scenario.sensors
    lens_down_m = vehicle.cg_above_skid_m - scenario.vehicle.lens_above_skid_m
    camera, ranger = load_flow_camera_sheet(files.flow_camera), load_range_sensor_sheet(files.range_sensor)
    baro, mag = load_barometer_sheet(files.barometer), load_magnetometer_sheet(files.magnetometer)
    sonar = scenario.rangefinder
    told_of_sonar = {name: getattr(sonar, name) for name in sonar.model_fields_set}
    ranger = ranger.model_copy(update=told_of_sonar | {"lens": at_height(ranger.lens, lens_down_m)})
    return SensorSheets.model_construct(
        inertial=inertial_sheet(load_inertial_sheet(files.inertial)),
        gps_receiver=on_clock(receiver_sheet(scenario, load_gps_receiver_sheet(files.gps_receiver))),
        flow_camera=on_clock(camera.model_copy(update={"lens": at_height(camera.lens, lens_down_m)})),
        flow_sensor=flow_sensor,
        range_sensor=on_clock(ranger),
        barometer=on_clock(baro),
        magnetometer=on_clock(mag),
        magnetic_field=MagneticField(),
        pad_camera=pad_sheet(scenario, load_pad_camera_sheet(files.pad_camera), lens_down_m),
        skid_switch=on_clock(load_skid_switch_sheet(files.skid_switch)),
    )


def at_height(lens: Lever, down_m: float) -> Lever:
    """A lens where the vehicle's file puts it."""
    return lens.model_copy(update={"down_m": down_m})


def on_clock(sheet: Sheet) -> Sheet:
    """The sheet at the nearest rate of which an epoch's is a multiple."""
    return sheet.model_copy(update={"rate_hz": EPOCH_HZ / every(sheet)})


def every(sheet: SensorSheet) -> int:
    """How many epochs lie between two readings."""
    return max(1, round(EPOCH_HZ / float(sheet.rate_hz)))


def inertial_sheet(sheet: InertialSheet) -> InertialSheet:
    """The IMU at the lowest rate, not below its own, whose period is so many physics steps that an epoch has."""
    steps = [n for n in range(1, STEPS_AN_EPOCH + 1) if STEPS_AN_EPOCH % n == 0]
    fast = [n for n in steps if 1.0 / (n * PHYSICS_PERIOD_S) >= float(sheet.rate_hz) - 1e-6]
    return sheet.model_copy(update={"rate_hz": 1.0 / (max(fast or steps[:1]) * PHYSICS_PERIOD_S)})


def receiver_sheet(scenario: Scenario, sheet: GpsReceiverSheet) -> GpsReceiverSheet:
    """The receiver: the paper's white noise at 50 Hz, or the sheet with what the scenario says of its errors."""
    gps = scenario.gps
    if gps.model == "white":
        white = dict.fromkeys(("slow_sigma_m", "slow_sigma_down_m", "fast_sigma_m", "fast_sigma_down_m", "spread"), 0.0)
        white |= {"white_sigma_m": gps.white_sigma_m, "white_sigma_down_m": gps.white_sigma_m, "quantum_m": 0.0}
        return sheet.model_copy(
            update={
                "rate_hz": EPOCH_HZ,
                "latency_s": 0.0,
                "jitter_s": 0.0,
                "position": sheet.position.model_copy(update=white),
                "antenna": Lever(),
                "stated_spread": 0.0,
                "outage": type(sheet.outage)(),
            }
        )
    shared = {name: getattr(gps, name) for name in gps.model_fields_set if name in type(sheet.position).model_fields}
    return sheet.model_copy(update={"position": sheet.position.model_copy(update=shared)})


def pad_sheet(scenario: Scenario, sheet: PadCameraSheet, lens_down_m: float) -> PadCameraSheet | None:
    """The pad's camera, where the scenario has one."""
    fix = scenario.pad_fix
    if fix is None:
        return None
    stated = fix.model_fields_set
    update: dict[str, object] = {
        name: getattr(fix, name) for name in ("min_height_m", "max_height_m", "half_view_deg") if name in stated
    }
    if "half_view_deg" in stated:
        update["half_view_right_deg"] = None
    if "angle_sigma_rad" in stated:
        update["angle"] = AngleNoise(floor_mrad=1e3 * fix.angle_sigma_rad)
    if "distance_sigma" in stated:
        update["distance"] = DistanceNoise(floor_percent=100.0 * fix.distance_sigma)
    return on_clock(sheet.model_copy(update=update | {"lens": at_height(sheet.lens, lens_down_m)}))


# -- equations' parameters --------------------------------------------------------------------------------------
def onboard_of(scenario: Scenario, sheets: SensorSheets, flow: FlowParameters, vehicle: AnyVehicle) -> Onboard:
    """Coefficients, clocks and places."""
    receiver, camera, ranger = sheets.gps_receiver, sheets.flow_camera, sheets.range_sensor
    baro, mag, pad, skid = sheets.barometer, sheets.magnetometer, sheets.pad_camera, sheets.skid_switch
    assert receiver is not None
    assert camera is not None
    assert ranger is not None
    assert baro is not None
    assert mag is not None
    assert skid is not None
    pad_camera = pad if pad is not None else load_pad_camera_sheet()
    rotor = rotor_facts(vehicle)
    return Onboard(
        inertial=sheets.inertial.parameters(rotor.speed_rad_s, BLADES),
        inertial_steps=round(1.0 / (float(sheets.inertial.rate_hz) * PHYSICS_PERIOD_S)),
        receiver=receiver.parameters(),
        receiver_clock=clock_of(receiver, 1),
        receiver_offers_velocity=0 if scenario.gps.model == "white" else 1,
        flow=flow._replace(sonar_floor_m=0.0),
        camera=camera.parameters(),
        camera_clock=clock_of(camera, 1),
        camera_place=place_of(camera.lens),
        ranger=ranger.parameters(),
        range_clock=clock_of(ranger, 2),
        range_place=place_of(ranger.lens),
        baro=baro.parameters(rotor.radius_m, vehicle.air_density_kg_m3),
        baro_clock=clock_of(baro, 1),
        mag=mag.parameters(sheets.magnetic_field),
        mag_clock=clock_of(mag, 0),
        pad=pad_camera.parameters(),
        pad_clock=clock_of(pad_camera, 3)._replace(fitted=0 if pad is None else 1),
        pad_place=place_of(pad_camera.lens),
        pad_seen=np.zeros(0),
        skid=skid.parameters(vehicle.mass_kg * vehicle.gravity_m_s2),
        skid_clock=clock_of(skid, 0),
        ground=LEVEL,
        rotor_above_cg_m=rotor.above_cg_m,
        texture_everywhere=1.0 if scenario.sensors.texture == "everywhere" else 0.0,
        pad_half_size_m=0.5 * scenario.pad.size_m,
    )


def clock_of(sheet: SensorSheet, phase: int) -> Clock:
    """A fitted sensor's clock; phases differ, as no two sensors start together."""
    period = every(sheet)
    return Clock(1, period, phase % period)


def place_of(lens: Lever) -> Place:
    """A lever in numbers."""
    return Place(float(lens.forward_m), float(lens.right_m), float(lens.down_m))


def timing_of(sheets: SensorSheets, flow_sensor: FlowSensor) -> dict[Sensor, Timing]:
    """How old each sensor's readings are.

    The flow sensor's own lag is what its file says of a slow signal, b/c, unless the navigator carries its dynamics as
    states: then a reading is of its own instant.
    """
    found: dict[Sensor, Timing] = {Sensor.IMU: Timing(0.0, float(sheets.inertial.latency_s), 0.0)}
    lag_s = 0.0 if needs_lag_states(flow_sensor) else flow_sensor.dynamics.delay_s
    for sensor, sheet in (
        (Sensor.GPS_POSITION, sheets.gps_receiver),
        (Sensor.GPS_VELOCITY, sheets.gps_receiver),
        (Sensor.FLOW_RATE, sheets.flow_camera),
        (Sensor.RANGE, sheets.range_sensor),
        (Sensor.BARO, sheets.barometer),
        (Sensor.MAG, sheets.magnetometer),
        (Sensor.PAD, sheets.pad_camera),
        (Sensor.LANDED, sheets.skid_switch),
    ):
        if sheet is not None:
            lag = lag_s if sensor == Sensor.FLOW_RATE else 0.0
            found[sensor] = Timing(lag, float(sheet.latency_s), float(sheet.jitter_s))
    return found


def timetable_of(schedule: Schedule) -> Timetable:
    """The schedule as kernels take it."""
    return Timetable(
        schedule.t_s, schedule.sensor, schedule.slot, schedule.epoch, schedule.slots, schedule.horizon_epochs,
        len(schedule.t_s),
    )  # fmt: skip
