"""From one flight to its Record: the truth, the estimates and those that the autopilot used, readings, innovations,
events.

A flight on the navigator keeps the readings that the navigator was fed, so that `flownav replay` of the record runs the
same navigator on the same readings.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flownav.control.learning import VERDICTS
from flownav.core.measurement import COLUMNS, Array, Sensor
from flownav.core.provenance import command_line, provenance
from flownav.core.record import FED, POSITION_NED, PROTECTION_LEVELS, QUATERNION, TABLES, VELOCITY_BODY, Record, Table
from flownav.core.text import finite
from flownav.navigation.records import Reading
from flownav.navigation.tables import estimate_table, happenings, innovation_table, states_table
from flownav.simulation.assemble import Setup
from flownav.simulation.engine import Flown
from flownav.simulation.history import HISTORY
from flownav.simulation.scenario import EventSection
from flownav.simulation.sensing import EPOCH_S, RANGE_EPOCHS

GATE_SIGMA_SHOWN = 3.0  # the paper's filter has no gate: its test ratios are shown against 3 sigma and all are fused


def record_of(setup: Setup, flown: Flown, seed: int, index: int, lane: int = 0) -> Record:
    """The record of flight `index`, not yet scored: lane `lane` of a block that was flown with everything written."""
    history = {key: flown.history[:, i, lane] for i, key in enumerate(HISTORY)}
    t_s: Array = np.arange(len(flown.history), dtype=np.float64) * EPOCH_S
    record = Record(_manifest(setup, seed, index, float(t_s[-1])) | _learnt(setup, flown, lane))

    def table(name: str, source: str, columns: tuple[str, ...], rows: Any = slice(None), **more: Array) -> None:
        record.add(name, {"t_s": t_s[rows], **{c: history[source, c][rows] for c in columns}, **more})

    truth = tuple(c for c in TABLES["truth"] if c != "on_ground")
    table("truth", "truth", truth, on_ground=(history["truth", "contact_n"] > 0.0).astype(float))
    ground = -setup.flight.vehicle.cg_above_skid_m  # the reference of a landing runs on below the ground
    history["command", "pos_d_ref_m"] = np.minimum(history["command", "pos_d_ref_m"], ground)
    table("command", "command", TABLES["command"])
    if setup.fitted is None:
        _add_papers(record, setup, history, t_s, table)
        happened = []
    else:
        table("flown", "estimate", (*POSITION_NED, *VELOCITY_BODY, *QUATERNION))
        happened = _add_navigators(record, setup, flown, lane)
        running = np.isfinite(history["estimate", "nees"])
        then_s = t_s[running] - setup.fitted.schedule.horizon_s
        record.add("consistency", {"t_s": then_s, "nees": history["estimate", "nees"][running]})
    happened = [*happened, *(row for event in setup.scenario.event for row in _befallen(t_s, history, event))]
    record.add("events", _events(t_s, history, happened, by_sensor=setup.fitted is None))
    return record


def _learnt(setup: Setup, flown: Flown, lane: int) -> dict[str, Any]:
    """Manifest entries of the vehicle as the flight learnt it, and the gains for it; empty where none was to be learnt.

    The margins that these keep are `control.learnt_margins.margins_of_record`.
    """
    nominal = setup.flight.learns
    if nominal is None or nominal.begins < 0 or not flown.learnt:
        return {}
    learnt, gains = flown.learnt[lane]
    facts: dict[str, Any] = {"verdict": VERDICTS[int(learnt.state)], "tries": int(learnt.tries)}
    course = ("state", "since", "tries")
    facts |= finite({name: value for name, value in learnt._asdict().items() if name not in course})
    facts["gains"] = gains._asdict()
    return {"learnt": facts}


def _befallen(
    t_s: Array, history: dict[tuple[str, str], Array], event: EventSection
) -> list[tuple[float, str, str, str, float]]:
    """Rows of the events that befell the vehicle, if the flight got so far."""
    after = np.flatnonzero(t_s >= event.at_s)
    if not len(after):
        return []
    height_m = -float(history["truth", "pos_d_m"][after[0]])
    return [(float(t_s[after[0]]), "vehicle", event.kind, "centre of gravity above the pad [m]", height_m)]


def _manifest(setup: Setup, seed: int, index: int, duration_s: float) -> dict[str, Any]:
    """Manifest of a flight: scenario, sensors, parameters and provenance."""
    scenario = setup.scenario
    facts: dict[str, Any] = {
        "kind": "fly",
        "scenario": scenario.name,
        "description": scenario.description,
        "filter": scenario.filter.name,
        "gps": scenario.gps.model,
        "truth": scenario.truth,
        "feedback": scenario.autopilot.feedback,
        "seed": seed,
        "flight": index,
        "duration_s": duration_s,
        "pad_size_m": scenario.pad.size_m,
        "command": command_line(),
        "parameters": setup.parameters,
        "provenance": provenance(setup.inputs),
    }
    if setup.fitted is not None:
        facts["segments"] = [setup.fitted.equipment._asdict()]
        facts["delays_s"] = {sensor.name.lower(): float(setup.fitted.ages_s[sensor]) for sensor in Sensor}
    return facts


def _add_papers(
    record: Record, setup: Setup, history: dict[tuple[str, str], Array], t_s: Array, table: Callable[..., None]
) -> None:
    """The paper's filter (or none), which takes the INS's attitude as it comes and states no consistency."""
    attitude = {name: history["gps", name] for name in QUATERNION}
    own = tuple(c for c in TABLES["estimate"] if c not in (*QUATERNION, *PROTECTION_LEVELS))
    table("estimate", "estimate", own, **attitude)
    every = np.full(len(t_s), 255.0)
    table("gps_position", "gps", COLUMNS[Sensor.GPS_POSITION], quality=every)
    if setup.scenario.gps.model != "white":  # with white noise the unit's velocity is the truth and no input
        table("gps_velocity", "gps", COLUMNS[Sensor.GPS_VELOCITY], quality=every)
    table("attitude", "gps", COLUMNS[Sensor.ATTITUDE], quality=every)
    table("flow_velocity", "flow", (*VELOCITY_BODY, "sigma_m_s"), quality=255.0 * history["flow", "engaged"])
    pings = slice(0, None, RANGE_EPOCHS)
    table("range", "range", COLUMNS[Sensor.RANGE], pings, quality=255.0 * history["range", "valid"][pings])
    record.add("innovation", _innovations(t_s, history))


def _add_navigators(record: Record, setup: Setup, flown: Flown, lane: int) -> list[tuple[float, str, str, str, float]]:
    """Add the navigator's estimates at its horizon, its readings, and the outcome of each component; return its
    events.
    """
    estimate = flown.tape.estimates(lane)
    record.add("estimate", estimate_table(estimate))
    record.add("states", states_table(estimate))
    fed = fed_rows(setup, flown, lane)
    record.add("fed", dict(zip(FED, fed.T, strict=True)))
    first, arrived = FED.index("value_0"), fed[:, FED.index("arrived")] > 0.0
    for sensor in Sensor:
        rows = fed[(fed[:, FED.index("sensor")] == sensor) & arrived]
        if len(rows):
            values = rows[:, first : first + len(COLUMNS[sensor])]
            columns = dict(zip(COLUMNS[sensor], values.T, strict=True))
            quality = rows[:, FED.index("quality")]
            record.add(sensor.name.lower(), {"t_s": rows[:, FED.index("arrival_s")], **columns, "quality": quality})
    record.add("innovation", innovation_table(flown.tape.offers(lane)))
    return happenings(flown.tape.events(lane))


def fed_rows(setup: Setup, flown: Flown, lane: int) -> Array:
    """Rows of one lane's readings as its navigator was fed them, with the columns of `record.FED`."""
    assert setup.fitted is not None
    schedule = setup.fitted.schedule
    taken = int(np.searchsorted(schedule.epoch, setup.flight.plan.epochs))
    rows = np.full((taken, len(FED)), np.nan)
    columns = {
        **dict(zip(Reading._fields, flown.fed[:taken, :, lane].T, strict=True)),
        "t_s": schedule.t_s[:taken],
        "arrival_s": schedule.t_s[:taken] + setup.fitted.ages_s[schedule.sensor[:taken]],
        "sensor": schedule.sensor[:taken].astype(float),
        "segment": np.zeros(taken),
    }
    for name, column in columns.items():
        rows[:, FED.index(name)] = column
    return rows


