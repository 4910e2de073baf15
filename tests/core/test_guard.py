"""No output is an input, a link, a device or somebody else's file; no input is a FIFO or a device."""

from __future__ import annotations

import hashlib
import os
import socket
import stat
from pathlib import Path

import pytest

from flownav.cli.output import place, record_place
from flownav.core import guard
from flownav.core.errors import InputError
from flownav.core.guard import a_run, an_input, an_output, folder_written_whole, written_whole
from flownav.core.marks import marked
from flownav.core.parameter_files import read_toml
from flownav.core.record import Record
from flownav.lab.optics.frame_files import read_grey
from flownav.lab.rig.experiment import check_rig_folder
from flownav.logs.mavlink.signing import load_key
from flownav.logs.open_log import open_log
from replay_logs import log_of_flight


def refused(path: Path, *inputs: Path) -> str:
    """The one line with which an output is refused; nothing is left of the try, and nothing has changed."""
    before = sorted((each, each.lstat().st_mtime_ns) for each in path.parent.rglob("*"))
    with pytest.raises(InputError) as first:
        place(path, *inputs, force=True)
    if not inputs:
        with pytest.raises((InputError, OSError)), written_whole(path) as temporary:
            temporary.write_text("new")
    assert sorted((each, each.lstat().st_mtime_ns) for each in path.parent.rglob("*")) == before
    assert "\n" not in str(first.value)
    return str(first.value)


# -- inputs ------------------------------------------------------------------------------------------------
@pytest.fixture
def fifo(tmp_path) -> Path:
    os.mkfifo(tmp_path / "pipe.toml")
    return tmp_path / "pipe.toml"


@pytest.mark.parametrize("read", [open_log, read_toml, load_key, read_grey, Record.load])
def test_a_pipe_or_a_device_is_refused_at_once(fifo, read):
    with pytest.raises(InputError, match=r"a FIFO \(a named pipe\) is not read"):
        read(fifo)
    with pytest.raises(InputError, match="/dev/zero: a device is not read"):
        read(Path("/dev/zero"))
    with pytest.raises(InputError, match="a device is not read"):
        read(Path("/dev/../dev/full"))


def test_a_socket_and_a_link_to_a_device_are_refused_too(tmp_path):
    (tmp_path / "link.ulg").symlink_to("/dev/zero")
    with pytest.raises(InputError, match="a device is not read"):
        open_log(tmp_path / "link.ulg")
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(tmp_path / "s"))
        with pytest.raises(InputError, match="a socket is not read"):
            an_input(tmp_path / "s")


def test_a_file_of_a_folder_may_not_be_a_pipe(tmp_path):
    folder = log_of_flight(4.0).write(tmp_path / "log")
    (folder / "gps.csv").unlink()
    os.mkfifo(folder / "gps.csv")
    with pytest.raises(InputError, match=r"gps.csv: a FIFO"):
        open_log(folder)


def test_links_to_files_are_read(tmp_path):
    folder = log_of_flight(4.0).write(tmp_path / "log")
    (tmp_path / "link").symlink_to(folder)
    assert open_log(tmp_path / "link").streams


@pytest.mark.parametrize("name", ["a" * 300, "a\0b", "/".join(["d" * 200] * 30)])
def test_a_name_that_cannot_be_one_is_said_in_one_line(tmp_path, name):
    for ask in (open_log, read_toml, load_key, lambda path: place(path, force=False)):
        with pytest.raises(InputError, match="cannot be the name of a file") as said:
            ask(tmp_path / name)
        assert len(str(said.value)) < 400
        assert "\n" not in str(said.value)


# -- outputs -----------------------------------------------------------------------------------------------
def test_an_input_is_never_an_output(tmp_path):
    log = tmp_path / "x.ulg"
    log.write_bytes(b"ULog")
    os.link(log, tmp_path / "hard.fnr")
    assert "would replace what it is made from" in refused(log, log)
    assert "hard.fnr (the same file as" in refused(tmp_path / "hard.fnr", log)
    (tmp_path / "there").symlink_to(tmp_path)
    assert "would replace what it is made from" in refused(tmp_path / "there" / "x.ulg", log)
    assert "would replace what it is made from" in refused(tmp_path / "no" / ".." / "x.ulg", log)


def test_the_other_case_of_an_input_is_it_where_the_system_says_so(tmp_path, monkeypatch):
    """A disk that knows no case shows one inode under both names."""
    log = tmp_path / "x.ulg"
    log.write_bytes(b"ULog")
    real = os.lstat
    monkeypatch.setattr(guard.os, "lstat", lambda path: real(str(path).replace("X.ULG", "x.ulg")))
    with pytest.raises(InputError, match="would replace what it is made from"):
        an_output(tmp_path / "X.ULG", [log])


@pytest.mark.parametrize("name", ["attitude.csv", "gps.csv", "new.csv", "NEW.CSV", "run-001/rig.csv", "rig.toml"])
def test_a_file_of_an_input_folder_is_an_input_and_a_new_one_would_become_one(tmp_path, name):
    folder = log_of_flight(4.0).write(tmp_path / "log")
    before = {file.name: file.read_bytes() for file in folder.iterdir()}
    assert "which this run reads" in refused(folder / name, folder)
    assert {file.name: file.read_bytes() for file in folder.iterdir()} == before


def test_results_may_lie_in_the_folder_that_they_are_made_from(tmp_path):
    folder = log_of_flight(4.0).write(tmp_path / "log")
    for _ in range(2):
        record_place(folder / "out" / "log.fnr", folder, force=True, report=True)
        Record({"kind": "replay"}).save(folder / "out" / "log.fnr")


