"""Scores flights: the estimate used by the autopilot for accuracy, the navigator at its horizon for consistency, its
bound, and the same flights without one piece of its knowledge or one sensor.

The autopilot uses the estimate of now, relative to the believed place of the pad. The navigator's own estimate stands
at its horizon, some 0.1 s ago and in its own frame, whose origin GPS has set: there it states its covariance, and only
there errors and covariance can be compared.

The worth of each piece is the loss without it: the autopilot uses the poorer estimate. A piece of knowledge is removed
by giving the navigator another setting, a sensor by not carrying it; the code that flies is the same. There is no
variant without "ground-effect knowledge", since the navigator has none to lose: the IMU measures the force that the
ground adds. There is none without an IMU, either: nothing else gives the attitude.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from flownav.campaigns.local import counted_steps, largest_horizontal_m, score_history, takeoff_history
from flownav.core.measurement import Array, Sensor
from flownav.core.record import POSITION_NED, QUATERNION, VELOCITY_BODY
from flownav.core.text import finite, finite_or_none
from flownav.navigation.kernel_settings import FlowNoise
from flownav.navigation.settings_of import GivenSettings
from flownav.scoring import consistency
from flownav.scoring.errors import attitude_block
from flownav.sensors.flow import flow_noise_sigma
from flownav.sensors.noise_law import constant_noise
from flownav.simulation.assemble import Setup
from flownav.simulation.engine import fly_blocks
from flownav.simulation.ensemble import Ensemble
from flownav.simulation.fitting import Fitted, Timing, refitted
from flownav.simulation.history import column, columns
from flownav.simulation.onboard import without
from flownav.simulation.plan import Flight

STATES = (*POSITION_NED, *VELOCITY_BODY)
STD = tuple(f"std_{name}" for name in STATES)
HORIZON = tuple(f"error_{name}" for name in STATES)
BOUND_FLIGHTS = 64  # the covariance hardly differs from flight to flight


@dataclass(frozen=True)
class Judged:
    """The result of a batch of flights: a row of scores and a largest horizontal error for each flight, and sums.

    scores (flights, len(SCORE_COLUMNS)); largest_horizontal_m (flights,), in flight and relative to where the vehicle
    takes its pad to be; flown: errors in flight of the estimate used by the autopilot; sums: of the navigator at its
    horizon; groups: those of each GROUP_FLIGHTS flights one after the other (of all where there are fewer; a remainder
    is left out). These two are None for a filter that states no consistency. takeoffs: (flights, len(TAKEOFF_COLUMNS)),
    None of flights that start in the air. attitude_deg: (flights, 3, len(STATISTICS)), of the estimate used by the
    autopilot.
    """

    scores: Array
    largest_horizontal_m: Array
    flown: consistency.ErrorSums
    sums: consistency.ConsistencySums | None
    groups: tuple[consistency.ConsistencySums, ...] | None
    takeoffs: Array | None = None
    attitude_deg: Array | None = None


@dataclass(frozen=True)
class Bound:
    """Mean over flights of the bound: variance (epochs, 6) of position NED and body velocity, and sums in flight.

    The first row is the horizon's at the start of the flight.
    """

    variance: Array
    sums: consistency.ErrorSums


def fly_judged(
    flight: Flight,
    seed: int,
    flights: int,
    *,
    ensemble: Ensemble | None = None,
    threads: int | None = None,
    on_progress: Callable[[int], object] = lambda flown: None,
) -> Judged:
    """Fly flights 0 to `flights - 1`, matched or of an ensemble, and judge them; memory grows by a row a flight."""

    def judge(
        history: Array,
    ) -> tuple[Array, Array, consistency.ErrorSums, consistency.ConsistencySums | None, Array | None, Array]:
        estimate = history[:, columns("estimate", STATES)]
        truth = history[:, columns("truth", STATES)]
        counted = counted_steps(flight, history)
        in_flight = counted * (1.0 - _on_ground(history))
        flown = consistency.error_sums((estimate - truth) ** 2, _skid_height(flight, history), in_flight)
        up, largest = takeoff_history(flight, history), largest_horizontal_m(flight, history)
        estimated, true = (history[:, columns(table, QUATERNION)] for table in ("estimate", "truth"))
        turned = attitude_block(estimated, true, counted)
        return score_history(flight, history), largest, flown, _at_horizon(flight, history), up, turned

    rows, largest, groups, ups, attitudes = [], [], [], [], []
    total: consistency.ConsistencySums | None = None
    group: consistency.ConsistencySums | None = None
    flown_on: consistency.ErrorSums | None = None
    for flown, judgement in fly_blocks(flight, seed, 0, flights, judge, threads, ensemble):
        scores, horizontal, errors, sums, up, turned = judgement
        rows.append(scores)
        attitudes.append(turned)
        if up is not None:
            ups.append(up)
        largest.append(horizontal)
        flown_on = errors if flown_on is None else flown_on + errors
        if sums is not None:
            total = sums if total is None else total + sums
            group = sums if group is None else group + sums
            if group.flights >= consistency.GROUP_FLIGHTS:
                groups.append(group)
                group = None
        on_progress(flown)
    assert flown_on is not None
    in_groups = None if total is None else tuple(groups) or (total,)
    every = np.concatenate(ups) if ups else None
    attitude = np.concatenate(attitudes)
    return Judged(np.concatenate(rows), np.concatenate(largest), flown_on, total, in_groups, every, attitude)


def _at_horizon(flight: Flight, history: Array) -> consistency.ConsistencySums | None:
    """The navigator's consistency: its errors and their squares over what it states, where it stands."""
    if flight.table is None:
        return None
    behind = flight.table.horizon_epochs
    error, nees = history[behind:, columns("horizon", HORIZON)], history[behind:, column("estimate", "nees")]
    sigma = history[behind:, columns("estimate", STD)]
    then = history[: len(history) - behind]
    return consistency.consistency_of_block(error, sigma, nees, _skid_height(flight, then), _on_ground(then))


