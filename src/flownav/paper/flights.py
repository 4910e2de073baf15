"""Section V of the paper: many take-offs and landings, scored as Tables 5 and 6 are, and one of each to draw."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from flownav.campaigns.local import fly_many, median_flight, score_history
from flownav.core.compile import LANES
from flownav.core.measurement import Array
from flownav.core.parameter_files import check
from flownav.core.record import Record
from flownav.lab.optics.firmware import EARLY_GYRO_SCALE
from flownav.lab.rig.instruments import SONAR_ECHO_S, SONAR_PERIOD_S
from flownav.scoring.errors import STATES, percentile_of_paper, published, scores_of_flight, scores_of_flights
from flownav.scoring.percentiles import spread
from flownav.simulation.assemble import Setup, assemble
from flownav.simulation.engine import fly_blocks, fly_written
from flownav.simulation.flight_record import record_of
from flownav.simulation.history import column
from flownav.simulation.plan import Flight
from flownav.simulation.scenario import Scenario, load_scenario, with_filter
from flownav.simulation.sensing import EPOCH_S

REACH_S = (-1.0, 3.0)  # about lift-off: where its transient is
LIFT_OFFS = 96


class LiftOff(NamedTuple):
    """Largest error in w about lift-off [m/s], a row a flight: as flown, and the same flights without shake."""

    shaken_m_s: Array
    unshaken_m_s: Array

    @property
    def frozen_inflow_share(self) -> Array:
        """Share of the largest error that remains without the sensor's shake, which is due to the frozen inflow of
        B_red.
        """
        return self.unshaken_m_s / self.shaken_m_s

    def as_json(self) -> dict[str, Any]:
        """Median, 5th and 95th percentile of each."""
        spreads = {name: spread(getattr(self, name)) for name in (*self._fields, "frozen_inflow_share")}
        return {"flights": len(self.shaken_m_s), **spreads}


def lift_offs(shaken: Flight, unshaken: Flight, seed: int, flights: int) -> LiftOff | None:
    """The first flights of a seed on both sensors, LIFT_OFFS of them at most; None where nothing lifts off."""
    if not shaken.plan.starts_on_ground:
        return None
    count = min(flights, LIFT_OFFS)
    both = (
        np.concatenate([block for _, block in fly_blocks(flight, seed, 0, count, largest_w_errors)])
        for flight in (shaken, unshaken)
    )
    return LiftOff(*both)


def largest_w_errors(history: Array) -> Array:
    """Largest absolute error in w within REACH_S of each lane's first lift-off [m/s], (lanes,)."""
    error = np.abs(history[:, column("estimate", "vel_w_m_s")] - history[:, column("truth", "vel_w_m_s")])
    lifted = np.argmax(history[:, column("truth", "contact_n")] <= 0.0, axis=0)
    before, after = (round(reach_s / EPOCH_S) for reach_s in REACH_S)
    steps = np.arange(len(error))[:, None] - lifted
    return np.asarray(np.where((steps >= before) & (steps <= after), error, 0.0).max(axis=0))


SCENARIOS = {5: "takeoff", 6: "landing"}
HONEST_GPS = "midg"
# what the rig's sensor has: rotation that its gyro leaves, and a sonar that is an echo and half a period old
RIG_ERRORS = {"rotation_leak": 1.0 - EARLY_GYRO_SCALE, "sonar_lag_s": SONAR_ECHO_S + 0.5 * SONAR_PERIOD_S}


