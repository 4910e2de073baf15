"""Damaged records: loaded, read as logs, replayed, reported and exported, or refused with one line; soon, in little."""

from __future__ import annotations

import shutil
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from fed_records import queue_of_flight, record_of
from flownav.core.errors import InputError
from flownav.core.measurement import EventQueue
from flownav.core.record import Record
from flownav.export.formats import export
from flownav.logs.log import Log
from flownav.logs.open_log import open_flight, open_log
from flownav.logs.plausible import LARGEST
from flownav.replays.bundle import to_record
from flownav.replays.fed import as_fed
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import Replay, replay
from flownav.report.html import render
from fuzzing import FIRST_SEED, MUTANTS, assert_promise, assert_sound
from record_mutations import mutate_record

REPLAYED_EACH, SHOWN_EACH = 5, 10  # of this number of mutants one is replayed, and one reported and exported


@pytest.fixture(scope="module")
def samples(tmp_path_factory) -> dict[str, bytes]:
    """The record of a flight of some seconds, as it was fed, and that of its replay."""
    folder = tmp_path_factory.mktemp("records")
    queue = queue_of_flight()
    early = queue.t_s < 8.0
    record_of(EventQueue(*(column[early] for column in queue))).save(folder / "fed.fnr")
    flown = replayed(folder / "fed.fnr")
    to_record(flown, flown.scores(), ["flownav", "replay"]).save(folder / "replay.fnr")
    return {name: (folder / f"{name}.fnr").read_bytes() for name in ("fed", "replay")}


def replayed(path: Path) -> Replay:
    log = open_flight(path)
    return replay(log, *as_fed(log, ReplayOptions(), None))


def assert_finite(flown: Replay) -> None:
    """Assert the promise of a replay about any input."""
    assert np.isfinite(flown.estimate).all()
    assert np.all(np.diff(flown.estimate_rows.t_s) >= 0.0)
    flown.scores()


def shown(path: Path) -> None:
    """As a page and in a format of others."""
    record = Record.load(path)
    assert render(record)
    out = path.with_name("out")
    for to in ("csv", "ulog"):
        shutil.rmtree(out, ignore_errors=True)
        with suppress(InputError):
            export(record, to, out / to / "x")


def as_fed_sound(log: Log) -> None:
    """A record is held to what can be at all: a live link has let through what it holds."""
    assert_sound(log, LARGEST, 0.5)


def nothing(found: object) -> None:
    """Whatever it is."""


@pytest.mark.fuzz
@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # figures of absurd numbers overflow
@pytest.mark.parametrize("name", ["fed", "replay"])
def test_a_damaged_record_is_read_or_refused(samples, tmp_path, name):
    path = tmp_path / "x.fnr"
    other = samples["replay" if name == "fed" else "fed"]
    for seed in range(FIRST_SEED, FIRST_SEED + -(-MUTANTS // 2)):
        content = mutate_record(samples[name], other, seed)
        path.write_bytes(content)
        what, size = f"{name}, seed {seed}", len(content)
        loads = assert_promise(Record.load, path, size, what, nothing)
        if loads and assert_promise(open_log, path, size, what, as_fed_sound) and seed % REPLAYED_EACH == 0:
            assert_promise(replayed, path, size, what, assert_finite)
        if loads and seed % SHOWN_EACH == 0:
            assert_promise(shown, path, size, what, nothing)


def test_the_samples_themselves_are_read(samples, tmp_path):
    """Without this, a reader that refused everything would pass."""
    for name, content in samples.items():
        (tmp_path / f"{name}.fnr").write_bytes(content)
        shown(tmp_path / f"{name}.fnr")
    assert_finite(replayed(tmp_path / "fed.fnr"))
