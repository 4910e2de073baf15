"""Datasheets as a scenario wants them: its own figures above the files', at rates that the simulator's clock has."""

from __future__ import annotations

from typing import Protocol, TypeVar

from flownav.sensors.flow_camera_sheet import FlowCameraSheet
from flownav.sensors.gps_receiver_sheet import GpsReceiverSheet
from flownav.sensors.inertial_sheet import InertialSheet
from flownav.sensors.pad_camera_sheet import AngleNoise, DistanceNoise, PadCameraSheet
from flownav.sensors.range_sensor import RangeSensorSheet
from flownav.sensors.settings import GpsInsSettings, PadFixSettings, RangefinderSettings
from flownav.sensors.sheet import Lever, SensorSheet
from flownav.simulation.onboard import EPOCH_S, PHYSICS_PERIOD_S, Clock

Sheet = TypeVar("Sheet", bound=SensorSheet)
EPOCH_HZ = 1.0 / EPOCH_S
STEPS_AN_EPOCH = round(EPOCH_S / PHYSICS_PERIOD_S)


class Wishes(Protocol):
    """What a scenario says of sensors itself, above their files."""

    @property
    def gps(self) -> GpsInsSettings:
        """The receiver's errors."""

    @property
    def rangefinder(self) -> RangefinderSettings:
        """The rangefinder's limits and noise."""

    @property
    def pad_fix(self) -> PadFixSettings | None:
        """The pad camera's view and noise; None where there is no such camera."""


def at_height(lens: Lever, down_m: float) -> Lever:
    """A lens where the vehicle's file puts it."""
    return lens.model_copy(update={"down_m": down_m})


def on_clock(sheet: Sheet) -> Sheet:
    """The sheet at the nearest rate of which an epoch's is a multiple."""
    return sheet.model_copy(update={"rate_hz": EPOCH_HZ / every(sheet)})


def every(sheet: SensorSheet) -> int:
    """How many epochs lie between two readings."""
    return max(1, round(EPOCH_HZ / float(sheet.rate_hz)))


def clock_of(sheet: SensorSheet, phase: int, readings: int) -> Clock:
    """A sensor's clock; phases differ, as no two sensors start together. readings: how many it gives each time."""
    period = every(sheet)
    return Clock(readings, period, phase % period)


def as_filed(wishes: Wishes, sheet: Sheet, lens_down_m: float) -> Sheet:
    """What its file says."""
    return on_clock(sheet)


def inertial_sheet(wishes: Wishes, sheet: InertialSheet, lens_down_m: float) -> InertialSheet:
    """The IMU at the lowest rate, not below its own, whose period is so many physics steps that an epoch has."""
    steps = [n for n in range(1, STEPS_AN_EPOCH + 1) if STEPS_AN_EPOCH % n == 0]
    fast = [n for n in steps if 1.0 / (n * PHYSICS_PERIOD_S) >= float(sheet.rate_hz) - 1e-6]
    return sheet.model_copy(update={"rate_hz": 1.0 / (max(fast or steps[:1]) * PHYSICS_PERIOD_S)})


def receiver_sheet(wishes: Wishes, sheet: GpsReceiverSheet, lens_down_m: float) -> GpsReceiverSheet:
    """The receiver: the paper's white noise at 50 Hz, or the sheet with what the scenario says of its errors."""
    gps = wishes.gps
    if gps.model == "white":
        white = dict.fromkeys(("slow_sigma_m", "slow_sigma_down_m", "fast_sigma_m", "fast_sigma_down_m", "spread"), 0.0)
        white |= {"white_sigma_m": gps.white_sigma_m, "white_sigma_down_m": gps.white_sigma_m, "quantum_m": 0.0}
        return on_clock(
            sheet.model_copy(
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
        )
    shared = {name: getattr(gps, name) for name in gps.model_fields_set if name in type(sheet.position).model_fields}
    return on_clock(sheet.model_copy(update={"position": sheet.position.model_copy(update=shared)}))


def receiver_readings(wishes: Wishes) -> int:
    """A fix is a position and a velocity; the paper's white one has no velocity."""
    return 1 if wishes.gps.model == "white" else 2


def camera_sheet(wishes: Wishes, sheet: FlowCameraSheet, lens_down_m: float) -> FlowCameraSheet:
    """The flow camera, its lens where the scenario puts it."""
    return on_clock(sheet.model_copy(update={"lens": at_height(sheet.lens, lens_down_m)}))


def range_sheet(wishes: Wishes, sheet: RangeSensorSheet, lens_down_m: float) -> RangeSensorSheet:
    """The rangefinder with what the scenario says of it, its lens where the scenario puts it."""
    sonar = wishes.rangefinder
    said = {name: getattr(sonar, name) for name in sonar.model_fields_set}
    return on_clock(sheet.model_copy(update=said | {"lens": at_height(sheet.lens, lens_down_m)}))


def pad_sheet(wishes: Wishes, sheet: PadCameraSheet, lens_down_m: float) -> PadCameraSheet | None:
    """The pad's camera, where the scenario has one."""
    fix = wishes.pad_fix
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
