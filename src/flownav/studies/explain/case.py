"""A log made ready for the hypotheses: what several of them look at is worked out once, when it is asked for."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from flownav.core.errors import InputError
from flownav.core.frames import to_body
from flownav.core.measurement import Array, Sensor, Stream
from flownav.lab.identification.flight_identification import Measured, measured
from flownav.lab.identification.own_gyro import OwnGyro, own_gyro
from flownav.logs.happened import CLIPPING, FUSES_FLOW, SOURCE_SET, VIBRATION
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import Replay, replay
from flownav.studies.explain.aloft import LEAST_ROWS, START_ROWS, Aloft
from flownav.studies.explain.sign import Window
from flownav.studies.explain.signals import (
    Fit,
    Flags,
    at,
    gap_near,
    high_pass,
    lagged_fit,
    running_median,
    spread,
    turn_of,
)
from flownav.studies.explain.ties import Tie, tie_of

STALE_S = 0.3
QUICK_S, HEADING_S = 1.5, 3.0  # what is quicker is compared between flow and inertial readings
LAGS_S = np.arange(-0.3, 0.95, 0.01)
SHAKEN_S = 2.0
OUTLIER = 6.0  # spreads
ALWAYS = (-np.inf, np.inf)
FLOW_XY, GYRO_XY = (0, 1), (2, 3)  # columns of a flow reading


class FlowSeen(NamedTuple):
    """Flow readings with data: arrival (n,), value (n, 4), quality (n,), range and height there (n,), lifted (n,)."""

    t_s: Array
    value: Array
    quality: Array
    range_m: Array
    lifted: Flags


class HeadingTie(NamedTuple):
    """By how much the attitude's heading is turned from GPS's [rad], how late fixes come [s], how sure that is."""

    turn_rad: float
    lag_s: float
    significance: float


@dataclass(frozen=True)
class Case(Aloft):
    """A log and what is worked out of it."""

    # -- flow ----------------------------------------------------------------------------------------------------
    @cached_property
    def flow(self) -> FlowSeen | None:
        """Every flow reading of rates, with data or without."""
        stream = self.stream(Sensor.FLOW_RATE)
        if stream is None or len(stream) < LEAST_ROWS:
            return None
        seen = stream.t_s - stream.delay_s
        if self.ranges is None:
            range_m = np.full(len(seen), np.nan)
        else:
            near = gap_near(self.ranges[0], seen) <= STALE_S
            range_m = np.where(near, np.interp(seen, self.ranges[0], running_median(self.ranges[1], 9)), np.nan)
        return FlowSeen(stream.t_s, stream.value, stream.quality, range_m, self.lifted(seen))

    @cached_property
    def expected_flow(self) -> tuple[Array, Array] | None:
        """The flow that the inertial readings alone predict, its quick part (n, 2): turning and translation."""
        if self.rates is None or self.flow is None:
            return None
        t_s, _ = self.rates
        turning = self._turning(self.flow)
        moving = np.zeros_like(turning)
        if self.inertial_velocity is not None and self.ranges is not None:
            earth = at(self.inertial_velocity[0], self.inertial_velocity[1], t_s)
            u, v, _ = to_body(self.rotation(t_s), *high_pass(t_s, earth, QUICK_S).T)
            far = np.maximum(np.interp(t_s, self.ranges[0], running_median(self.ranges[1], 9)), 0.15)
            moving = np.column_stack([-v / far, u / far])
        return t_s, high_pass(t_s, turning, QUICK_S) + moving

    def quick_flow(
        self,
        columns: tuple[int, int],
        against: tuple[Array, Array] | None,
        window: Window = ALWAYS,
        least: int = LEAST_ROWS,
    ) -> Fit | None:
        """Regression of the flow's quick part, or of its own gyro's, on what the inertial readings expect."""
        if self.flow is None or against is None:
            return None
        values = self.flow.value[:, columns]
        good = (self.flow.quality > 0.0) & self.flow.lifted & np.isfinite(values).all(axis=1)
        if columns == FLOW_XY and self.ranges is not None:
            good &= np.isfinite(self.flow.range_m)
        good &= (self.flow.t_s >= window[0]) & (self.flow.t_s <= window[1])
        if good.sum() < least:
            return None
        t_s, quick = self.flow.t_s[good], high_pass(self.flow.t_s[good], values[good], QUICK_S)
        limit = OUTLIER * np.array([spread(column) for column in quick.T]) + 1e-9
        kept = (np.abs(quick) < limit).all(axis=1)
        return lagged_fit(t_s[kept], quick[kept], *against, LAGS_S) if kept.sum() >= least else None

    @cached_property
    def expectation_reliability(self) -> float:
        """The share of the expected flow's power that is no noise, by its own second differences as for white noise.

        Where the sensor has a gyro, no more than what that and the vehicle's have in common.
        """
        if self.expected_flow is None or self.flow is None:
            return 0.0
        t_s, expected = self.expected_flow
        inside = (t_s >= self.flight_s[0]) & (t_s <= self.flight_s[1])
        if inside.sum() < 50:
            return 0.0
        quick = expected[inside]
        rows = self._a_look(self.flow, t_s)
        sampled = quick[::rows]
        second = (sampled[2:] - 2.0 * sampled[1:-1] + sampled[:-2]) / np.sqrt(6.0)
        power = max(float(np.mean(sampled**2)), 1e-12)
        noise = (float(np.mean(second**2)) + self._shaken_flow) / power
        common = self.gyro_fit.share if self.gyro_fit is not None else 1.0
        return min(1.0 - noise, common)

    @cached_property
    def _shaken_flow(self) -> float:
        """The variance that the accelerometer's white noise, integrated and high-passed, adds to the expected flow
        [(rad/s)^2].
        """
        imu = self.stream(Sensor.IMU)
        if imu is None or self.ranges is None or self.inertial_velocity is None:
            return 0.0
        aloft = self.lifted(imu.t_s)
        force = imu.value[aloft, 3:5]
        if len(force) < LEAST_ROWS:
            return 0.0
        second = (force[2:] - 2.0 * force[1:-1] + force[:-2]) / np.sqrt(6.0)
        period = float(np.median(np.diff(imu.t_s)))
        times = np.arange(-4.0 * QUICK_S, 4.0 * QUICK_S, period)
        step: Array = np.where(times >= 0.0, period, 0.0)[:, None]
        response = high_pass(times, step, QUICK_S)[:, 0]
        inside = np.abs(times) < 2.0 * QUICK_S
        flown = self.ranges[1][self.lifted(self.ranges[0])]
        far_m = max(float(np.median(flown)), 0.15) if len(flown) else 1.0
        return float(np.mean(second**2) * np.sum(response[inside] ** 2) / far_m**2)

    @cached_property
    def flow_fit(self) -> Fit | None:
        """Flow against turning and translation by the inertial readings."""
        return self.quick_flow(FLOW_XY, self.expected_flow)

    @cached_property
    def gyro_fit(self) -> Fit | None:
        """The flow sensor's own gyro against the vehicle's rates."""
        if self.rates is None or self.flow is None:
            return None
        t_s, _ = self.rates
        return self.quick_flow(GYRO_XY, (t_s, high_pass(t_s, self._turning(self.flow), QUICK_S)))

    def _turning(self, flow: FlowSeen) -> Array:
        """The vehicle's turning about x and y (n, 2) at the instants of its rates, over the time of a flow reading."""
        assert self.rates is not None
        t_s, rates = self.rates
        level = self._a_look(flow, t_s)
        return np.column_stack([np.convolve(c, np.ones(level) / level, "same") for c in rates[:, :2].T])

    @staticmethod
    def _a_look(flow: FlowSeen, t_s: Array) -> int:
        """How many of these instants one flow reading takes."""
        return max(1, round(float(np.median(np.diff(flow.t_s))) / max(float(np.median(np.diff(t_s))), 1e-4)))

    @cached_property
    def flow_velocity(self) -> tuple[Array, Array] | None:
        """Body velocity forward and right (n, 2) by flow, range and the vehicle's own rates, of good readings."""
        if self.flow is None or self.ranges is None or self.rates is None:
            return None
        flow = self.flow
        good = (
            (flow.quality > 0.0) & flow.lifted & np.isfinite(flow.range_m) & np.isfinite(flow.value[:, :2]).all(axis=1)
        )
        if good.sum() < LEAST_ROWS:
            return None
        lag = self.gyro_fit.lag_s if self.gyro_fit is not None and self.gyro_fit.share > 0.3 else 0.05
        seen = flow.value[good, :2] - at(self.rates[0], self.rates[1][:, :2], flow.t_s[good] - lag)
        return flow.t_s[good] - lag, np.column_stack([seen[:, 1], -seen[:, 0]]) * flow.range_m[good, None]

    @cached_property
    def level_speed(self) -> tuple[Array, Array] | None:
        """The speed over ground by GPS, else by the navigator (n,)."""
        if self.gps_velocity is not None:
            return self.gps_velocity[0], np.hypot(*self.gps_velocity[1][:, :2].T)
        if self.base is None:
            return None
        return self.base.estimate_rows.t_s, np.hypot(*self.base.estimate_rows.vel_ned_m_s[:, :2].T)

    @cached_property
    def flow_tie(self) -> Tie | None:
        """The flow's velocity against GPS where the vehicle moved, turned to earth by the log's attitude."""
        if self.flow_velocity is None or self.gps_velocity is None or self.attitude is None:
            return None
        return tie_of(self, *self.flow_velocity)

    @cached_property
    def heading_tie(self) -> HeadingTie | None:
        """GPS velocity against the accelerometer's integral in earth axes; None where too little moves."""
        if self.gps_velocity is None or self.inertial_velocity is None:
            return None
        gps_s, gps = self.gps_velocity
        t_s, inertial = self.inertial_velocity
        inside = (gps_s >= self.flight_s[0] - 1.0) & (gps_s <= self.flight_s[1] + 1.0)
        if inside.sum() < 4 * START_ROWS:
            return None
        quick_gps = high_pass(gps_s[inside], gps[inside, :2], HEADING_S)
        quick = high_pass(t_s, inertial[:, :2], HEADING_S)
        fit = lagged_fit(gps_s[inside], quick_gps, t_s, quick, np.arange(-0.2, 1.6, 0.02))
        angle, gain, mirrored = turn_of(fit.matrix)
        sure = gain / max(float(np.sqrt(np.mean(fit.sigma**2))), 1e-9)
        if mirrored or sure < 4.0 or fit.share < 0.2:
            return None
        return HeadingTie(-angle, fit.lag_s, sure)

    # -- what identification measures ----------------------------------------------------------------------------
    @cached_property
    def measured(self) -> Measured | None:
        """The flow's gains and offset against the log's reference, else GPS; None where neither shows them."""
        if self.log.truth is None and self.gps_velocity is None:
            return None
        try:
            return measured(self.log, "gps" if self.log.truth is None else "truth")
        except (InputError, np.linalg.LinAlgError):
            return None

    @cached_property
    def measured_by_gps(self) -> Measured | None:
        """The same against GPS beside a reference; None without either."""
        if self.log.truth is None or self.gps_velocity is None:
            return None
        try:
            return measured(self.log, "gps")
        except (InputError, np.linalg.LinAlgError):
            return None

    @cached_property
    def own_gyro(self) -> OwnGyro | None:
        """How fast the flow sensor's own gyro turns beside the vehicle's."""
        return own_gyro(self.log)

    # -- the autopilot -------------------------------------------------------------------------------------------
    def events_of(self, kind: str) -> list[tuple[float, float]]:
        """Times and values of the log's events of one kind."""
        return [(row.t_s, row.value) for row in self.log.happened if row.kind == kind]

    def source_set_at(self, t_s: Array) -> Array:
        """The number of EKF3's source set at instants; 1 until the log reports another."""
        switched = self.events_of(SOURCE_SET)
        times = np.array([-np.inf, *(t for t, _ in switched)])
        numbers = np.array([1.0, *(value for _, value in switched)])
        return np.asarray(numbers[np.searchsorted(times, t_s, side="right") - 1])

    @cached_property
    def fused_share(self) -> float | None:
        """The share of the flight in which the autopilot's filter took the flow; None where the log does not report
        it.
        """
        events = self.events_of(FUSES_FLOW)
        if not events:
            return None
        grid = np.arange(*self.flight_s, 0.1)
        times, values = np.array([t for t, _ in events]), np.array([value for _, value in events])
        row = np.searchsorted(times, grid, side="right") - 1
        return float(np.mean(np.where(row >= 0, values[np.maximum(row, 0)], 0.0))) if len(grid) else None

    @cached_property
    def clipped(self) -> float | None:
        """How many accelerometer samples the vehicle counted as clipped until it landed; None where it reports none."""
        events = [(t, value) for t, value in self.events_of(CLIPPING) if t <= self.flight_s[1]]
        return events[-1][1] - events[0][1] if events else None

    @cached_property
    def shaken_m_s2(self) -> float:
        """The level of vibration that the vehicle reported over at least two seconds of its flight; 0 where it reports
        none.
        """
        shakes = [(t, v) for t, v in self.events_of(VIBRATION) if t <= self.flight_s[1]]
        ends = [t for t, _ in shakes[1:]] + [self.flight_s[1]]
        held = [v for (t, v), end in zip(shakes, ends, strict=False) if end - max(t, self.flight_s[0]) >= SHAKEN_S]
        return max(held, default=0.0)

    # -- the second navigator ------------------------------------------------------------------------------------
    @cached_property
    def options(self) -> ReplayOptions:
        """The options of the log's replay: with the GPS delay of the autopilot's parameters, where they state one."""
        delay = self.own_settings.gps_delay_s
        return ReplayOptions() if delay is None or not 0.0 < delay <= 1.0 else ReplayOptions(gps_delay_s=delay)

    @cached_property
    def base(self) -> Replay | None:
        """The log as it is through the navigator; None where it cannot be replayed."""
        return self.replayed(self.log.streams, self.options)

    def replayed(self, streams: dict[Sensor, Stream], options: ReplayOptions) -> Replay | None:
        """The log with other streams through the navigator; None where it cannot be replayed."""
        try:
            return replay(replace(self.log, streams=streams, fed=()), options, NavigatorSettingsFile())
        except InputError:
            return None
