"""A complementary filter, about as short as a navigation filter can be: an own part to copy and to change.

Gyro, accelerometer and compass make the attitude; position and velocity follow the IMU in the short run and GPS, flow
and range in the long run, each with one time constant. It states no uncertainty and tests no reading.
"""

from __future__ import annotations

import numpy as np

from flownav.measurement import Sensor
from flownav.parts.protocols import Estimate, Imu, Reading, Told
from flownav.parts.tools import flow_velocity, heading_off, level_attitude, matrix, turned

GRAVITY = np.array([0.0, 0.0, 9.80665])
TILT_S = 5.0  # time constants [s], how long the IMU is believed: of tilt, then of what each sensor tells
TIME_S = {Sensor.MAG: 5.0, Sensor.GPS_POSITION: 2.0, Sensor.GPS_VELOCITY: 0.5, Sensor.FLOW_RATE: 0.3, Sensor.RANGE: 0.3}


class ComplementaryFilter:
    """One time constant a sensor."""

    name = "complementary"

    def start(self, told: Told) -> None:
        """Nothing is known yet."""
        self.told, self.pos, self.vel, self.rate = told.settings, np.zeros(3), np.zeros(3), np.zeros(3)
        self.t_s, self.quaternion, self.range_m, self.ground_d_m = 0.0, None, None, None
        self.seen_s: dict[Sensor, float] = {}

    def predict(self, t_s: float, imu: Imu | None) -> None:
        """Strapdown, with a tilt that leans on the specific force."""
        dt_s, self.t_s = t_s - self.t_s, t_s
        if imu is None:
            return
        if self.quaternion is None:
            self.quaternion, dt_s = level_attitude(imu.force_frd_m_s2, heading_rad=0.0), 0.0
        force, down = imu.force_frd_m_s2, matrix(self.quaternion).T @ GRAVITY
        lean = np.cross(down, force) / GRAVITY[2] ** 2 / TILT_S
        self.rate = imu.rate_frd_rad_s
        self.quaternion = turned(self.quaternion, (self.rate + lean) * dt_s)
        self.vel = self.vel + (matrix(self.quaternion) @ force + GRAVITY) * dt_s
        self.pos = self.pos + self.vel * dt_s

    def update(self, reading: Reading) -> None:
        """Towards the reading, by the time since the last one over its sensor's time constant."""
        sensor, value = reading.sensor, reading.value
        if self.quaternion is None or reading.quality == 0.0 or sensor not in TIME_S:
            return
        first = sensor not in self.seen_s
        share = 1.0 if first else min((reading.t_s - self.seen_s[sensor]) / TIME_S[sensor], 1.0)
        self.seen_s[sensor] = reading.t_s
        rotation = matrix(self.quaternion)
        if sensor == Sensor.MAG:
            off = heading_off(self.quaternion, value, self.told.equipment.declination_rad)
            self.quaternion = turned(self.quaternion, rotation.T @ np.array([0.0, 0.0, share * off]))
        elif sensor == Sensor.GPS_POSITION:
            level = slice(0, 3 if first else 2)  # height is the range's
            self.pos[level] += share * (value - self.pos)[level]
        elif sensor == Sensor.GPS_VELOCITY and reading.t_s - self.seen_s.get(Sensor.FLOW_RATE, -9.0) > 1.0:
            self.vel += share * np.nan_to_num(value - self.vel)
        elif sensor == Sensor.FLOW_RATE and self.range_m is not None:
            forward, right = flow_velocity(reading, self.range_m, self.told.flow, self.rate[:2])
            u, v, _ = rotation.T @ self.vel
            self.vel += share * rotation @ np.array([forward - u, right - v, 0.0])
        elif sensor == Sensor.RANGE:
            self.range_m, height_m = value[0], (value[0] + self.told.height.range_below_m) * rotation[2, 2]
            if self.ground_d_m is None:
                self.ground_d_m = self.pos[2] + height_m
            off = self.ground_d_m - height_m - self.pos[2]
            self.pos[2], self.vel[2] = self.pos[2] + share * off, self.vel[2] + share * off / 2.0

    def estimate(self) -> Estimate | None:
        """The state as it stands, once a fix has come."""
        if self.quaternion is None or Sensor.GPS_POSITION not in self.seen_s:
            return None
        return Estimate(self.pos, self.vel, self.quaternion, ground_d_m=self.ground_d_m)
