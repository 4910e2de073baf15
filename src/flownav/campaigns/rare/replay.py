"""The most likely flight of a rare event as a file, and that flight again, to the bit."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from flownav.campaigns.local import record_flown
from flownav.campaigns.plan import made_of
from flownav.campaigns.rare.branches import Branch, Space
from flownav.core.errors import InputError
from flownav.core.files import written_whole
from flownav.core.record import Record
from flownav.simulation.assemble import Setup
from flownav.simulation.engine import fly_written

SCHEMA_VERSION = 1
MOST_SPANS = 1_000_000


def branch_text(setup: Setup, branch: Branch, event: str, response: float | None) -> str:
    """A flight as JSON: what was drawn for it, and its streams as [stream, how many spans] one after the other."""
    runs: list[list[int]] = []
    for stream in branch.streams:
        if runs and runs[-1][0] == stream:
            runs[-1][1] += 1
        else:
            runs.append([stream, 1])
    facts = {"schema_version": SCHEMA_VERSION, "scenario": setup.scenario.name, "event": event, "response": response}
    facts["parameters_sha256"] = made_of(setup)
    return json.dumps(facts | branch._asdict() | {"streams": runs}, indent=1) + "\n"


def write_branch(path: Path, setup: Setup, branch: Branch, event: str, response: float | None) -> None:
    """The file of a flight, whole or not at all."""
    with written_whole(path) as whole:
        whole.write_text(branch_text(setup, branch, event, response), encoding="utf-8")


def read_branch(path: Path, setup: Setup) -> Branch:
    """A flight from its file. InputError where it is none, or none of this scenario."""
    try:
        found: Any = json.loads(path.read_text(encoding="utf-8"))
        if found["schema_version"] != SCHEMA_VERSION:
            raise InputError(f"{path}: schema_version {found['schema_version']}: must be {SCHEMA_VERSION}")
        if found["scenario"] != setup.scenario.name:
            raise InputError(f"{path}: a flight of the scenario {found['scenario']}, not of {setup.scenario.name}")
        if found["parameters_sha256"] != made_of(setup):
            raise InputError(f"{path}: was flown with other settings; give the options with which --rare was run")
        if sum(int(spans) for _, spans in found["streams"]) > MOST_SPANS:
            raise ValueError("too long")
        streams = [int(stream) for stream, spans in found["streams"] for _ in range(int(spans))]
        drawn, start = _numbers(found["drawn"]), _numbers(found["start"])
        branch = Branch(int(found["seed"]), drawn, start, streams)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{path}: no flight of a rare event; give the rare_flight.json of --rare") from error
    space = Space(setup, branch.seed, dispersed=bool(drawn))
    if set(drawn) != set(space.dispersed) or set(start) != {one.name for one in space.starts}:
        raise InputError(f"{path}: a flight of another scenario: other numbers are drawn for it")
    if len(streams) != space.spans or min(streams) < 0:
        raise InputError(f"{path}: a flight of another length: {len(streams)} spans of noise, not {space.spans}")
    return branch


def _numbers(table: dict[str, Any]) -> dict[str, float]:
    if not all(math.isfinite(value) for value in table.values()):
        raise ValueError("a number is needed")
    return {str(name): float(value) for name, value in table.items()}


def replayed(setup: Setup, branch: Branch) -> Record:
    """The flight again, as a scored record; its number is that of the stream that it drew last."""
    space = Space(setup, branch.seed, dispersed=bool(branch.drawn))
    flown = fly_written(setup.flight, branch.seed, branches=space.one(branch))
    drawn = branch.drawn or None
    record = record_flown(setup, flown, branch.seed, max(branch.streams), drawn)
    record.manifest["branch"] = {"start": branch.start, "streams": branch.streams}
    return record