def _innovations(t_s: Array, flown: dict[tuple[str, str], Array]) -> Table:
    """One row per measurement component offered to the paper's filter, in time order; it has no gate."""
    names = (*POSITION_NED, *VELOCITY_BODY)
    count = len(names)

    def interleaved(column: Callable[[int], Array]) -> Array:
        return np.stack([column(i) for i in range(count)], axis=1).ravel()

    is_position = interleaved(lambda i: np.full(len(t_s), float(i < 3))) > 0.0
    engaged = np.repeat(flown["flow", "engaged"], count) > 0.0
    source = np.where(is_position, "gps_position", np.where(engaged, "flow_velocity", "gps_velocity"))
    arrived = is_position | (np.repeat(flown["measured", "velocity_arrived"], count) > 0.0)
    variances = interleaved(lambda i: flown["innovation", f"innovation_variance_{i}"])
    kept = arrived & (variances > 0.0)  # no variance: the filter does not take that component
    variance = variances[kept]
    innovation = interleaved(lambda i: flown["innovation", f"innovation_{i}"])[kept]
    ratio = innovation**2 / (GATE_SIGMA_SHOWN**2 * variance)
    return {
        "t_s": np.repeat(t_s, count)[kept],
        "sensor": source[kept],
        "component": np.tile(np.arange(count) % 3, len(t_s))[kept],
        "observation": interleaved(lambda i: flown["measured", names[i]])[kept],
        "innovation": innovation,
        "innovation_variance": variance,
        "test_ratio": ratio,
        "fused": np.ones(len(ratio)),
        "reason": np.full(len(ratio), "fused"),
    }


