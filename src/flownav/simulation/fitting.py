"""From a scenario to the sensors that feed the navigator: datasheets, clocks, and the navigator's settings.

**The timetable**, one for all flights of a scenario. Every reading has three times: the instant at which it was taken,
the instant that it describes as far as is known (`t_s`: its arrival less the age that the datasheet states; arrivals
are uneven, so this is off by the jitter), and the epoch in which the navigator takes it, a fixed horizon later.
Readings are taken in the order of `t_s`, as a live session's horizon releases them. The timetable is a scenario's, not
a flight's: only the values and whether they arrived differ from flight to flight.
"""

from __future__ import annotations

import math
from collections import Counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import create_model

from flownav.core.errors import InputError
from flownav.core.measurement import Array, Sensor
from flownav.navigation.kernel_settings import FROM_MAG, Equipment
from flownav.navigation.packed import pack
from flownav.navigation.settings_of import GivenSettings, settings_of
from flownav.sensors.datasheet import FlowSensor, needs_lag_states
from flownav.sensors.flow import FlowParameters
from flownav.sensors.magnetometer import MagneticField
from flownav.sensors.sheet import Lever, SensorSheet
from flownav.sensors.sheets import SensorSheets
from flownav.simulation.navigating import Timetable
from flownav.simulation.onboard import (
    ALWAYS,
    EPOCH_S,
    NEVER,
    PHYSICS_PERIOD_S,
    Clock,
    Fitting,
    Onboard,
    Place,
    clock_of,
)
from flownav.simulation.scenario import Scenario
from flownav.simulation.sensor_table import BLADES, Carrier, SensorRow
from flownav.simulation.truth import SENSOR_TABLE, Carried
from flownav.vehicle.kinds import AnyVehicle, rotor_facts

START_WAIT_S = 10.0  # the navigator's default start_wait_s


class Fitted(NamedTuple):
    """The equipment of a flight: sensors, their timetable, the navigator's settings (and packed), its equipment, the
    sheets.

    ages_s: how old the navigator takes a reading to be on arrival, by `measurement.Sensor`.
    """

    onboard: Onboard
    schedule: Timetable
    given: GivenSettings
    equipment: Equipment
    settings: Array
    sheets: SensorSheets
    timing: dict[Sensor, Timing]
    ages_s: Array


def fitted(scenario: Scenario, flow_sensor: FlowSensor, vehicle: AnyVehicle, epochs: int) -> Fitted:
    """The vehicle's sensors as a scenario wants them. InputError as the sheets' loaders."""
    sheets = sheets_of(scenario, flow_sensor, vehicle)
    onboard = onboard_of(scenario, sheets, scenario.flow.parameters(flow_sensor), vehicle)
    timing = timing_of(sheets, flow_sensor)
    schedule = schedule_of(epochs, onboard, timing)
    rotor_hz = rotor_facts(vehicle).speed_rad_s / (2.0 * math.pi)
    given = settings_of(flow_sensor, sheets, flow_noise_stated=True, rotor_hz=(rotor_hz, BLADES * rotor_hz))
    declination_rad = math.radians(sheets.magnetic_field.declination_deg)
    equipment = Equipment(True, False, FROM_MAG, True, START_WAIT_S, declination_rad)
    settings = packed(given, equipment)
    return Fitted(onboard, schedule, given, equipment, settings, sheets, timing, ages_of(timing))


def packed(given: GivenSettings, equipment: Equipment) -> Array:
    """The navigator's settings, as its kernels take them."""
    sigma = given.settings.start_sigma(has_heading=True, compass=True)
    return pack(given.settings.settings(equipment, given.noise), sigma)


def ages_of(timing: dict[Sensor, Timing]) -> Array:
    """How old a reading is on arrival [s], by `measurement.Sensor`."""
    ages_s = np.zeros(max(Sensor) + 1)
    for kind, late in timing.items():
        ages_s[kind] = late.lag_s + late.latency_s
    return ages_s


def refitted(
    fitted_: Fitted, epochs: int, *, given: GivenSettings | None = None, onboard: Onboard | None = None,
    stated: dict[Sensor, Timing] | None = None,
) -> Fitted:  # fmt: skip
    """The same vehicle with other settings of its navigator, or other sensors; what is None stays.

    stated: ages of readings as the navigator takes them; the true ages stay.
    """
    given, onboard, stated = given or fitted_.given, onboard or fitted_.onboard, stated or fitted_.timing
    return fitted_._replace(
        onboard=onboard,
        schedule=schedule_of(epochs, onboard, fitted_.timing, stated),
        given=given,
        settings=packed(given, fitted_.equipment),
        ages_s=ages_of(stated),
    )


