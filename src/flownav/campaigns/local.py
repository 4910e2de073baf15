"""Flights on this machine, scored as they land, and a scenario's envelope."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from flownav.core.measurement import Array
from flownav.core.parameter_files import check
from flownav.core.record import POSITION_NED, QUATERNION, VELOCITY_BODY, Record
from flownav.scoring import errors
from flownav.scoring.consistency import largest_horizontal_error
from flownav.scoring.landings import (
    CONTACT_DISTANCE,
    REST_DISTANCE,
    crashed,
    radius,
    success,
    takeoff_of_flight,
    takeoffs,
    with_reason,
)
from flownav.scoring.recorded import attitude_of
from flownav.scoring.touchdown import Limits, motion_of, touchdowns
from flownav.simulation.assemble import Setup, assemble
from flownav.simulation.engine import Flown, fly_blocks, fly_written
from flownav.simulation.ensemble import Ensemble
from flownav.simulation.flight_record import record_of
from flownav.simulation.history import column, columns
from flownav.simulation.plan import Flight
from flownav.simulation.scenario import Scenario
from flownav.simulation.sensing import EPOCH_S
from flownav.simulation.truth import SensorFault


def score_history(flight: Flight, history: Array) -> Array:
    """The scores of a block's flights, (lanes, len(SCORE_COLUMNS)); history (epochs, len(HISTORY), lanes)."""
    estimate = history[:, columns("estimate", (*POSITION_NED, *VELOCITY_BODY))]
    truth = history[:, columns("truth", (*POSITION_NED, *VELOCITY_BODY))]
    return errors.score_block(estimate, truth, touchdown_history(flight, history), counted_steps(flight, history))


def touchdown_history(flight: Flight, history: Array) -> Array:
    """The touchdowns of a block's flights, (lanes, len(TOUCHDOWN_COLUMNS)).

    Lane by lane: what this computes of a history stays in the cache, and takes 6 MB less of a campaign's peak.
    """
    lanes = range(history.shape[2])
    return np.concatenate([_touchdown_of_lane(flight, history[:, :, lane : lane + 1]) for lane in lanes])


def _touchdown_of_lane(flight: Flight, history: Array) -> Array:
    position = history[:, columns("truth", POSITION_NED)]
    flown = position if flight.plan.fly_on_truth else history[:, columns("estimate", POSITION_NED)]
    motion = motion_of(
        position,
        history[:, columns("truth", VELOCITY_BODY)],
        history[:, columns("truth", QUATERNION)],
        history[:, column("truth", "rate_r_rad_s")],
        (history[:, column("truth", "contact_n")] > 0.0).astype(float),
        flight.vehicle.cg_above_skid_m,
    )
    t_s: Array = np.arange(len(history), dtype=np.float64) * EPOCH_S
    error, seen = (flown - position)[:, :2], pad_to_be_seen(flight, t_s, motion.cg_height_m)
    motion = motion._replace(cg_height_m=motion.cg_height_m - history[:, column("truth", "ground_m")])
    limits, away = Limits(**flight.limits._asdict()), history[:, column("autopilot", "away")]
    return touchdowns(t_s, motion, error, seen, away, limits, flight.plan.may_land_after_s)


def pad_to_be_seen(flight: Flight, t_s: Array, cg_height_m: Array) -> Array:
    """Where the vehicle can still see its pad, or is still given its place, (epochs, lanes) 0/1.

    With a pad camera down to its least height; without one until the hand-over, and of the paper's filter until it last
    notes its home.
    """
    onboard = flight.onboard
    if onboard is not None and onboard.carried.pad_camera.clock.fitted:
        camera = onboard.carried.pad_camera
        lens_m = cg_height_m - camera.place.down_m
        return np.asarray((lens_m >= camera.p.min_height_m) & (lens_m <= camera.p.max_height_m), float)
    last_s = flight.plan.handover_s if onboard is not None else (home_epoch(flight) or 0) * EPOCH_S
    return np.asarray(np.broadcast_to((t_s <= last_s)[:, None], cg_height_m.shape), float)


def takeoff_history(flight: Flight, history: Array) -> Array | None:
    """The take-offs of a block's flights, (lanes, len(TAKEOFF_COLUMNS)); None of flights that start in the air."""
    if not flight.plan.starts_on_ground:
        return None
    above = flight.vehicle.cg_above_skid_m
    height_m = -history[:, column("truth", "pos_d_m")] - above
    commanded_m = -history[:, column("command", "pos_d_ref_m")] - above
    return takeoffs(height_m, commanded_m, history[:, column("flow", "engaged")], EPOCH_S)


