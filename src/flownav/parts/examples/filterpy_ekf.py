"""FilterPy's extended Kalman filter as flownav's navigation filter: position, velocity, accelerometer's bias, NED.

The attitude is a complementary filter's (`AttitudeFollower`); FilterPy has the covariance and the corrections.
"""

from typing import Any

import numpy as np

from flownav.core.errors import InputError
from flownav.core.measurement import Array, Sensor
from flownav.parts.protocols import Estimate, GivenSettings, Imu, Innovation, Reading
from flownav.parts.tools import AttitudeFollower, fix_is_overdue, flow_velocity, gps_variance, matrix

ACCEL_NOISE = 0.3  # of the acceleration that moves the filter, tilt errors and all [m/s2/sqrt(Hz)]
BIAS_WALK = 0.02  # [m/s2/sqrt(s)]
START_SIGMA = np.array([5.0, 5.0, 5.0, 1.0, 1.0, 1.0, 0.3, 0.3, 0.3])
GATE = 25.0  # of a flow's innovation squared over its variance: 5 sigma


class FilterPyEkf:
    """Nine states. Needs the package filterpy."""

    name = "filterpy-ekf"

    def start(self, given: GivenSettings) -> None:
        """InputError where FilterPy is not installed."""
        try:
            from filterpy.kalman import ExtendedKalmanFilter
        except ImportError as missing:
            raise InputError("filterpy-ekf: needs the package filterpy; pip install filterpy") from missing
        self.given, self.attitude, self.t_s, self.range_m = given.settings, AttitudeFollower(), 0.0, np.nan
        self.ground_d_m: float | None = None
        self.located = False
        self.filter: Any = ExtendedKalmanFilter(dim_x=9, dim_z=1)
        self.filter.P = np.diag(START_SIGMA**2)

    def predict(self, t_s: float, imu: Imu | None) -> None:
        """x <- F x + B a, P <- F P F' + Q, with the specific force turned into the earth's axes."""
        dt_s, self.t_s = min(t_s - self.t_s, 0.1), t_s
        self.located = self.located or fix_is_overdue(t_s, self.attitude, self.given)
        accel = self.attitude.predict(dt_s, imu) if imu is not None else np.zeros(3)
        identity, f = np.eye(3), self.filter
        f.F = np.eye(9)
        f.F[:3, 3:6] = dt_s * identity
        if imu is not None:
            f.F[3:6, 6:] = -dt_s * identity
        f.x = f.F @ f.x
        f.x[:3] += 0.5 * dt_s**2 * accel[:, None]
        f.x[3:6] += dt_s * accel[:, None]
        noise = np.repeat([0.0, ACCEL_NOISE**2 * dt_s, BIAS_WALK**2 * dt_s], 3)
        f.P = f.F @ f.P @ f.F.T + np.diag(noise)

    def update(self, reading: Reading) -> list[Innovation]:
        """Each component by itself, as a scalar."""
        sensor, value, s = reading.sensor, reading.value, self.given
        rotation = matrix(self.attitude.quaternion)
        if reading.quality == 0.0 or not np.isfinite(value[:1]).all():
            return []
        if sensor == Sensor.MAG:
            self.attitude.compass(reading, s.equipment.declination_rad)
        elif sensor == Sensor.GPS_POSITION:
            if not self.located:
                self.filter.x[:3, 0], self.located = value, True
            return self._scalars(np.eye(3, 9), value, gps_variance(s.gps))
        elif sensor == Sensor.GPS_VELOCITY:
            return self._scalars(np.eye(3, 9, 3), value, np.full(3, 0.2**2))
        elif sensor == Sensor.FLOW_RATE and np.isfinite(self.range_m):
            seen = flow_velocity(reading, self.range_m, s.flow, self.attitude.rate_rad_s[:2])
            rows = np.zeros((2, 9))
            rows[:, 3:6] = rotation.T[:2]
            variances = np.full(2, (0.1 + s.flow.flow_sigma_rad_s * self.range_m) ** 2)
            return self._scalars(rows, seen, variances, gate=GATE)
        elif sensor == Sensor.RANGE and self.located:
            self.range_m, height_m = value[0], (value[0] + s.height.range_below_m) * rotation[2, 2]
            if self.ground_d_m is None:
                self.ground_d_m = float(self.filter.x[2, 0]) + height_m
            return self._scalars(np.eye(1, 9, 2), np.array([self.ground_d_m - height_m]), np.array([0.05**2]))
        return []

    def _scalars(self, rows: Array, values: Array, variances: Array, gate: float = np.inf) -> list[Innovation]:
        news = []
        for component, (row, value, variance) in enumerate(zip(rows, values, variances, strict=True)):
            if not np.isfinite(value):
                continue
            h = row[None, :]
            innovation = float(value - (h @ self.filter.x)[0, 0])
            expected = float((h @ self.filter.P @ h.T)[0, 0] + variance)
            fused = innovation**2 <= GATE * expected
            if fused:
                self.filter.update(
                    np.array([[value]]), lambda x, h=h: h, lambda x, h=h: h @ x, R=np.array([[variance]])
                )
            news.append(Innovation(innovation, expected, component, value, variance, fused))
        return news

    def estimate(self) -> Estimate | None:
        """Position and velocity with their standard deviations; the bias is the filter's own, in the earth's axes."""
        if not self.located:
            return None
        x, sigma = self.filter.x[:, 0], np.sqrt(np.diag(self.filter.P))
        bias = matrix(self.attitude.quaternion).T @ x[6:]
        return Estimate(
            x[:3], x[3:6], self.attitude.quaternion, sigma[:3], sigma[3:6], accel_bias_m_s2=bias,
            ground_d_m=self.ground_d_m,
        )  # fmt: skip