# -- datasheets -----------------------------------------------------------------------------------------------
def sheets_of(scenario: Scenario, flow_sensor: FlowSensor, vehicle: AnyVehicle) -> SensorSheets:
    """Every sheet as the scenario wants it, where it names one or one ships. InputError as the sheets' loaders."""
    lens_down_m = vehicle.cg_above_skid_m - scenario.vehicle.lens_above_skid_m
    files = {one.name: getattr(scenario.sensors, one.name) for one in SENSOR_TABLE}
    sheets = {
        one.name: one.wanted(scenario, one.sheet.read(files[one.name]), lens_down_m)
        for one in SENSOR_TABLE
        if files[one.name] or one.sheet.shipped_file
    }
    return TableSheets.model_construct(**sheets, flow_sensor=flow_sensor, magnetic_field=MagneticField())


def sheets_of_table() -> type[SensorSheets]:
    """The model of all sheets: those that the navigator may use, and the other sensors that are carried."""
    others: dict[str, Any] = {
        one.name: (one.sheet | None, None) for one in SENSOR_TABLE if one.name not in SensorSheets.model_fields
    }
    return create_model("TableSheets", __base__=SensorSheets, **others) if others else SensorSheets


# -- equations' parameters --------------------------------------------------------------------------------------
def onboard_of(scenario: Scenario, sheets: SensorSheets, flow: FlowParameters, vehicle: AnyVehicle) -> Onboard:
    """Coefficients, clocks and places."""
    rotor = rotor_facts(vehicle)
    on = Carrier(vehicle, rotor, sheets.magnetic_field)
    return Onboard(
        carried=Carried(*(fitting_of(scenario, one, getattr(sheets, one.name), on) for one in SENSOR_TABLE)),
        inertial_steps=round(1.0 / (float(sheets.inertial.rate_hz) * PHYSICS_PERIOD_S)),
        flow=flow._replace(sonar_floor_m=0.0, sonar_lag_s=0.0, rotation_leak=0.0),
        pad_seen=np.zeros(0),
        rotor_above_cg_m=rotor.above_cg_m,
        texture_everywhere=1.0 if scenario.sensors.texture == "everywhere" else 0.0,
        pad_half_size_m=0.5 * scenario.pad.size_m,
    )


def fitting_of(scenario: Scenario, one: SensorRow, sheet: SensorSheet | None, on: Carrier) -> Fitting:
    """One sensor by its sheet; where the vehicle has none, zeros and a clock that never comes."""
    if sheet is None:
        nothing = one.parameters(*[0.0] * len(one.parameters._fields))
        return Fitting(nothing, NEVER, Place(0.0, 0.0, 0.0) if one.lever else None)
    readings = len(one.says) if one.readings is None else one.readings(scenario)
    clock = clock_of(sheet, one.phase, readings) if one.on_epochs else ALWAYS
    return Fitting(one.coefficients(sheet, on), clock, place_of(getattr(sheet, one.lever)) if one.lever else None)


def place_of(lens: Lever) -> Place:
    """A lever in numbers."""
    return Place(float(lens.forward_m), float(lens.right_m), float(lens.down_m))


def timing_of(sheets: SensorSheets, flow_sensor: FlowSensor) -> dict[Sensor, Timing]:
    """How old each sensor's readings are.

    The flow sensor's own lag is its file's for a slow signal, b/c, unless the navigator carries its dynamics as states:
    then a reading is of its own instant.
    """
    found: dict[Sensor, Timing] = {Sensor.IMU: Timing(0.0, float(sheets.inertial.latency_s), 0.0)}
    lag_s = 0.0 if needs_lag_states(flow_sensor) else flow_sensor.dynamics.delay_s
    for one in SENSOR_TABLE:
        sheet = getattr(sheets, one.name)
        for kind in [output.kind for output in one.says] if sheet is not None and one.on_epochs else []:
            lag = lag_s if kind == Sensor.FLOW_RATE else 0.0
            age = Timing(lag, float(sheet.latency_s), float(sheet.jitter_s))
            if found.setdefault(kind, age) != age:
                raise InputError(f"{sheet.name}: another sensor of its kind has another latency or jitter")
    return found


