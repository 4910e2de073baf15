"""Damaged rig folders, journals, flights of rare events and campaigns' folders: refused with one line, or sound."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flownav.api.scenario import Scenario
from flownav.campaigns.certification import verify as verifying
from flownav.campaigns.chain import DamagedError, read_part
from flownav.campaigns.engines import Local
from flownav.campaigns.rare.branches import Space, branch_text, read_branch
from flownav.campaigns.store import plan_in
from flownav.core.errors import InputError
from flownav.core.record import Record
from flownav.lab.identification.rig_log import Run, read_runs
from flownav.live.recovery import Recovered, recovered
from flownav.simulation.assemble import assemble
from fuzzing import FIRST_SEED, MUTANTS, assert_promise, assert_times
from journal_turns import Turns
from json_mutations import mutate_json
from log_mutations import mutate
from rig_logs import swing

SHEET = "schema_version = 1\nheight_m = 0.6\nrod_length_m = 1.5\n"


@pytest.fixture(scope="module")
def rig(tmp_path_factory) -> dict[str, bytes]:
    """Two runs of a rig, their sheet beside them."""
    folder = tmp_path_factory.mktemp("rig")
    files = {"rig.toml": SHEET.encode()}
    for run, delay_s in (("run-001", 0.08), ("run-002", 0.05)):
        files[f"{run}/rig.csv"] = swing(folder / "swing.csv", duration_s=4.0, delay_s=delay_s).read_bytes()
    return files


def sound_runs(runs: list[Run]) -> None:
    assert runs
    for run in runs:
        made = run.experiment
        for t_s, values in ((made.t_u, made.u), (made.t_y, made.y)):
            assert_times(t_s)
            assert len(t_s) == len(values)
            assert np.isfinite(values).all()


@pytest.mark.fuzz
def test_a_damaged_rig_folder(rig, tmp_path):
    names = sorted(rig)
    for seed in range(FIRST_SEED, FIRST_SEED + MUTANTS):
        changed = names[seed % len(names)]
        for name, content in rig.items():
            (tmp_path / name).parent.mkdir(exist_ok=True)
            (tmp_path / name).write_bytes(mutate(content, rig[names[0]], seed) if name == changed else content)
        assert_promise(read_runs, tmp_path, 200_000, f"rig, seed {seed}", sound_runs)


@pytest.fixture(scope="module")
def journal(tmp_path_factory) -> bytes:
    """The journal of a session that was killed after 4 s."""
    with pytest.MonkeyPatch.context() as patched:
        path = Turns(patched).killed(tmp_path_factory.mktemp("journal") / "flight.fnr", 4.0)
    content: bytes = path.read_bytes()
    return content


@pytest.mark.fuzz
def test_a_damaged_journal(journal, tmp_path):
    path, saved = tmp_path / "flight.fnr.journal", tmp_path / "flight.fnr"

    def sound(found: Recovered) -> None:
        found.record.save(saved, replacing=True)
        for name, table in Record.load(saved).tables.items():
            assert len({len(column) for column in table.values()}) == 1, name

    for seed in range(FIRST_SEED, FIRST_SEED + MUTANTS):
        content = mutate(journal, journal, seed)
        path.write_bytes(content)
        assert_promise(recovered, path, len(content), f"journal, seed {seed}", sound)


@pytest.mark.fuzz
def test_a_damaged_flight_of_a_rare_event(tmp_path):
    setup = assemble(Scenario.load("landing").changed(flight={"duration_s": 4.0}, filter="paper").file)
    space = Space(setup, 1, dispersed=True)
    inputs = np.zeros(len(space.dispersed) + len(space.starts))
    content = branch_text(setup, space.branch(inputs, np.zeros(space.spans, np.int64)), "distance", 1.0).encode()
    path = tmp_path / "rare_flight.json"

    def sound(branch: Any) -> None:
        assert np.isfinite([*branch.drawn.values(), *branch.start.values()]).all()

    path.write_bytes(content)
    sound(read_branch(path, setup))
    for seed in range(FIRST_SEED, FIRST_SEED + MUTANTS):
        changed = mutate_json(content, seed)
        path.write_bytes(changed)
        assert_promise(lambda path: read_branch(path, setup), path, len(changed), f"rare, seed {seed}", sound)


@pytest.mark.fuzz
def test_a_damaged_plan(tmp_path):
    content = json.dumps({"flights": 16, "seed": 1, "cells": [{"label": "x", "parameters": {"a": 1.0}}]}).encode()
    path = tmp_path / "campaign.json"
    for seed in range(FIRST_SEED, FIRST_SEED + MUTANTS):
        changed = mutate_json(content, seed)
        path.write_bytes(changed)
        assert_promise(lambda path: plan_in(path.parent), path, len(changed), f"plan, seed {seed}", lambda plan: None)


@pytest.fixture(scope="module")
def certificate(tmp_path_factory) -> Path:
    """A folder with a certificate and its ranking."""
    from certificates import STRICT, run
    from requirements import HEAD, WINDY, write

    place = tmp_path_factory.mktemp("made")
    run(write(place, HEAD + WINDY + STRICT), "--out", place / "out", "--ranking", 16, "--records", 0)
    found: Path = place / "out"
    return found


def one_of(folder: Path, pattern: str) -> Path:
    """The first file of a name, relative to the folder."""
    return sorted(path.relative_to(folder) for path in folder.glob(pattern))[0]


PART, SAMPLE = "flights/*/part-*.parquet", "ranking/*/*.parquet"


@pytest.mark.fuzz
@pytest.mark.parametrize("pattern", ["certificate.json", "campaign.json", PART, SAMPLE])
def test_a_damaged_certificate(certificate, monkeypatch, pattern):
    """A tenth as many of each file: every one is looked through, but for the flights, which are not flown again."""
    monkeypatch.setattr(verifying, "_flights", lambda *arguments: None)
    name = one_of(certificate, pattern)
    whole = (certificate / name).read_bytes()

    def sound(found: Any) -> None:
        assert found.verification != "holds" or unchanged

    try:
        for seed in range(FIRST_SEED, FIRST_SEED + max(MUTANTS // 10, 1)):
            mutant = mutate_json(whole, seed) if name.suffix == ".json" else mutate(whole, whole, seed)
            unchanged = mutant == whole
            (certificate / name).write_bytes(mutant)
            what = f"{name}, seed {seed}"
            assert_promise(lambda path: verifying.verify(path, Local()), certificate, 2_000_000, what, sound)
    finally:
        (certificate / name).write_bytes(whole)


@pytest.mark.fuzz
@pytest.mark.parametrize("pattern", [PART, SAMPLE])
def test_a_damaged_part_of_a_campaign(certificate, tmp_path, pattern):
    """It is named as damaged, or is the table that was written."""
    whole = (certificate / one_of(certificate, pattern)).read_bytes()
    path = tmp_path / "part.parquet"
    path.write_bytes(whole)
    intact = read_part(path)
    written = repr(intact.table.to_pydict())

    def read(path: Path) -> Any:
        try:
            return read_part(path)
        except DamagedError as error:
            raise InputError(str(error)) from error

    def sound(found: Any) -> None:
        assert found.table.schema.equals(intact.table.schema)
        assert found[1:] == intact[1:]
        assert repr(found.table.to_pydict()) == written  # a NaN is not equal to itself

    for seed in range(FIRST_SEED, FIRST_SEED + MUTANTS):
        path.write_bytes(mutate(whole, whole, seed))
        assert_promise(read, path, len(whole), f"{pattern}, seed {seed}", sound)