def bound_of(setup: Setup, seed: int, flights: int, *, threads: int | None = None) -> Bound:
    """The posterior Cramér-Rao bound of the navigator's own model, mean over flights.

    Each flight flies on the truth with every Jacobian taken there (`FlightPlan.along_truth`), so that the covariance is
    the bound along that flight. ValueError where the paper's filter flies.
    """
    table = setup.flight.table
    if table is None:
        raise ValueError(f"{setup.scenario.name}: the bound is the navigator's, and it does not fly")
    flight = setup.flight._replace(plan=setup.flight.plan._replace(fly_on_truth=True, along_truth=True))
    behind = table.horizon_epochs

    def judge(history: Array) -> tuple[Array, consistency.ErrorSums]:
        running = np.isfinite(history[behind:, column("estimate", "nees")])
        variance = np.where(running[:, None], history[behind:, columns("estimate", STD)] ** 2, 0.0)
        then = history[: len(history) - behind]
        sums = consistency.error_sums(variance, _skid_height(flight, then), running * (1.0 - _on_ground(then)))
        return variance.sum(axis=2), sums

    variance, total = np.zeros((flight.plan.epochs - behind, len(STD))), None
    for _, (block, sums) in fly_blocks(flight, seed, 0, flights, judge, threads):
        variance += block
        total = sums if total is None else total + sums
    assert total is not None
    return Bound(variance / flights, total)


def consistency_facts(judged: Judged, bound: Bound) -> dict[str, Any]:
    """Consistency figures of many flights of the navigator for `flownav fly`; null where no flight flew."""
    assert judged.groups is not None
    assert judged.sums is not None
    inside = consistency.within_band(judged.groups, judged.sums).as_stated
    return {
        "rmse_over_bound": finite(consistency.efficiency(judged.sums.errors, bound.sums)),
        "anees_inside_fraction": finite_or_none(inside),
        "error_over_stated": finite(consistency.over_stated(judged.sums)),
    }


def _skid_height(flight: Flight, history: Array) -> Array:
    return -history[:, column("truth", "pos_d_m")] - flight.vehicle.cg_above_skid_m


def _on_ground(history: Array) -> Array:
    return np.asarray(history[:, column("truth", "contact_n")] > 0.0, float)