def _events(
    t_s: Array, flown: dict[tuple[str, str], Array], happened: list[tuple[float, str, str, str, float]], *,
    by_sensor: bool,
) -> Table:  # fmt: skip
    """Events in time order: the navigator's, lift-off and touchdown, engagements of the paper's flow sensor."""
    height = -flown["truth", "pos_d_m"]
    contact = flown["truth", "contact_n"] > 0.0
    engaged = flown["flow", "engaged"] > 0.0
    rows: list[tuple[float, str, str, str, float]] = list(happened)

    def changes(signal: NDArray[np.bool_], source: str, begins: str, ends: str, detail: str, value: Array) -> None:
        for k in np.flatnonzero(np.diff(signal.astype(int))) + 1:
            rows.append((t_s[k], source, begins if signal[k] else ends, detail, float(value[k])))

    if by_sensor and engaged[0]:
        rows.append((t_s[0], "flow", "engaged", "centre of gravity above ground [m]", float(height[0])))
    if by_sensor:
        changes(engaged, "flow", "engaged", "disengaged", "centre of gravity above ground [m]", height)
    sink = flown["truth", "sink_rate_m_s"]
    changes(contact, "vehicle", "touchdown", "lift-off", "sink rate [m/s]", np.roll(sink, 1))
    rows.sort(key=lambda row: row[0])
    columns = list(zip(*rows, strict=True)) if rows else [()] * 5
    names = ("t_s", "source", "kind", "detail", "value")
    kinds = (float, str, str, str, float)
    return {name: np.array(values, dtype=kind) for name, values, kind in zip(names, columns, kinds, strict=True)}