def test_what_a_run_has_read_it_does_not_replace_even_where_another_file_named_it(tmp_path):
    sheet = tmp_path / "sheet.toml"
    sheet.write_bytes(marked("gain = 1\n"))
    with a_run():
        read_toml(sheet)
        with pytest.raises(InputError, match="would replace what it is made from"), written_whole(sheet):
            pass
    with written_whole(sheet) as temporary:
        temporary.write_text("# flownav again\n")
    assert sheet.read_text() == "# flownav again\n"


def test_nothing_is_written_through_a_link(tmp_path):
    (tmp_path / "target.fnr").write_bytes(b"")
    for name, target in (("link.fnr", "target.fnr"), ("dangling.fnr", "absent.fnr"), ("full.fnr", "/dev/full")):
        (tmp_path / name).symlink_to(target)
        assert "nothing is written through a symbolic link" in refused(tmp_path / name)
        assert (tmp_path / name).is_symlink()
    (tmp_path / "folder").mkdir()
    (tmp_path / "to folder").symlink_to("folder")
    with pytest.raises(InputError, match="symbolic link"), folder_written_whole(tmp_path / "to folder"):
        pass


def test_no_device_pipe_socket_or_folder_is_replaced(tmp_path, fifo):
    assert "(a FIFO" in refused(fifo)
    assert stat.S_ISFIFO(fifo.stat().st_mode)
    (tmp_path / "folder.fnr").mkdir()
    assert "it is a folder" in refused(tmp_path / "folder.fnr")
    for device in ("/dev/full", "/dev/null"):
        with pytest.raises(InputError, match=r"\(a device\)"):
            place(Path(device), force=False)
        with pytest.raises(InputError, match=r"\(a device\)"):
            Record().save(Path(device))
        assert stat.S_ISCHR(os.stat(device).st_mode)


def test_a_place_where_nothing_can_be_made_is_found_before_the_work(tmp_path):
    (tmp_path / "file").write_text("")
    assert "cannot be written" in refused(tmp_path / "file" / "x.fnr")
    with pytest.raises(InputError, match="cannot be written"):
        place(Path("/proc/x.fnr"), force=False)
    assert place(tmp_path / "a" / "b" / "x.fnr", force=False) == tmp_path / "a" / "b" / "x.fnr"
    assert not (tmp_path / "a").exists()


# -- what may be replaced ----------------------------------------------------------------------------------
@pytest.mark.parametrize(("name", "content"), [
    ("flight.ulg", b"ULog\x01\x12\x35" + bytes(100)),
    ("flight.bin", b"\xa3\x95\x80" + bytes(100)),
    ("notes.fnr", b"my notes"),
    ("page.html", b"<html>my page</html>"),
    ("sensor.toml", b"gain = 1.0\n"),
    ("archive.fnr", b"PK\x03\x04" + bytes(100)),
    ("photo.png", b"\x89PNG\r\n\x1a\n" + bytes(50)),
])  # fmt: skip
def test_what_somebody_else_made_is_not_replaced(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    assert "was not written by flownav" in refused(tmp_path / name)
    assert (tmp_path / name).read_bytes() == content


def test_the_record_of_a_live_session_is_not_replaced_and_that_of_a_run_is(tmp_path):
    for kind, replaced in (("fly", True), ("replay", True), ("live", False)):
        path = tmp_path / f"{kind}.fnr"
        Record({"kind": kind}).save(path)
        before = path.read_bytes()
        if replaced:
            Record({"kind": kind, "seed": 2}).save(path)
            assert path.read_bytes() != before
        else:
            assert "was not written by flownav, or cannot be made again" in refused(path)
            Record({"kind": "live", "seed": 2}).save(path, replacing=True)
            assert Record.load(path).manifest["seed"] == 2


def test_an_empty_file_may_be_filled(tmp_path):
    (tmp_path / "x.fnr").touch()
    assert place(tmp_path / "x.fnr", force=False) == tmp_path / "x.fnr"


def test_a_rig_log_is_replaced_only_where_its_setup_says_that_it_is_ours(tmp_path):
    (tmp_path / "rig.csv").write_text("t_s\n0\n")
    with pytest.raises(InputError, match=r"rig.csv: .* not written by flownav"):
        check_rig_folder(tmp_path)
    digest = hashlib.sha256(b"t_s\n0\n").hexdigest()
    (tmp_path / "rig.toml").write_bytes(marked(f'rig_csv_sha256 = "{digest}"\n'))
    check_rig_folder(tmp_path)
    (tmp_path / "rig.csv").write_text("t_s\n1\n")
    with pytest.raises(InputError, match=r"rig.csv: .* not written by flownav"):
        check_rig_folder(tmp_path)
    (tmp_path / "rig.toml").write_text("height_m = 1\n")
    with pytest.raises(InputError, match=r"rig.toml: .* not written by flownav"):
        check_rig_folder(tmp_path)


def test_the_longest_name_is_written_and_nothing_is_left_of_a_failure(tmp_path):
    path = tmp_path / ("x" * 251 + ".fnr")
    Record().save(path)
    assert [file.name for file in tmp_path.iterdir()] == [path.name]
    with pytest.raises(FileNotFoundError), written_whole(tmp_path / "y.fnr") as temporary:
        temporary.rename(tmp_path / "absent" / "y")  # what breaks in the middle of the writing
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


def test_a_page_that_speaks_of_flownav_is_not_flownavs(tmp_path):
    mine, notes = tmp_path / "mine.html", tmp_path / "notes.html"
    guard.write_page("<html><head></head><body>a report</body></html>", mine)
    guard.write_page("<html><head></head><body>the next</body></html>", mine)
    assert "the next" in mine.read_text()
    notes.write_text("<html><head></head><body>my notes on flownav</body></html>")
    with pytest.raises(InputError, match="was not written by flownav"):
        guard.write_page("<html></html>", notes)
    assert "my notes" in notes.read_text()
