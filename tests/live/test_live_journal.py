"""A recording: nothing of another run is touched, and a disk that fails ends the recording and nothing else."""

from __future__ import annotations

import errno
import itertools
import os
import threading
import time

import numpy as np
import pytest
from typer.testing import CliRunner

from flownav.cli import app
from flownav.core.errors import InputError, VerdictError
from flownav.core.free_names import free_name
from flownav.core.record import Record
from flownav.live import writing
from flownav.live.options import Options
from flownav.live.recorder import Recorder
from flownav.live.recovery import recovered
from flownav.live.writing import claim, is_locked
from flownav.logs.journal import MAGIC, Block, blocks
from flownav.logs.mavlink.messages import TrueState
from flownav.logs.open_log import open_flight
from flownav.navigation.tables import estimate_table, innovation_table
from flownav.replays.fed import as_fed
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import replay
from journal_turns import Turns, full_disk
from live_command import run_live
from live_ends import ORIGIN, Hover, Wire

HUNG_S = 120.0  # whatever takes so long hangs


def assert_replays_to_the_bit(path):
    record, log = Record.load(path), open_flight(path)
    again = replay(log, *as_fed(log, ReplayOptions(), None))
    for name, table in (
        ("estimate", estimate_table(again.estimate)),
        ("innovation", innovation_table(again.innovation)),
    ):
        for column, values in table.items():
            assert np.array_equal(values, record.tables[name][column], equal_nan=values.dtype.kind == "f"), column
    return record


def wait_for(condition):
    until_s = time.monotonic() + HUNG_S
    while not condition():
        assert time.monotonic() < until_s
        time.sleep(0.01)


@pytest.fixture
def turns(monkeypatch):
    """The writer's turns are the test's."""
    return Turns(monkeypatch)


@pytest.fixture
def journal(tmp_path, turns):
    """The journal of a flight of 6 s that was killed, as it lies there."""
    return turns.killed(tmp_path / "flight.fnr", 6.0)


def test_a_journal_without_an_end_is_recovered_and_replays_to_the_bit(journal):
    path = journal.with_suffix("")
    result = CliRunner().invoke(app, ["recover", str(journal)])
    assert result.exit_code == 0, result.output
    assert "cut off" in result.output
    record = assert_replays_to_the_bit(path)
    assert len(record.tables["estimate"]["t_s"]) > 100
    assert "recording_ended" in record.tables["events"]["kind"]
    assert "sending" in record.tables["events"]["kind"]
    np.testing.assert_allclose(record.manifest["parameters"]["origin_lat_lon_deg_alt_m"], ORIGIN)
    assert journal.exists()


def test_a_journal_torn_anywhere_gives_what_was_whole(journal, tmp_path):
    data = journal.read_bytes()
    spans = [recovered(journal).record.manifest["duration_s"]]
    for share in (0.9, 0.7, 0.5):
        torn = tmp_path / "torn.fnr.journal"
        torn.write_bytes(data[: int(share * len(data))])
        found = recovered(torn)
        found.record.save(tmp_path / "torn.fnr", replacing=True)
        assert_replays_to_the_bit(tmp_path / "torn.fnr")
        assert found.torn_bytes > 0
        spans.append(found.record.manifest["duration_s"])
    assert spans == sorted(spans, reverse=True)
    assert spans[-1] > 0.5


def test_a_damaged_block_in_the_middle_is_said_and_the_rest_is_kept(journal):
    whole = [part for part in blocks(memoryview(journal.read_bytes())) if isinstance(part, Block) and part.rows]
    data = bytearray(journal.read_bytes())
    data[data.find(whole[2].rows["fed"].tobytes())] ^= 1
    journal.write_bytes(bytes(data))
    result = CliRunner().invoke(app, ["recover", str(journal), "--json"])
    assert isinstance(result.exception, VerdictError)
    assert "1 damaged blocks" in str(result.exception)
    record = Record.load(journal.with_suffix(""))
    assert "journal_damaged" in record.tables["events"]["kind"]
    assert len(record.tables["fed"]["t_s"]) == sum(len(part.rows["fed"]) for part in whole) - len(whole[2].rows["fed"])
    log = open_flight(journal.with_suffix(""))
    assert len(replay(log, *as_fed(log, ReplayOptions(), None)).estimate) > 100


