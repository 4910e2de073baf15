"""Planted faults: what a list of them says, as logs in the autopilots' own files.

A fault is planted in the readings and, where it is a parameter's, in the parameters that the log carries. What the
log's autopilot then made of it says the stand-in. The truth stays out of the log, as in the field, unless asked for.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from flownav.core.measurement import Sensor
from flownav.export.samples.dataflash import write_dataflash
from flownav.export.samples.ulog import write_ulog
from flownav.logs.happened import FUSES_FLOW, SOURCE_SET, Happened
from flownav.logs.log import Log
from flownav.logs.open_log import open_log
from planted.dialects import good_parameters
from planted.flights import flight
from planted.spoil import Streams, spoilt
from planted.stand_in import Estimated, estimate

HERE = Path(__file__).parent
LISTS = ("forum", "unseen", "own", "pairs", "harmless")
SUFFIX = {"px4": ".ulg", "ardupilot": ".bin"}
SYSTEM = {"px4": "PX4", "ardupilot": ""}


@dataclass(frozen=True)
class Planted:
    """One fault as its list has it; causes: what is to be named, the first of them first (empty: nothing)."""

    name: str
    causes: tuple[str, ...]
    flight: str
    dialect: str
    parameters: dict[str, float] = field(default_factory=dict)
    readings: tuple[dict[str, Any], ...] = ()
    switched: tuple[tuple[float, int], ...] = ()
    seed: int = 0
    source: str = ""
    log: str = ""  # a recorded log in its place, below FLOWNAV_DATA: the way in for flights of an autopilot's simulator


def listed(name: str) -> list[Planted]:
    """The faults of a list; seeds count up from the list's own first one unless stated."""
    content = tomllib.loads((HERE / f"{name}.toml").read_text(encoding="utf-8"))
    first = {"forum": 100, "own": 200, "pairs": 300, "unseen": 400, "harmless": 500}[name]
    return [_planted(entry, first + number) for number, entry in enumerate(content["fault"])]


def _planted(entry: dict[str, Any], seed: int) -> Planted:
    causes = entry.get("causes", [entry["cause"]] if "cause" in entry else [])
    return Planted(
        entry["name"],
        tuple(causes),
        entry.get("flight", ""),
        entry.get("dialect", ""),
        entry.get("parameters", {}),
        tuple(entry.get("readings", ())),
        tuple((one["t_s"], one["to"]) for one in entry.get("switched", ())),
        entry.get("seed", seed),
        entry.get("source", ""),
        entry.get("log", ""),
    )


def clean(kind: str, dialect: str, seed: int) -> Planted:
    """A flight without a fault."""
    return Planted(f"{kind} {seed}", (), kind, dialect, seed=seed)


def logged(fault: Planted, parameters: dict[str, float] | None = None) -> Log:
    """The log of a fault as the vehicle would have kept it, and with `parameters` written over its own.

    As the files' readers have it, it has no truth; here it still has the flight's.
    """
    sound = flight(fault.flight, fault.seed)
    before = good_parameters(fault.dialect, sound) | fault.parameters
    own = before | (parameters or {})
    streams = in_effect(spoilt(sound, list(fault.readings), fault.seed), before, own)
    said: Estimated = estimate(streams, own, fault.dialect, list(fault.switched))
    happened = [Happened(t_s, SOURCE_SET, f"source set {to}", float(to)) for t_s, to in fault.switched]
    if fault.dialect == "px4":
        happened += [Happened(t_s, FUSES_FLOW, f"{value:.0f}", value) for t_s, value in said.fuses_flow]
    return replace(
        sound,
        streams=streams,
        autopilot=said.table,
        autopilot_name="stand-in",
        parameters=own,
        happened=tuple(happened),
    )


def in_effect(streams: Streams, before: dict[str, float], own: dict[str, float]) -> Streams:
    """The readings as logged and fused under parameters that differ from those of the fault."""
    found = dict(streams)
    flow, field = found[Sensor.FLOW_RATE], found[Sensor.MAG]
    turn = 45.0 * (own.get("SENS_FLOW_ROT", 0.0) - before.get("SENS_FLOW_ROT", 0.0))
    turn += 0.01 * (own.get("FLOW_ORIENT_YAW", 0.0) - before.get("FLOW_ORIENT_YAW", 0.0))
    angle = np.radians(turn)
    back = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    scale = own.get("SENS_FLOW_SCALE", 1.0) / before.get("SENS_FLOW_SCALE", 1.0)
    factors = [
        scale * (1.0 + 1e-3 * own.get(name, 0.0)) / (1.0 + 1e-3 * before.get(name, 0.0))
        for name in ("FLOW_FXSCALER", "FLOW_FYSCALER")
    ]
    value = flow.value.copy()
    value[:, :2] = (value[:, :2] * factors) @ back.T
    value[:, 2:4] = value[:, 2:4] @ back.T
    found[Sensor.FLOW_RATE] = replace(flow, value=value)
    angle = np.radians(
        45.0 * sum(own.get(name, 0.0) - before.get(name, 0.0) for name in ("CAL_MAG0_ROT", "COMPASS_ORIENT"))
    )
    north, east = field.value[:, 0], field.value[:, 1]
    turned = np.column_stack(
        [north * np.cos(angle) - east * np.sin(angle), north * np.sin(angle) + east * np.cos(angle), field.value[:, 2]]
    )
    hover = own.get("MOT_THST_HOVER", own.get("MPC_THR_HOVER", 0.4))
    added = np.zeros(3)
    if own.get("COMPASS_MOTCT", 0.0) == 1.0:
        added = 1e-3 * np.array([own.get(f"COMPASS_MOT_{axis}", 0.0) for axis in "XYZ"])
    if own.get("CAL_MAG_COMP_TYP", 0.0) == 1.0:
        added = np.array([own.get(f"CAL_MAG0_{axis}COMP", 0.0) for axis in "XYZ"])
    landed = found[Sensor.LANDED]
    row = np.clip(np.searchsorted(landed.t_s, field.t_s, side="right") - 1, 0, len(landed) - 1)
    running = landed.value[row, 0] < 0.5
    found[Sensor.MAG] = replace(field, value=turned + running[:, None] * hover * added)
    return found


def written(fault: Planted, folder: Path, parameters: dict[str, float] | None = None, *, truth: bool = False) -> Path:
    """The log as a file of its dialect in a folder."""
    log = logged(fault, parameters)
    path = folder / f"{fault.name.replace(' ', '-').replace('/', '-').replace(',', '')}{SUFFIX[fault.dialect]}"
    log = log if truth else replace(log, truth=None)
    if fault.dialect == "px4":
        write_ulog(log, path, SYSTEM["px4"])
    else:
        write_dataflash(log, path)
    return path


def read(fault: Planted, folder: Path, data: Path | None = None) -> Log:
    """The log of a fault as flownav reads it; of a recorded one from the folder of data."""
    if fault.log:
        assert data is not None, "FLOWNAV_DATA names no folder of logs"
        return open_log(data / fault.log)
    return open_log(written(fault, folder))
