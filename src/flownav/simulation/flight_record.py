"""From the history of one flight to its Record: tables, measurement streams, events."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flownav.measurement import COLUMNS, Sensor
from flownav.provenance import command_line, provenance
from flownav.record import POSITION_NED, QUATERNION, TABLES, VELOCITY_BODY, Record, Table
from flownav.simulation.assemble import Setup
from flownav.simulation.history import HISTORY
from flownav.simulation.sensing import EPOCH_S, PAD_EPOCHS, RANGE_EPOCHS

Array = NDArray[np.float64]
GATE_SIGMA_SHOWN = 3.0  # the paper's filter has no gate: its test ratios are shown against 3 sigma and all are fused


def record_of(setup: Setup, history: Array, seed: int, index: int) -> Record:
    """The record of flight `index`, not yet scored; history (epochs, len(HISTORY), 1)."""
    scenario = setup.scenario
    flown = {key: history[:, i, 0] for i, key in enumerate(HISTORY)}
    t_s: Array = np.arange(len(history), dtype=np.float64) * EPOCH_S
    record = Record(
        {
            "kind": "fly",
            "scenario": scenario.name,
            "description": scenario.description,
            "filter": scenario.filter.name,
            "gps": scenario.gps.model,
            "truth": scenario.truth,
            "feedback": scenario.autopilot.feedback,
            "seed": seed,
            "flight": index,
            "duration_s": float(t_s[-1]),
            "pad_size_m": scenario.pad.size_m,
            "command": command_line(),
            "parameters": setup.parameters,
            "provenance": provenance(setup.inputs),
        }
    )

    def table(name: str, source: str, columns: tuple[str, ...], rows: Any = slice(None), **more: Array) -> None:
        record.add(name, {"t_s": t_s[rows], **{c: flown[source, c][rows] for c in columns}, **more})

    truth = tuple(c for c in TABLES["truth"] if c != "on_ground")
    table("truth", "truth", truth, on_ground=(flown["truth", "contact_n"] > 0.0).astype(float))
    if setup.flight.landing is not None:
        table("estimate", "estimate", TABLES["estimate"])
    else:  # the others take the INS attitude as it comes, and say nothing of their consistency
        attitude = {name: flown["gps", name] for name in QUATERNION}
        own = tuple(c for c in TABLES["estimate"] if c not in (*QUATERNION, "nees"))
        table("estimate", "estimate", own, **attitude)
    ground = -setup.flight.vehicle.cg_above_skid_m  # the reference of a landing runs on below the ground
    flown["command", "pos_d_ref_m"] = np.minimum(flown["command", "pos_d_ref_m"], ground)
    table("command", "command", TABLES["command"])
    every = np.full(len(t_s), 255.0)
    table("gps_position", "gps", COLUMNS[Sensor.GPS_POSITION], quality=every)
    if scenario.gps.model != "white":  # with white noise the unit's velocity is the truth and nobody's input
        table("gps_velocity", "gps", COLUMNS[Sensor.GPS_VELOCITY], quality=every)
    table("attitude", "gps", COLUMNS[Sensor.ATTITUDE], quality=every)
    table("flow_velocity", "flow", (*VELOCITY_BODY, "sigma_m_s"), quality=255.0 * flown["flow", "engaged"])
    pings = slice(0, None, RANGE_EPOCHS)
    table("range", "range", COLUMNS[Sensor.RANGE], pings, quality=255.0 * flown["range", "valid"][pings])
    if setup.flight.plan.draws.pad_fix:
        fixes = slice(0, None, PAD_EPOCHS)
        table("pad", "pad", COLUMNS[Sensor.PAD], fixes, quality=255.0 * flown["pad", "valid"][fixes])
    if setup.flight.plan.draws.imu:
        table("imu", "imu", COLUMNS[Sensor.IMU], quality=every)
    record.add("innovation", _innovations(t_s, flown, _gate_sigma(setup)))
    record.add("events", _events(t_s, flown))
    return record


def _gate_sigma(setup: Setup) -> float | None:
    """The gate of the filter that flew; None for the paper's, which has none."""
    return setup.flight.landing.settings.gate_sigma if setup.flight.landing else None


def _innovations(t_s: Array, flown: dict[tuple[str, str], Array], gate_sigma: float | None) -> Table:
    """One row per measurement component offered to the filter, in time order; gate_sigma None: no gate."""
    names = (*POSITION_NED, *VELOCITY_BODY)
    count = len(names)

    def interleaved(column: Callable[[int], Array]) -> Array:
        return np.stack([column(i) for i in range(count)], axis=1).ravel()

    is_position = interleaved(lambda i: np.full(len(t_s), float(i < 3))) > 0.0
    engaged = np.repeat(flown["flow", "engaged"], count) > 0.0
    source = np.where(is_position, "gps_position", np.where(engaged, "flow_velocity", "gps_velocity"))
    arrived = is_position | (np.repeat(flown["measured", "velocity_arrived"], count) > 0.0)
    if gate_sigma is not None:  # flow alone stands here; INS velocity is a measurement of its own
        arrived = is_position | engaged
    variances = interleaved(lambda i: flown["innovation", f"innovation_variance_{i}"])
    kept = arrived & (variances > 0.0)  # no variance: the filter does not take that component
    variance = variances[kept]
    innovation = interleaved(lambda i: flown["innovation", f"innovation_{i}"])[kept]
    ratio = innovation**2 / ((gate_sigma or GATE_SIGMA_SHOWN) ** 2 * variance)
    fused = (ratio <= 1.0) | (gate_sigma is None)
    return {
        "t_s": np.repeat(t_s, count)[kept],
        "sensor": source[kept],
        "component": np.tile(np.arange(count) % 3, len(t_s))[kept],
        "observation": interleaved(lambda i: flown["measured", names[i]])[kept],
        "innovation": innovation,
        "innovation_variance": variance,
        "test_ratio": ratio,
        "fused": fused.astype(float),
        "reason": np.where(fused, "fused", "innovation_gate"),
    }


def _events(t_s: Array, flown: dict[tuple[str, str], Array]) -> Table:
    """Engagements of the flow sensor, lift-off and touchdown, in time order."""
    height = -flown["truth", "pos_d_m"]
    contact = flown["truth", "contact_n"] > 0.0
    engaged = flown["flow", "engaged"] > 0.0
    rows: list[tuple[float, str, str, str, float]] = []

    def changes(signal: NDArray[np.bool_], source: str, begins: str, ends: str, detail: str, value: Array) -> None:
        for k in np.flatnonzero(np.diff(signal.astype(int))) + 1:
            rows.append((t_s[k], source, begins if signal[k] else ends, detail, float(value[k])))

    if engaged[0]:
        rows.append((t_s[0], "flow", "engaged", "centre of gravity above ground [m]", float(height[0])))
    changes(engaged, "flow", "engaged", "disengaged", "centre of gravity above ground [m]", height)
    sink = flown["truth", "sink_rate_m_s"]
    changes(contact, "vehicle", "touchdown", "lift-off", "sink rate [m/s]", np.roll(sink, 1))
    rows.sort(key=lambda row: row[0])
    columns = list(zip(*rows, strict=True)) if rows else [()] * 5
    names = ("t_s", "source", "kind", "detail", "value")
    kinds = (float, str, str, str, float)
    return {name: np.array(values, dtype=kind) for name, values, kind in zip(names, columns, kinds, strict=True)}