def test_rows_of_a_navigator_that_is_lost_are_left_out(tmp_path, turns):
    recorder = Recorder(tmp_path / "restart.fnr", Options())
    wire = Wire(Hover(), Options(), recorder)
    turns.fly(wire, 4.0)
    wire.vehicle.boot_s = 1.0 - wire.t_s  # it reboots
    turns.fly(wire, 4.0)
    recorder.leave()
    wire.close()
    data = recorder.journal.read_bytes()
    first = next(part for part in blocks(memoryview(data)) if isinstance(part, Block) and "segments" in part.stated)
    spoilt = bytearray(data)
    spoilt[data.find(b'"segments": [[0, ')] ^= 1
    recorder.journal.write_bytes(bytes(spoilt))
    found = recovered(recorder.journal)
    assert found.lost_blocks == 1
    assert first.stated["segments"][0][0] == 0
    assert len(found.record.manifest["segments"]) == 1
    assert set(found.record.tables["fed"]["segment"]) == {0.0}
    found.record.save(tmp_path / "restart.fnr")
    log = open_flight(tmp_path / "restart.fnr")
    assert len(replay(log, *as_fed(log, ReplayOptions(), None)).estimate) > 50


def test_the_head_is_found_again_when_the_first_is_damaged(tmp_path, turns, monkeypatch):
    monkeypatch.setattr(writing, "HEAD_EVERY_S", 1.5)
    journal = turns.killed(tmp_path / "a.fnr", 4.0)
    data = bytearray(journal.read_bytes())
    data[len(MAGIC) + 40] ^= 1
    journal.write_bytes(bytes(data))
    assert recovered(journal).record.manifest["parameters"]["gps_delay_s"] == Options().gps_delay_s


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", MAGIC, MAGIC + b"x" * 500])
def test_what_is_no_journal_is_one_line(tmp_path, content):
    path = tmp_path / "x.fnr.journal"
    path.write_bytes(content)
    result = CliRunner().invoke(app, ["recover", str(path)])
    assert isinstance(result.exception, InputError)
    assert "\n" not in str(result.exception)
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


def test_two_sessions_do_not_record_to_one_path(tmp_path):
    path = tmp_path / "flight.fnr"
    first = Recorder(path, Options())
    with pytest.raises(InputError, match="another session is recording there"):
        Recorder(path, Options(), force=True)
    result = CliRunner().invoke(app, ["recover", str(first.journal)])
    assert "still records" in str(result.exception)
    assert is_locked(first.journal)
    first.leave()
    assert not is_locked(first.journal)


def test_the_journal_of_a_killed_run_is_never_touched(journal):
    before, path = journal.read_bytes(), journal.with_suffix("")
    for force, name in ((False, "flight-1.fnr"), (True, "flight-1.fnr")):
        recorder = Recorder(path, Options(), force=force)
        assert recorder.path.name == name
        assert f"`flownav recover {journal}`" in recorder.notice
        assert recorder.finish({}, received=False).facts() == {
            "record": None,
            "journal": None,
            "recording_stopped": None,
        }
    assert journal.read_bytes() == before


def test_a_record_that_is_there_is_kept_unless_it_is_forced(tmp_path):
    path = tmp_path / "flight.fnr"
    for name in ("flight.fnr", "flight-1.fnr", "flight-2.fnr"):
        recorder = Recorder(path, Options())
        assert recorder.path.name == name
        assert (recorder.notice == "") == (name == "flight.fnr")
        wire = Wire(Hover(), Options(), recorder).fly(3.0)
        wire.close()
        assert recorder.finish({}).record == tmp_path / name
    before = path.read_bytes()
    forced = Recorder(path, Options(), force=True)
    assert path.read_bytes() == before  # until the new one is whole
    wire = Wire(Hover(), Options(), forced).fly(4.0)
    wire.close()
    assert forced.finish({}).record == path
    assert path.read_bytes() != before
    assert sorted(file.name for file in tmp_path.iterdir()) == ["flight-1.fnr", "flight-2.fnr", "flight.fnr"]
    assert free_name(path).name == "flight-3.fnr"