def home_epoch(flight: Flight) -> int | None:
    """The step at which the paper's filter last notes where its pad is.

    None where it takes the filter's origin for it, and for the navigator, whose estimate is counted from there.
    """
    if flight.onboard is not None or not flight.plan.home_at_start:
        return None
    parked = flight.plan.starts_on_ground and flight.plan.takeoff_at_s > 0.0
    last = int(np.ceil(flight.plan.takeoff_at_s / EPOCH_S)) - 1 if parked else 0
    return min(last, flight.plan.epochs - 1)


def counted_steps(flight: Flight, history: Array) -> Array:
    """The steps whose errors are scored, (epochs, lanes) 0/1: of the paper's filter all, as the paper has it.

    Of the navigator those in flight after the hand-over: until then the autopilot uses the truth, or the vehicle stands
    on its skids, and the estimate in use has no error by definition; on the ground again, it is not used.
    """
    contact = history[:, column("truth", "contact_n")]
    if flight.onboard is None:
        return np.ones_like(contact)
    after_handover = np.arange(len(history)) * EPOCH_S >= flight.plan.handover_s
    return np.asarray(after_handover[:, None] & (contact <= 0.0), float)


def fly_many(
    flight: Flight,
    seed: int,
    flights: int,
    *,
    first: int = 0,
    ensemble: Ensemble | None = None,
    threads: int | None = None,
    on_progress: Callable[[int], None] = lambda flown: None,
) -> Array:
    """The scores of flights `first` to `first + flights - 1`, (flights, len(SCORE_COLUMNS)); matched or drawn."""
    scores = np.empty((flights, len(errors.SCORE_COLUMNS)))
    done = 0

    def judge(history: Array) -> Array:
        return score_history(flight, history)

    for flown, block in fly_blocks(flight, seed, first, flights, judge, threads, ensemble):
        scores[done : done + flown] = block
        done += flown
        on_progress(flown)
    return scores


def known_exactly(scenario: Scenario) -> str:
    """The exact knowledge that a scenario's vehicle is given and a real one would have to find out, in words."""
    if scenario.flight.start == "ground":
        return f"its position on the ground until take-off at {scenario.flight.takeoff_at_s:g} s"
    held_s = float(scenario.filter.handover_s)
    if scenario.autopilot.home == "start":
        return f"its position in hover for the first {held_s:g} s (true state used)"
    return f"nothing (true state used for the first {held_s:g} s)"


def fly_recorded(
    setup: Setup, seed: int, index: int = 0, ensemble: Ensemble | None = None, fault: SensorFault | None = None
) -> Record:
    """One flight as a scored Record; of an ensemble with the numbers that were drawn for it.

    fault: of its sensors, where the setup's flight `fails`.
    """
    flown = fly_written(setup.flight, seed, index, ensemble=ensemble, faults=None if fault is None else [fault])
    drawn = None
    if ensemble is not None:
        drawn = {name: values[0] for name, values in ensemble.values(seed, index, 1).items()}
    return record_flown(setup, flown, seed, index, drawn)


def record_flown(setup: Setup, flown: Flown, seed: int, index: int, drawn: dict[str, float] | None) -> Record:
    """A flight that was flown alone, as a scored Record. drawn: the numbers of an ensemble's flight by dotted name."""
    record = record_of(setup, flown, seed, index)
    record.manifest["truth_model"] = "matched" if drawn is None else "ensemble"
    if drawn is not None:
        record.manifest["parameters"] = {**record.manifest["parameters"], "drawn": drawn}
    up = takeoff_history(setup.flight, flown.history)
    table, facts = judging_table(setup.flight, flown.history), judging_facts(setup.flight)
    above_m = -flown.history[-1, column("truth", "pos_d_m"), 0] - table["ground_m"][-1]
    scores = errors.scores_of_flight(score_history(setup.flight, flown.history)[0])
    record.manifest["scores"] = with_reason(scores, float(above_m) - facts["cg_above_skid_m"], facts)
    record.manifest["scores"]["takeoff"] = None if up is None else takeoff_of_flight(up[0])
    record.add("judging", table)
    record.manifest["judging"] = facts
    flown_on = record.tables.get("flown", record.tables["estimate"])
    record.manifest["scores"]["attitude_deg"] = attitude_of(record, flown_on)
    record.manifest["paper"] = errors.published(setup.scenario.paper_table)
    if setup.fitted is not None:
        record.manifest["known_exactly"] = known_exactly(setup.scenario)
    return record


