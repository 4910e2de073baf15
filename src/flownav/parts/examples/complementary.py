"""A complementary filter, about as short as a navigation filter can be: an own part to copy and to change.

Position and velocity follow the IMU in the short run and GPS, flow and range in the long run, each sensor with one time
constant. It states no uncertainty and tests no reading.
"""

import numpy as np

from flownav.core.measurement import Sensor
from flownav.parts.protocols import Estimate, GivenSettings, Imu, Reading
from flownav.parts.tools import AttitudeFollower, flow_velocity, matrix

# how long the IMU is believed before each sensor has its way [s]
TIME_S = {Sensor.GPS_POSITION: 2.0, Sensor.GPS_VELOCITY: 0.5, Sensor.FLOW_RATE: 0.3, Sensor.RANGE: 0.3}


class ComplementaryFilter:
    """One time constant a sensor."""

    name = "complementary"

    def start(self, given: GivenSettings) -> None:
        """Begin: nothing is known yet."""
        self.given, self.attitude, self.pos, self.vel = given.settings, AttitudeFollower(), np.zeros(3), np.zeros(3)
        self.t_s, self.range_m, self.ground_d_m = 0.0, np.nan, np.nan
        self.seen_s: dict[Sensor, float] = {}

    def predict(self, t_s: float, imu: Imu | None) -> None:
        """Strapdown."""
        dt_s, self.t_s = min(t_s - self.t_s, 0.1), t_s
        if imu is not None:
            self.vel = self.vel + self.attitude.predict(dt_s, imu) * dt_s
        self.pos = self.pos + self.vel * dt_s

    def update(self, reading: Reading) -> None:
        """Towards the reading, by the time since the last one over its sensor's time constant."""
        sensor, value, rotation = reading.sensor, reading.value, matrix(self.attitude.quaternion)
        if sensor == Sensor.MAG:
            self.attitude.compass(reading, self.given.equipment.declination_rad)
        if reading.quality == 0.0 or sensor not in TIME_S or not np.isfinite(value[:2]).all():
            return
        share = min((reading.t_s - self.seen_s.get(sensor, -np.inf)) / TIME_S[sensor], 1.0)
        first, self.seen_s[sensor] = sensor not in self.seen_s, reading.t_s
        if sensor == Sensor.GPS_POSITION:
            level = slice(0, 3 if first else 2)  # height is the range's
            self.pos[level] += share * (value - self.pos)[level]
        elif sensor == Sensor.GPS_VELOCITY and reading.t_s - self.seen_s.get(Sensor.FLOW_RATE, -np.inf) > 1.0:
            self.vel += share * np.nan_to_num(value - self.vel)
        elif sensor == Sensor.FLOW_RATE and np.isfinite(self.range_m):
            forward, right = flow_velocity(reading, self.range_m, self.given.flow, self.attitude.rate_rad_s[:2])
            u, v, _ = rotation.T @ self.vel
            self.vel += share * rotation @ np.array([forward - u, right - v, 0.0])
        elif sensor == Sensor.RANGE:
            self.range_m, height_m = value[0], (value[0] + self.given.height.range_below_m) * rotation[2, 2]
            self.ground_d_m = self.pos[2] + height_m if first else self.ground_d_m
            off = self.ground_d_m - height_m - self.pos[2]
            self.pos[2], self.vel[2] = self.pos[2] + share * off, self.vel[2] + share * off / 2.0

    def estimate(self) -> Estimate | None:
        """The state as it stands, once it knows which way is down."""
        ground_d_m = self.ground_d_m if np.isfinite(self.ground_d_m) else None
        return Estimate(self.pos, self.vel, self.attitude.quaternion, ground_d_m=ground_d_m) if self.seen_s else None
