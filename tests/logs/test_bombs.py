"""Small files that would become large ones: one line, soon, in little memory."""

from __future__ import annotations

import pytest

from blackbox_logs import blackbox_log
from blackbox_logs import quantised as box_tables
from crazyflie_logs import deck_log
from crazyflie_logs import quantised as deck_tables
from flownav.core.errors import InputError
from flownav.logs.assembly import MOST_BYTES, content_of
from flownav.logs.csv_table import MOST_COLUMNS, MOST_HEADER_BYTES
from flownav.logs.open_log import open_log
from fuzzing import FLOOR_BYTES, peak_bytes
from mavlink_logs import flight_log
from replay_logs import log_of_flight


@pytest.fixture
def folder(tmp_path):
    return log_of_flight(4.0).write(tmp_path / "log")


def refused(path):
    """The one line of a refusal that took little memory."""
    before = peak_bytes(anew=True)
    with pytest.raises(InputError) as error:
        open_log(path)
    assert peak_bytes() - before < FLOOR_BYTES
    assert "\n" not in str(error.value)
    return str(error.value)


def lengthened(path, size=4 << 30):
    """The file with nothing after it, which takes no room on the disk."""
    with path.open("r+b") as file:
        file.truncate(size)
    return path


def test_a_log_of_four_gigabytes_of_nothing_is_refused(folder, tmp_path):
    flown = log_of_flight(4.0)
    logs = {
        "x.tlog": flight_log(4.0).content,
        "x.bbl": blackbox_log(box_tables(flown.tables, inav=True), inav=True).content(),
        "x.log": deck_log(deck_tables(flown.tables)).content(),
    }
    for name, content in logs.items():
        (tmp_path / name).write_bytes(content)
        assert f"{name}: larger than 1024 MB; cut the log into pieces" in refused(lengthened(tmp_path / name))
    lengthened(folder / "gps.csv")
    assert "gps.csv: larger than 1024 MB; cut the log into pieces" in refused(folder)


def test_what_the_memory_does_not_hold_is_said(folder, monkeypatch):
    def none_left(self, *given):
        raise MemoryError

    class File:
        __enter__, __exit__ = (lambda self: self), (lambda self, *error: None)
        read = none_left

    monkeypatch.setattr("pathlib.Path.open", lambda self, *given: File())
    with pytest.raises(InputError, match=r"gps.csv: 0 MB do not fit into the memory; cut the log into pieces"):
        content_of(folder / "gps.csv", "a log")
    assert MOST_BYTES == 1 << 30


def test_a_first_line_of_three_million_columns_is_refused(folder):
    (folder / "gps.csv").write_bytes(b"t_s," * 3_000_000 + b"\n0\n")
    assert f"gps.csv: its first line has more than {MOST_HEADER_BYTES} bytes; a CSV table is needed" in refused(folder)
    (folder / "gps.csv").write_bytes(b"a," * 100_000 + b"\n0\n")
    assert f"gps.csv: 100001 columns; at most {MOST_COLUMNS} are read" in refused(folder)
    (folder / "gps.csv").write_bytes(b"x" * (MOST_HEADER_BYTES + 1))
    assert "its first line has more than" in refused(folder)