def judging_table(flight: Flight, history: Array) -> dict[str, Array]:
    """The table that scoring needs next to truth and estimate, as `record.TABLES` defines it; history of one lane."""
    t_s: Array = np.arange(len(history), dtype=np.float64) * EPOCH_S
    height_m = -history[:, column("truth", "pos_d_m")]
    return {
        "t_s": t_s,
        "ground_m": history[:, column("truth", "ground_m"), 0],
        "away": history[:, column("autopilot", "away"), 0],
        "pad_seen": pad_to_be_seen(flight, t_s, height_m)[:, 0],
        "counted": counted_steps(flight, history)[:, 0],
        "sees_flow": history[:, column("flow", "engaged"), 0],
    }


def judging_facts(flight: Flight) -> dict[str, Any]:
    """Numbers of a flight that its scores need."""
    plan = flight.plan
    return {
        "cg_above_skid_m": float(flight.vehicle.cg_above_skid_m),
        "may_land_after_s": float(plan.may_land_after_s),
        "handover_s": float(plan.handover_s),
        "align_height_m": float(flight.gains.align_height_m),
        "search_height_m": float(flight.gains.search_height_m),
        "starts_on_ground": bool(plan.starts_on_ground),
        "flown_on_truth": bool(plan.fly_on_truth),
        "limits": {name: float(limit) for name, limit in flight.limits._asdict().items() if np.isfinite(limit)},
    }


def median_flight(scores: Array) -> int:
    """The index of the flight whose largest position error is the (lower) median."""
    order = np.argsort(scores[:, errors.MAX_POSITION_ERROR], kind="stable")
    return int(order[(len(order) - 1) // 2])


# -- rows of a campaign ------------------------------------------------------------------------------------------
def rows_of(flight: Flight, history: Array) -> Array:
    """The rows of a block's flights, (lanes, len(ROW_COLUMNS)); history (epochs, len(HISTORY), lanes)."""
    return np.column_stack([score_history(flight, history), largest_horizontal_m(flight, history)])


def largest_horizontal_m(flight: Flight, history: Array) -> Array:
    """The largest horizontal error in flight of the estimate that each flight's autopilot used [m], (lanes,).

    It is relative to the believed place of the pad, and counted from there on.
    """
    home, epoch = home_epoch(flight), np.arange(len(history))[:, None]
    aloft = (history[:, column("truth", "contact_n")] <= 0.0) & (epoch >= (home or 0))
    counted = counted_steps(flight, history) * aloft
    estimate, truth = history[:, columns("estimate", POSITION_NED)], history[:, columns("truth", POSITION_NED)]
    return largest_horizontal_error(estimate, truth, home, counted)


# -- over the wind -----------------------------------------------------------------------------------------------
def directions_deg(count: int) -> list[float]:
    """`count` directions, even over the circle, from north on [deg]."""
    return [360.0 * k / count for k in range(count)]


def fly_envelope(
    scenario: Scenario,
    speeds_m_s: Sequence[float],
    directions: Sequence[float],
    seed: int,
    flights: int,
    *,
    dispersed: bool,
    on_progress: Callable[[int], None] = lambda flown: None,
) -> list[dict[str, Any]]:
    """A row for each speed at 20 ft [m/s] and direction [deg], of `flights` flights, the same noise in each.

    dispersed: of an ensemble whose vehicle and sensors are drawn; the wind is the cell's, and is not.
    """
    rows = []
    for speed in speeds_m_s:
        for direction in directions:
            setup = in_wind(scenario, speed, direction)
            ensemble = setup.ensemble() if dispersed else None
            scores = fly_many(setup.flight, seed, flights, ensemble=ensemble, on_progress=on_progress)
            landings = errors.touchdown_rows(scores)
            rows.append(
                {
                    "speed_20ft_m_s": speed,
                    "from_direction_deg": direction,
                    "success": success(landings),
                    "crashed": int(crashed(landings).sum()),
                    "contact": radius(landings, CONTACT_DISTANCE),
                    "rest": radius(landings, REST_DISTANCE),
                }
            )
    return rows


def in_wind(scenario: Scenario, speed_m_s: float, direction_deg: float) -> Setup:
    """The scenario in this wind, which its dispersion leaves alone; gusts as the scenario has them."""
    wind = scenario.wind.model_dump() | {"speed_20ft_m_s": speed_m_s, "from_direction_deg": direction_deg}
    setup = assemble(check(scenario.model_dump(exclude_unset=True) | {"wind": wind}, Scenario, scenario.name))
    still = {name: entry for name, entry in setup.dispersion.items() if not name.startswith("wind.")}
    return replace(setup, dispersion=still)