@dataclass(frozen=True)
class Flights:
    """Flights of one scenario beside its table. honest: scores with a receiver of 2 m CEP; leaking: with RIG_ERRORS.

    white_noise_m: standard deviation of an axis of the GPS noise flown; lift_off: of take-offs.
    """

    table: int
    scenario: str
    flights: int
    published: dict[str, Any]
    scores: dict[str, Any]
    percentile: dict[str, Any]
    honest: dict[str, Any]
    leaking: dict[str, Any]
    record: Record
    white_noise_m: float
    lift_off: LiftOff | None = None

    @property
    def what(self) -> str:
        """Name of the flight, in a word."""
        return {"takeoff": "take-off"}.get(self.scenario, self.scenario)

    def as_json(self) -> dict[str, Any]:
        """The table's rows: published and reproduced, each state, and where the paper lies among our flights."""
        states = {
            state: {
                f"{statistic}_{source}": table[state][statistic]
                for statistic in ("mean_error", "std_error")
                for source, table in (("published", self.published["states"]), ("reproduced", self.scores["states"]),
                                      ("percentile", self.percentile["states"]))
            }
            | {"max_error_reproduced": self.scores["states"][state]["max_error"]}
            for state in STATES
        }  # fmt: skip
        return {
            "flights": self.flights,
            "states": states,
            "max_position_error_published_m": self.published["max_position_error_m"],
            "max_position_error_reproduced_m": self.scores["max_position_error_m"],
            "max_position_error_percentile": self.percentile["max_position_error_m"],
            "max_position_error_with_2_m_cep_m": self.honest["max_position_error_m"],
            "with_errors_of_the_rig": RIG_ERRORS
            | {name: self.leaking[name] for name in ("states", "max_position_error_m")},
            "touchdown_reproduced": self.scores["touchdown"],
            "touchdown_with_2_m_cep": self.honest["touchdown"],
            "lift_off": None if self.lift_off is None else self.lift_off.as_json(),
        }


def fly_table(
    table: int, seed: int, flights: int, on_progress: Callable[[int], object] = lambda flown: None
) -> Flights:
    """Table 5 or 6, the paper's filter: `flights` flights with its GPS noise, as many with 2 m CEP, as many with
    a sensor that errs as the rig's does, one recorded."""
    name = SCENARIOS[table]
    scenario = with_filter(load_scenario(name), "paper")
    setup = assemble(scenario)
    rows = _flown(setup.flight, seed, flights, on_progress)
    honest = assemble(_with(scenario, "gps", {"model": HONEST_GPS}))
    median = median_flight(rows)
    record = _recorded(setup, seed, median, table)
    flow = scenario.flow.model_dump(exclude_unset=True)
    unshaken = assemble(_with(scenario, "flow", flow | {"shake": False})).flight
    leaking = assemble(_with(scenario, "flow", flow | RIG_ERRORS)).flight
    printed = published(table)
    assert printed is not None
    honestly = scores_of_flights(_flown(honest.flight, seed, flights, on_progress))
    leaked = scores_of_flights(_flown(leaking, seed, flights, on_progress))
    lifted, white_m = lift_offs(setup.flight, unshaken, seed, flights), float(scenario.gps.white_sigma_m)
    scores, percentile = scores_of_flights(rows), percentile_of_paper(rows, printed)
    return Flights(table, name, flights, printed, scores, percentile, honestly, leaked, record, white_m, lifted)


def _flown(flight: Any, seed: int, flights: int, on_progress: Callable[[int], object]) -> Array:
    return fly_many(flight, seed, flights, on_progress=lambda flown: (on_progress(flown), None)[1])


def _recorded(setup: Setup, seed: int, index: int, table: int) -> Record:
    """One flight as a scored Record, by the kernel that flew them all: that of a single flight compiles for 10 s."""
    flown = fly_written(setup.flight, seed, index, LANES)
    record = record_of(setup, flown, seed, index)
    record.manifest["scores"] = scores_of_flight(score_history(setup.flight, flown.history)[0])
    record.manifest["paper"] = published(table)
    return record


def _with(scenario: Scenario, table: str, values: dict[str, Any]) -> Scenario:
    """The scenario with another table."""
    entries = scenario.model_dump(exclude_unset=True)
    return check(entries | {table: values}, Scenario, f"{scenario.name} with another [{table}]")