def test_a_record_that_appears_while_the_session_runs_is_kept(tmp_path):
    path = tmp_path / "flight.fnr"
    recorder = Recorder(path, Options())
    path.write_text("somebody's")
    wire = Wire(Hover(), Options(), recorder).fly(3.0)
    wire.close()
    assert recorder.finish({}).record == tmp_path / "flight-1.fnr"
    assert path.read_text() == "somebody's"


def test_what_is_no_file_is_not_recorded_to(tmp_path):
    with pytest.raises(InputError, match="no file"):
        claim(tmp_path, force=True)
    os.symlink(tmp_path / "elsewhere", tmp_path / "flight.fnr.journal")
    place = claim(tmp_path / "flight.fnr", force=True)
    os.close(place.file)
    assert place.record.name == "flight-1.fnr"
    assert not (tmp_path / "elsewhere").exists()


def test_a_full_disk_ends_the_recording_and_not_the_session(tmp_path, turns, monkeypatch):
    full_disk(monkeypatch, 200_000)
    said = []
    recorder = Recorder(tmp_path / "flight.fnr", Options(), failed=said.append)
    wire = Wire(Hover(), Options(), recorder)
    turns.fly(wire, 4.0)
    before = wire.session.sent
    assert recorder.reason
    wire.fly(2.0)
    assert wire.session.sent >= before + 90
    assert recorder.reason == "No space left on device"
    assert said == [recorder.reason]
    finished = recorder.finish({"sent": 1})
    wire.close()
    assert finished.reason == recorder.reason
    assert finished.record == tmp_path / "flight.fnr"
    assert "recorded in part only (No space left on device)" in finished.verdict()
    record = assert_replays_to_the_bit(finished.record)
    assert record.manifest["live"]["recording_stopped"] == "No space left on device"
    assert record.tables["fed"]["t_s"][-1] < wire.session.filtering.clock_s - 1.0


def test_where_the_record_cannot_be_written_the_journal_stays(tmp_path, monkeypatch):
    recorder = Recorder(tmp_path / "flight.fnr", Options())
    wire = Wire(Hover(), Options(), recorder).fly(4.0)
    wire.close()

    def save(self, path, *, replacing):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patched:
        patched.setattr(Record, "save", save)
        finished = recorder.finish({})
    assert finished.record is None
    assert f"`flownav recover {recorder.journal} --out FILE`" in finished.verdict()
    assert CliRunner().invoke(app, ["recover", str(recorder.journal)]).exit_code == 0
    assert_replays_to_the_bit(tmp_path / "flight.fnr")


def test_a_disk_that_does_not_answer_holds_nobody_up(tmp_path, monkeypatch):
    answer, asked = threading.Event(), threading.Event()

    def hangs(file):
        asked.set()
        answer.wait()

    recorder = Recorder(tmp_path / "flight.fnr", Options())
    monkeypatch.setattr(writing.os, "fsync", hangs)
    monkeypatch.setattr(writing, "MOST_WAITING", 200_000)
    monkeypatch.setattr(writing, "LAST_WAIT_S", 0.1)
    assert asked.wait(HUNG_S)
    wire = Wire(Hover(), Options(), recorder).fly(8.0)  # comes to an end
    assert recorder.reason == "the disk does not keep up"
    assert wire.session.sent > 200
    finished = recorder.finish({})
    wire.close()
    assert finished.journal == recorder.journal
    answer.set()


def test_a_disk_that_is_full_at_the_start_is_said_at_once(tmp_path, monkeypatch):
    full_disk(monkeypatch, 0)
    with pytest.raises(InputError, match="No space left on device"):
        Recorder(tmp_path / "flight.fnr", Options())
    assert not list(tmp_path.iterdir())


def test_at_most_a_second_is_not_on_the_disk(tmp_path, turns, monkeypatch):
    synced = []
    real = os.fsync
    monkeypatch.setattr(
        writing.os, "fsync", lambda file: (real(file), synced.append((turns.now_s, os.fstat(file).st_size)))
    )
    turns.killed(tmp_path / "flight.fnr", 3.0)
    times_s = [at_s for at_s, _ in synced]
    assert max(b - a for a, b in itertools.pairwise(times_s)) < 0.8
    assert times_s[-1] - times_s[0] > 2.0
    assert len({size for _, size in synced}) >= 3