def ablations(setup: Setup) -> dict[str, Flight]:
    """The variants that differ from the whole navigator in this scenario, by what they lack.

    ValueError where the paper's filter flies.
    """
    base = setup.fitted
    if base is None:
        raise ValueError(f"{setup.scenario.name}: only the navigator can be taken apart")
    given = base.given
    variants = {
        "flow's age": _with(setup, stated=base.timing | {Sensor.FLOW_RATE: ageless(base)}),
        "height schedule": _with(setup, given=given._replace(noise=constant_flow_noise(given.noise))),
        "compass deviation": _with(setup, given=without_compass_states(given)),
    }
    if setup.scenario.gps.model != "white":
        variants["GPS error states"] = _with(setup, given=without_gps_states(given))
    variants["barometer"] = _without(setup, "barometer")
    if setup.scenario.pad_fix is not None:
        variants["pad fix"] = _without(setup, "pad_camera")
    variants["flow"] = _without(setup, "flow_camera")
    return variants


def _with(setup: Setup, **changed: Any) -> Flight:
    """The flight with other settings of the navigator, or another equipment of the vehicle."""
    assert setup.fitted is not None
    other = refitted(setup.fitted, setup.flight.plan.epochs, **changed)
    return setup.flight._replace(onboard=other.onboard, table=other.schedule, settings=other.settings)


def _without(setup: Setup, sensor: str) -> Flight:
    """The flight of a vehicle that does not carry this sensor; the horizon stays."""
    assert setup.fitted is not None
    return _with(setup, onboard=without(setup.fitted.onboard, sensor))


def ageless(base: Fitted) -> Timing:
    """Timing of a flow sensor that is stated to show the velocity of now: no lag of its own, no latency; its jitter
    stays.
    """
    return Timing(0.0, 0.0, base.timing[Sensor.FLOW_RATE].jitter_s)


def constant_flow_noise(noise: FlowNoise) -> FlowNoise:
    """The sensor's noise taken for the same at every height: its root mean square over the identified ones."""
    heights = np.linspace(noise.noise_low_m, noise.noise_high_m, 200)
    squares = [flow_noise_sigma(float(h), noise) ** 2 for h in heights]  # type: ignore[arg-type]  # the noise alone
    law = constant_noise(math.sqrt(float(np.mean(squares))), noise.noise_low_m, noise.noise_high_m)
    coefficients = {f"noise_{i}": value for i, value in enumerate(law.coefficients)}
    return noise._replace(noise_centre=law.centre, noise_scale=law.scale, **coefficients)


def without_gps_states(given: GivenSettings) -> GivenSettings:
    """No memory of GPS errors: all of their variance is taken for white noise."""
    s = given.settings
    return given._replace(
        settings=s.model_copy(
            update={
                "gps_slow_sigma_m": 0.0,
                "gps_slow_sigma_down_m": 0.0,
                "gps_fast_sigma_m": 0.0,
                "gps_fast_sigma_down_m": 0.0,
                "gps_velocity_sigma_m_s": 0.0,
                "gps_white_sigma_m": math.hypot(s.gps_white_sigma_m, s.gps_slow_sigma_m, s.gps_fast_sigma_m),
                "gps_white_sigma_down_m": math.hypot(
                    s.gps_white_sigma_down_m, s.gps_slow_sigma_down_m, s.gps_fast_sigma_down_m
                ),
                "gps_velocity_white_m_s": math.hypot(s.gps_velocity_white_m_s, s.gps_velocity_sigma_m_s),
                "gps_velocity_white_down_m_s": math.hypot(s.gps_velocity_white_down_m_s, s.gps_velocity_sigma_m_s),
            }
        )
    )


def without_compass_states(given: GivenSettings) -> GivenSettings:
    """No deviation that turns with the vehicle: all of it is taken for noise of the heading, as lasting as the rest."""
    s = given.settings
    noise = min(math.hypot(s.heading_noise_rad, s.compass_sigma_rad), math.pi)
    return given._replace(settings=s.model_copy(update={"compass_sigma_rad": 0.0, "heading_noise_rad": noise}))
