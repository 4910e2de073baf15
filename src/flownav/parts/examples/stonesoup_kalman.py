"""Stone Soup's Kalman predictor and updater as flownav's navigation filter: an adapter for another library's states.

Position and velocity NED in one of Stone Soup's `GaussianState`s; its transition takes the acceleration that IMU and
attitude imply as a control. The attitude is a complementary filter's (`AttitudeFollower`).
"""

from datetime import datetime, timedelta
from types import SimpleNamespace
from typing import Any

import numpy as np

from flownav.core.errors import InputError
from flownav.core.measurement import Array, Sensor
from flownav.parts.protocols import Estimate, GivenSettings, Imu, Reading
from flownav.parts.tools import AttitudeFollower, fix_is_overdue, flow_velocity, gps_variance, matrix

EPOCH = datetime(2000, 1, 1)  # Stone Soup keeps time as dates
STEP_S = 0.02  # inertial readings are gathered over so long before Stone Soup predicts
ACCEL_NOISE = 0.5  # of the acceleration that moves the filter, biases and tilt errors and all [m/s2/sqrt(Hz)]
START_SIGMA = np.array([5.0, 5.0, 5.0, 1.0, 1.0, 1.0])


class StoneSoupKalman:
    """Six states. Needs the package stonesoup."""

    name = "stonesoup-kalman"

    def start(self, given: GivenSettings) -> None:
        """InputError where Stone Soup is not installed."""
        self.soup = _stone_soup()
        self.given, self.attitude, self.range_m = given.settings, AttitudeFollower(), np.nan
        self.t_s, self.gathered, self.gathered_s = 0.0, np.zeros(3), 0.0
        self.ground_d_m: float | None = None
        self.state: Any = None

    def predict(self, t_s: float, imu: Imu | None) -> None:
        """Gather inertial readings; a step of Stone Soup's predictor each 20 ms."""
        dt_s, self.t_s = min(t_s - self.t_s, 0.1), t_s
        if imu is not None:
            self.gathered = self.gathered + self.attitude.predict(dt_s, imu) * dt_s
        self.gathered_s += dt_s
        if self.state is None and fix_is_overdue(t_s, self.attitude, self.given):
            self._fix(np.zeros(3), np.zeros(3))
        if self.state is not None and self.gathered_s >= STEP_S:
            self._step()

    def _step(self) -> None:
        """x <- F x + B a, by Stone Soup."""
        soup, dt_s, gained = self.soup, self.gathered_s, self.gathered
        self.gathered, self.gathered_s = np.zeros(3), 0.0
        transition, control = np.eye(6), np.zeros((6, 3))
        transition[:3, 3:] = dt_s * np.eye(3)
        control[:3], control[3:] = 0.5 * dt_s * np.eye(3), np.eye(3)
        noise = np.diag(np.repeat([ACCEL_NOISE**2 * dt_s**3 / 3.0, ACCEL_NOISE**2 * dt_s], 3))
        predictor = soup.KalmanPredictor(soup.Transition(transition, noise), soup.Control(control))
        when = EPOCH + timedelta(seconds=self.t_s)
        self.state = predictor.predict(self.state, timestamp=when, control_input=soup.State(gained[:, None]))

    def update(self, reading: Reading) -> None:
        """Positions and velocities NED as Stone Soup's linear measurements."""
        sensor, value, s = reading.sensor, reading.value, self.given
        rotation = matrix(self.attitude.quaternion)
        if reading.quality == 0.0 or not np.isfinite(value[:1]).all():
            return
        if sensor == Sensor.MAG:
            self.attitude.compass(reading, s.equipment.declination_rad)
        elif sensor == Sensor.GPS_POSITION:
            self._fix(value, gps_variance(s.gps))
        elif self.state is None:
            return
        elif sensor == Sensor.GPS_VELOCITY and np.isfinite(value).all():
            self._correct((3, 4, 5), value, np.full(3, 0.2**2))
        elif sensor == Sensor.FLOW_RATE and np.isfinite(self.range_m):
            forward, right = flow_velocity(reading, self.range_m, s.flow, self.attitude.rate_rad_s[:2])
            down = (rotation.T @ self._mean[3:])[2]
            sigma_m_s = 0.1 + s.flow.flow_sigma_rad_s * self.range_m
            self._correct((3, 4), (rotation @ np.array([forward, right, down]))[:2], np.full(2, sigma_m_s**2))
        elif sensor == Sensor.RANGE:
            self.range_m, height_m = value[0], (value[0] + s.height.range_below_m) * rotation[2, 2]
            if self.ground_d_m is None:
                self.ground_d_m = float(self._mean[2]) + height_m
            self._correct((2,), np.array([self.ground_d_m - height_m]), np.array([0.05**2]))

    def _fix(self, value: Array, variance: Array) -> None:
        if self.state is None:
            mean, when = np.concatenate([value, np.zeros(3)]), EPOCH + timedelta(seconds=self.t_s)
            self.state = self.soup.GaussianState(mean[:, None], np.diag(START_SIGMA**2), timestamp=when)
        else:
            self._correct((0, 1, 2), value, variance)

    def _correct(self, mapping: tuple[int, ...], value: Array, variance: Array) -> None:
        """One of Stone Soup's updates at the time of its state."""
        soup = self.soup
        model = soup.LinearGaussian(6, mapping, np.diag(variance))
        detection = soup.Detection(value[:, None], timestamp=self.state.timestamp, measurement_model=model)
        prediction = soup.GaussianStatePrediction(self.state.state_vector, self.state.covar, self.state.timestamp)
        self.state = soup.KalmanUpdater().update(soup.SingleHypothesis(prediction, detection))

    @property
    def _mean(self) -> Array:
        return np.asarray(self.state.state_vector, dtype=float)[:, 0]

    def estimate(self) -> Estimate | None:
        """Stone Soup's state, moved on by what has been gathered since its last step."""
        if self.state is None:
            return None
        mean, sigma = self._mean, np.sqrt(np.diag(np.asarray(self.state.covar, dtype=float)))
        return Estimate(
            mean[:3] + mean[3:] * self.gathered_s, mean[3:] + self.gathered, self.attitude.quaternion,
            sigma[:3], sigma[3:], ground_d_m=self.ground_d_m,
        )  # fmt: skip


def _stone_soup() -> SimpleNamespace:
    """The parts of Stone Soup that are used."""
    try:
        from stonesoup.models.control.linear import LinearControlModel
        from stonesoup.models.measurement.linear import LinearGaussian
        from stonesoup.models.transition.linear import LinearGaussianTimeInvariantTransitionModel
        from stonesoup.predictor.kalman import KalmanPredictor
        from stonesoup.types.detection import Detection
        from stonesoup.types.hypothesis import SingleHypothesis
        from stonesoup.types.prediction import GaussianStatePrediction
        from stonesoup.types.state import GaussianState, State
        from stonesoup.updater.kalman import KalmanUpdater
    except ImportError as missing:
        raise InputError("stonesoup-kalman: needs the package stonesoup; pip install stonesoup") from missing
    return SimpleNamespace(
        Control=LinearControlModel,
        LinearGaussian=LinearGaussian,
        Transition=LinearGaussianTimeInvariantTransitionModel,
        KalmanPredictor=KalmanPredictor,
        Detection=Detection,
        SingleHypothesis=SingleHypothesis,
        GaussianStatePrediction=GaussianStatePrediction,
        GaussianState=GaussianState,
        State=State,
        KalmanUpdater=KalmanUpdater,
    )