TableSheets = sheets_of_table()


JITTER_KEY = 20251121  # of the timetable's own generator: it is part of the scenario, not of a seed
KEYS_A_KIND = 256  # of several sensors of one kind each has its own jitter
SLACK_S = 1e-9  # what rounding leaves of an instant


class Timing(NamedTuple):
    """lag_s: age of what is read at the instant of reading it (a sensor's own dynamics); latency_s: from there to its
    arrival; jitter_s: how uneven arrivals are, and so how far off their stamps.
    """

    lag_s: float
    latency_s: float
    jitter_s: float


def schedule_of(
    epochs: int, sensors: Onboard, timing: dict[Sensor, Timing], stated: dict[Sensor, Timing] | None = None
) -> Timetable:
    """The timetable of a flight of `epochs` epochs; `timing` of each sensor that is fitted.

    stated: what the navigator takes it for, where that is something else. The horizon has room for both.
    """
    stated = timing if stated is None else stated
    ages_s = (t.lag_s + t.latency_s for t in (*timing.values(), *stated.values()))
    horizon = max(1, math.ceil((max(ages_s) - SLACK_S) / EPOCH_S))
    t_s, sensor, sampled = sampled_readings(epochs, sensors, timing, stated)
    ready = np.ceil((t_s - SLACK_S) / EPOCH_S).astype(np.int64) + horizon
    by_epoch = np.searchsorted(sampled, np.arange(epochs), side="right")  # how many were read by the end of an epoch
    newest = by_epoch[np.clip(ready, 0, epochs - 1)]
    slots = int(np.max(newest - np.arange(len(t_s)))) + 1
    order = np.argsort(t_s, kind="stable")
    slot = np.arange(len(t_s)) % slots
    return Timetable(t_s[order], sensor[order], slot[order], ready[order], slots, horizon, len(t_s))


def sampled_readings(
    epochs: int, sensors: Onboard, timing: dict[Sensor, Timing], stated: dict[Sensor, Timing]
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Every reading in the order of `sampling.sample`: the instant it is taken to describe, its sensor, its epoch.

    Each sensor's jitter is drawn for itself: a vehicle without another sensor has the same.
    """
    parts: list[tuple[NDArray[np.float64], int, NDArray[np.int64]]] = []
    for sensor, key, clock in clocks(sensors):
        due = np.arange(clock.first, epochs, clock.every, dtype=np.int64)
        drawn = np.random.Generator(np.random.Philox(key=[JITTER_KEY, key])).random(len(due))
        late_s = timing[sensor].jitter_s * (2.0 * drawn - 1.0)
        hidden_s = timing[sensor].latency_s - stated[sensor].latency_s
        t_s = np.asarray(due * EPOCH_S - stated[sensor].lag_s + late_s + hidden_s, np.float64)
        parts.append((t_s, int(sensor), due))
    every = np.arange(epochs, dtype=np.int64)
    for part in range(round(EPOCH_S / (sensors.inertial_steps * PHYSICS_PERIOD_S))):
        t_s = np.asarray(every * EPOCH_S + (part + 1) * sensors.inertial_steps * PHYSICS_PERIOD_S, np.float64)
        parts.append((t_s, int(Sensor.IMU), every))
    epoch = np.concatenate([due for _, _, due in parts])
    order = np.argsort(epoch, kind="stable")
    kinds = np.concatenate([np.full(len(due), kind) for _, kind, due in parts])
    return np.concatenate([t_s for t_s, _, _ in parts])[order], kinds[order], epoch[order]


def clocks(sensors: Onboard) -> list[tuple[Sensor, int, Clock]]:
    """Every reading of a fitted sensor but the inertial one, in the order in which `sampling.sample` takes them.

    Its kind, the key of its jitter, and its clock. All readings of a sensor at one time arrive together.
    """
    found, seen = [], Counter[Sensor]()
    for sensor in SENSOR_TABLE:
        clock, first = getattr(sensors.carried, sensor.name).clock, sensor.says[0].kind
        key = int(first) + KEYS_A_KIND * seen[first]
        seen[first] += 1
        if sensor.on_epochs:
            found += [(output.kind, key, clock) for output in sensor.says[: clock.fitted]]
    return found