@pytest.mark.real_time
def test_what_is_handed_over_is_written_and_forced_to_the_disk_by_itself(tmp_path, monkeypatch):
    """By the writer's own thread: nobody ends the recording."""
    sizes = []
    real = os.fsync
    monkeypatch.setattr(writing.os, "fsync", lambda file: (real(file), sizes.append(os.fstat(file).st_size)))
    recorder = Recorder(tmp_path / "flight.fnr", Options())
    begun = recorder.size
    wire = Wire(Hover(), Options(), recorder).fly(3.0)
    wait_for(lambda: sizes[-1] > begun + 10_000)
    written = recorder.size
    wire.fly(1.0)
    wait_for(lambda: sizes[-1] > written)
    wire.close()
    recorder.leave()


def test_a_journal_that_appears_meanwhile_is_not_taken(tmp_path, monkeypatch):
    """Somebody makes it after we have looked and before we make ours."""
    journal = tmp_path / "flight.fnr.journal"
    real, looked = os.path.lexists, []

    def lexists(path):
        found = real(path)
        if os.fspath(path) == os.fspath(journal) and not looked:
            looked.append(path)
            journal.write_text("somebody's")
        return found

    monkeypatch.setattr(os.path, "lexists", lexists)
    place = claim(tmp_path / "flight.fnr", force=True)
    os.close(place.file)
    assert place.record.name == "flight-1.fnr"
    assert journal.read_text() == "somebody's"


def test_truth_lies_in_the_frame_of_its_time(tmp_path):
    """The first origin holds before it was known too; from the second on, places are about that."""
    recorder = Recorder(tmp_path / "flight.fnr", Options())
    place = TrueState((47.0, 8.0, 400.0), (1.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    recorder.truth(1.0, place)
    recorder.origin(2.0, (47.0, 8.0, 400.0))
    recorder.truth(3.0, place)
    recorder.origin(4.0, (47.0, 8.0, 410.0))
    recorder.truth(5.0, place)
    record = Record.load(recorder.finish({}).record)
    np.testing.assert_allclose(record.tables["truth"]["pos_d_m"], [0.0, 0.0, 10.0], atol=1e-9)
    assert record.manifest["origins"] == [[2.0, 47.0, 8.0, 400.0], [4.0, 47.0, 8.0, 410.0]]
    assert record.manifest["parameters"]["origin_lat_lon_deg_alt_m"] == [47.0, 8.0, 410.0]


def test_the_command_numbers_its_record_and_replaces_one_only_where_it_may(tmp_path, monkeypatch):
    """A companion that starts flownav anew with the same line must fly."""
    path = tmp_path / "flight.fnr"
    recorder = Recorder(path, Options())
    wire = Wire(Hover(), Options(), recorder).fly(3.0)
    wire.close()
    assert recorder.finish({}).record == path

    def refused(*more):
        done = run_live(monkeypatch, "--duration", "0.3", "--json", "--record", *more)
        return type(done.exception), f"{done.stderr}{done.exception}"

    before = path.read_bytes()
    kind, words = refused(path)
    assert kind is VerdictError  # no vehicle was received
    assert "flight-1.fnr" in words
    kind, words = refused(path, "--force")
    assert kind is VerdictError
    assert "was not written" not in words
    assert path.read_bytes() == before
    notes = tmp_path / "notes.fnr"
    notes.write_text("flownav flew well")
    kind, words = refused(notes, "--force")
    assert kind is InputError
    assert "is no record" in words
    assert notes.read_text() == "flownav flew well"


def test_a_journal_is_recovered_twice_into_two_names(journal):
    record = journal.with_suffix("")
    for name in (record, record.with_stem(f"{record.stem}-1")):
        assert CliRunner().invoke(app, ["recover", str(journal)]).exit_code == 0
        assert_replays_to_the_bit(name)
    assert CliRunner().invoke(app, ["recover", str(journal), "--force"]).exit_code == 0
