"""The protocols of a user's own parts: plain Python classes with these methods, in one file.

Everything is in the frames of the rest of flownav: earth NED, body FRD, SI units, Hamilton quaternions body to earth.
"""

import math
from collections.abc import Iterable
from typing import NamedTuple, Protocol, runtime_checkable

from flownav.control.gains import AutopilotGains
from flownav.control.guidance import Reference
from flownav.core.measurement import Array, Sensor
from flownav.navigation.kernel_settings import NavigatorSettings
from flownav.vehicle.state import Around, Controls

UNKNOWN = (math.nan, math.nan, math.nan)
NO_BIAS = (0.0, 0.0, 0.0)


class Imu(NamedTuple):
    """An inertial reading: mean rate [rad/s] and mean specific force [m/s2] since the last one, (3,), body FRD.

    held: between two readings, where the older one serves for the way to another sensor's instant.
    """

    rate_frd_rad_s: Array
    force_frd_m_s2: Array
    held: bool = False


class Reading(NamedTuple):
    """One reading of a sensor other than the IMU.

    t_s: the instant that it describes. value: as `flownav.core.measurement.COLUMNS[sensor]` names it; FLOW_RATE has two
    values more, the vehicle's own turning about x and y over the exposure [rad/s], NaN where unknown. variance (3,):
    as the sensor states it, NaN where it states none. quality: 0 (no data) to 255.
    """

    t_s: float
    sensor: Sensor
    value: Array
    variance: Array
    quality: float


class GivenSettings(NamedTuple):
    """The settings that a filter is given before its first reading.

    settings: noise, lever arms and gains, as our own navigator gets them.
    """

    settings: NavigatorSettings


class Estimate(NamedTuple):
    """The estimate of a filter. Position and velocity NED [m, m/s], attitude (w, x, y, z) body FRD to earth NED.

    std_pos_ned_m, std_vel_ned_m_s: one standard deviation of each axis, NaN where the filter states none. gyro_bias
    [rad/s] and accel_bias [m/s2], FRD: they are subtracted from the IMU as the estimate is carried from the horizon to
    now. ground_d_m: down coordinate of the ground below, and pad_ned_m: where the pad is; None while it knows neither.
    """

    pos_ned_m: Iterable[float]
    vel_ned_m_s: Iterable[float]
    quaternion: Iterable[float]
    std_pos_ned_m: Iterable[float] = UNKNOWN
    std_vel_ned_m_s: Iterable[float] = UNKNOWN
    gyro_bias_rad_s: Iterable[float] = NO_BIAS
    accel_bias_m_s2: Iterable[float] = NO_BIAS
    ground_d_m: float | None = None
    pad_ned_m: Iterable[float] | None = None


class Innovation(NamedTuple):
    """The innovation of one component of a reading, for the record (optional).

    innovation: observed less predicted; variance: the filter's predicted variance of it, measurement noise included;
    component: which of the reading's values; observation: the value that was read.
    """

    innovation: float
    variance: float
    component: int = 0
    observation: float = math.nan
    observation_variance: float = math.nan
    fused: bool = True


@runtime_checkable
class Filter(Protocol):
    """A navigation filter. Readings come in the order of the instants that they describe.

    `predict` is called for every inertial reading and before each other reading whose instant lies ahead, so that the
    times from call to call add up to the flight's; `update` for every other reading that is not withheld. `estimate` is
    read after each of them.
    """

    def start(self, given: GivenSettings) -> None:
        """Once, before the first reading."""

    def predict(self, t_s: float, imu: Imu | None) -> None:
        """Bring the filter to an instant; imu: the newest inertial reading, None where there was none for 0.1 s."""

    def update(self, reading: Reading) -> Iterable[Innovation] | None:
        """Take a reading that describes the instant the filter stands at."""

    def estimate(self) -> Estimate | None:
        """The current estimate; None until it has started."""


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
