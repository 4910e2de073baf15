"""The protocol of a filter that takes the navigator's place, and the records that it is given and gives.

Everything is in the frames of the rest of flownav: earth NED, body FRD, SI units, Hamilton quaternions body to earth.
"""

import math
from collections.abc import Iterable
from typing import NamedTuple, Protocol, runtime_checkable

from flownav.core.measurement import Array, Sensor
from flownav.navigation.kernel_settings import NavigatorSettings

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
