"""The sensors that a vehicle carries for its navigator: coefficients, clocks and places, and the ground below.

Last: datasheets as a scenario wants them, its own figures above the files', at rates that the simulator's clock has.
"""

from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import equation
from flownav.core.frames import rotation_from_quaternion, to_earth
from flownav.sensors.camera_sheets import AngleNoise, DistanceNoise, FlowCameraSheet, PadCameraSheet
from flownav.sensors.flow import FlowParameters
from flownav.sensors.geometry import BeamHit, Ground, beam_distance
from flownav.sensors.range_sensor import RangeSensorSheet
from flownav.sensors.settings import GpsInsSettings, PadFixSettings, RangefinderSettings
from flownav.sensors.sheet import Lever, SensorSheet
from flownav.sensors.sheets import GpsReceiverSheet, InertialSheet
from flownav.vehicle.state import HelicopterState

EPOCH_S = 0.02
PHYSICS_PERIOD_S = 0.002
LEAST_HEIGHT_M = 0.1  # keeps an image's rate finite; chosen: nearer, no lens sees its pad sharply
PAD_SEEN = 4  # tangents forward and right, distance and reach of the mark that was found [m]; reach 0: none
SETTLED_S = 2.0  # the skids take the weight as the collective goes down: chosen, not measured


class Clock(NamedTuple):
    """When a sensor reads: each `every` epochs from the first on; fitted: how many readings it then gives, or none."""

    fitted: int
    every: int
    first: int


ALWAYS, NEVER = Clock(fitted=1, every=1, first=0), Clock(fitted=0, every=1, first=0)


class Place(NamedTuple):
    """Where a sensor's lens is, from the centre of gravity, body FRD [m]."""

    forward_m: float
    right_m: float
    down_m: float


class Fitting(NamedTuple):
    """One sensor as it is carried. p: coefficients by its datasheet; place: of its lens, None where it has none."""

    p: Any
    clock: Clock
    place: Place | None


class Onboard(NamedTuple):
    """Every sensor as it is carried, and what they look at. carried: a `Fitting` by each sensor's name."""

    carried: Any
    inertial_steps: int  # physics steps an inertial period
    flow: FlowParameters
    pad_seen: NDArray[np.float64]  # what was seen in rendered frames, rows of PAD_SEEN flattened; empty: by the model
    rotor_above_cg_m: float
    texture_everywhere: float  # 0: only the pad has texture
    pad_half_size_m: float


def without(onboard: Onboard, *names: str) -> Onboard:
    """A vehicle that does not carry these sensors."""
    fittings = {name: getattr(onboard.carried, name) for name in names}
    gone = {name: one._replace(clock=one.clock._replace(fitted=0)) for name, one in fittings.items()}
    return onboard._replace(carried=onboard.carried._replace(**gone))


@equation
def earlier(state: HelicopterState, late_s: float) -> HelicopterState:
    """The state with the position that it had `late_s` ago, at the velocity of now: the position that a late reading
    shows.
    """
    rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
    vel_n, vel_e, vel_d = to_earth(rotation, state.u, state.v, state.w)
    return HelicopterState(
        state.pos_n - late_s * vel_n,
        state.pos_e - late_s * vel_e,
        state.pos_d - late_s * vel_d,
        *state[3:],
    )


@equation
def place_of(state: HelicopterState, place: Place) -> tuple[float, float, float]:
    """Where a lens is, NED [m]."""
    rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
    arm = to_earth(rotation, place.forward_m, place.right_m, place.down_m)
    return state.pos_n + arm[0], state.pos_e + arm[1], state.pos_d + arm[2]


@equation
def beam_of(state: HelicopterState, place: Place, ground: Ground) -> BeamHit:
    """The distance along body down from a lens to the ground, and the point that it hits."""
    rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
    north, east, down = place_of(state, place)
    return beam_distance(north, east, -down, rotation, ground)


Sheet = TypeVar("Sheet", bound=SensorSheet)
EPOCH_HZ = 1.0 / EPOCH_S
STEPS_AN_EPOCH = round(EPOCH_S / PHYSICS_PERIOD_S)


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


class Wishes(Protocol):
    """Sensor settings that a scenario states itself, above the sensors' files."""

    @property
    def gps(self) -> GpsInsSettings:
        """The receiver's errors."""

    @property
    def rangefinder(self) -> RangefinderSettings:
        """The rangefinder's limits and noise."""

    @property
    def pad_fix(self) -> PadFixSettings | None:
        """The pad camera's view and noise; None where there is no such camera."""


def as_filed(scenario: Wishes, sheet: Sheet, lens_down_m: float) -> Sheet:
    """The sheet as its file has it, on the simulator's clock."""
    return on_clock(sheet)


def inertial_sheet(scenario: Wishes, sheet: InertialSheet, lens_down_m: float) -> InertialSheet:
    """The IMU at the lowest rate, not below its own, whose period is a whole number of physics steps that divides an
    epoch.
    """
    steps = [n for n in range(1, STEPS_AN_EPOCH + 1) if STEPS_AN_EPOCH % n == 0]
    fast = [n for n in steps if 1.0 / (n * PHYSICS_PERIOD_S) >= float(sheet.rate_hz) - 1e-6]
    return sheet.model_copy(update={"rate_hz": 1.0 / (max(fast or steps[:1]) * PHYSICS_PERIOD_S)})


def receiver_sheet(scenario: Wishes, sheet: GpsReceiverSheet, lens_down_m: float) -> GpsReceiverSheet:
    """The receiver: the paper's white noise at 50 Hz, or the sheet with the scenario's changes to its errors."""
    gps = scenario.gps
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


def receiver_readings(scenario: Wishes) -> int:
    """A fix is a position and a velocity; the paper's white one has no velocity."""
    return 1 if scenario.gps.model == "white" else 2


def camera_sheet(scenario: Wishes, sheet: FlowCameraSheet, lens_down_m: float) -> FlowCameraSheet:
    """The flow camera, its lens where the scenario puts it."""
    return on_clock(sheet.model_copy(update={"lens": at_height(sheet.lens, lens_down_m)}))


def range_sheet(scenario: Wishes, sheet: RangeSensorSheet, lens_down_m: float) -> RangeSensorSheet:
    """The rangefinder with the scenario's changes, its lens where the scenario puts it."""
    sonar = scenario.rangefinder
    given = {name: getattr(sonar, name) for name in sonar.model_fields_set}
    return on_clock(sheet.model_copy(update=given | {"lens": at_height(sheet.lens, lens_down_m)}))


def pad_sheet(scenario: Wishes, sheet: PadCameraSheet, lens_down_m: float) -> PadCameraSheet | None:
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
