"""The protocols of a user's own parts: plain Python classes with these methods, in one file.

That of a filter is the navigator's (`navigation.filter_protocol`), so that a replay need not load this room.
Everything is in the frames of the rest of flownav: earth NED, body FRD, SI units, Hamilton quaternions body to earth.
"""

from collections.abc import Iterable
from typing import NamedTuple, Protocol, runtime_checkable

from flownav.control.gains import AutopilotGains
from flownav.control.guidance import Reference
from flownav.core.measurement import Array, Sensor
from flownav.navigation.filter_protocol import (
    UNKNOWN,
    Estimate,
    Filter,
    GivenSettings,
    Imu,
    Innovation,
    Reading,
)
from flownav.vehicle.state import Around, Controls

__all__ = [
    "Controller",
    "Estimate",
    "Filter",
    "Flown",
    "GivenSettings",
    "Imu",
    "Innovation",
    "Outputs",
    "Parts",
    "Reading",
    "SensorModel",
    "Truth",
    "Values",
    "VehicleModel",
]


class Truth(NamedTuple):
    """The true state at an instant: all that a sensor may read."""

    t_s: float
    pos_ned_m: Array
    vel_ned_m_s: Array
    quaternion: Array
    rate_frd_rad_s: Array
    force_frd_m_s2: Array


class Values(NamedTuple):
    """A reading of a sensor of one's own: as `Reading` has them; variance NaN where it states none."""

    value: Iterable[float]
    variance: Iterable[float] = UNKNOWN
    quality: float = 255.0


@runtime_checkable
class SensorModel(Protocol):
    """A sensor that reads in place of ours of the same kind, at the same instants."""

    sensor: Sensor

    def start(self, seed: int, flight: int) -> None:
        """Before the first reading: seed and number of the flight, for noise that can be drawn again."""

    def read(self, truth: Truth) -> Values | None:
        """The reading of an instant; None: it stays silent."""


class Outputs(NamedTuple):
    """The outputs of a vehicle for sensors and scores: rotor thrust [N], load of the ground on it [N], power [W]."""

    thrust_n: float
    contact_force_n: float
    power_w: float


@runtime_checkable
class VehicleModel(Protocol):
    """A vehicle in place of ours. The scenario's own vehicle file is what navigator and autopilot believe of it.

    The first 13 numbers of its state are position NED [m], velocity FRD [m/s], quaternion and body rate [rad/s], as of
    `flownav.vehicle.state.HelicopterState`; it may have any number more. Controls are what the autopilot of the
    scenario's vehicle gives: lon, lat, col, ped. Integrated by Runge and Kutta's fourth-order method at 500 Hz.
    """

    def start(self, rigid: Array) -> Array:
        """The whole state (13 + n,) at the start, from the (13,) at which the scenario begins."""

    def derivative(self, t_s: float, state: Array, controls: Controls, around: Around) -> Array:
        """The state's rate (13 + n,): of position NED, of velocity in body axes, of the quaternion, of the rates."""

    def outputs(self, t_s: float, state: Array, controls: Controls, around: Around) -> Outputs:
        """Thrust, ground load and power."""


class Flown(NamedTuple):
    """The state that a controller uses: position NED from the pad as the vehicle takes it to be, velocity and specific
    force FRD, attitude as the filter has it, body rates as the flybarless unit's gyros read them.
    """

    pos_ned_m: Array
    vel_frd_m_s: Array
    quaternion: Array
    rate_frd_rad_s: Array
    force_frd_m_s2: Array


@runtime_checkable
class Controller(Protocol):
    """A controller in place of our autopilot's loops, called at 250 Hz.

    When to take off, and that the vehicle has landed, stays with our landing logic, which states it as `flying`.
    """

    def start(self, gains: AutopilotGains) -> None:
        """Before the flight; gains: of our own autopilot for this vehicle, the trims of hover among them."""

    def command(self, t_s: float, flown: Flown, reference: Reference, *, flying: bool) -> Controls:
        """Controls for the next 4 ms; reference: where the path is now; flying False: on the ground, at idle."""


class Parts(NamedTuple):
    """The parts of one flight that are not ours."""

    filter: Filter | None = None
    sensors: tuple[SensorModel, ...] = ()
    vehicle: VehicleModel | None = None
    controller: Controller | None = None

    @property
    def any(self) -> bool:
        """Whether there is one."""
        return bool(self.filter or self.sensors or self.vehicle or self.controller)
