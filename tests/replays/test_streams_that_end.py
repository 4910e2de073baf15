"""Half of a sensor's file missing, at its end, its start or in the middle, is reported by `info` and by `replay`."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from flownav.logs.open_log import open_log
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import replay
from flownav.studies.inspection import summarise
from replay_logs import log_of_flight
from ulog_files import ulog_of_flight

NAMES = {"imu": "imu", "flow": "flow_rate", "range": "range", "gps": "gps_position", "attitude": "attitude"}


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    return log_of_flight(40.0).write(tmp_path_factory.mktemp("whole") / "garden")


def cut(whole: Path, folder: Path, name: str, part: str) -> Path:
    """The log with half of one file's rows gone; of a truncated file the last row is cut short."""
    shutil.copytree(whole, folder)
    file = folder / f"{name}.csv"
    head, *rows = file.read_text().splitlines(keepends=True)
    half, quarter = len(rows) // 2, len(rows) // 4
    kept = {
        "end": [*rows[:half], rows[half][:5]],
        "start": rows[half:],
        "middle": rows[:quarter] + rows[-quarter:],
    }[part]
    file.write_text("".join([head, *kept]))
    return folder


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("part", "words"), [
    ("end", "{} ends at "), ("start", "{} starts at "), ("middle", "{} has no usable reading for ")
])  # fmt: skip
def test_half_a_file_is_a_finding(whole, tmp_path, name, part, words):
    log = open_log(cut(whole, tmp_path / "cut", name, part))
    said = words.format(NAMES[name])
    told = summarise(log)["warnings"]
    assert any(line.startswith(said) for line in told), told
    flown = replay(log, ReplayOptions(), NavigatorSettingsFile())
    assert any(finding.text.startswith(said) for finding in flown.findings)
    assert set(told) >= {line for line in flown.scores()["warnings"] if line.startswith(tuple(NAMES.values()))}


def test_a_whole_log_has_none(whole):
    log = open_log(whole)
    assert summarise(log)["warnings"] == []
    assert replay(log, ReplayOptions(), NavigatorSettingsFile()).findings == []


def test_it_is_the_same_of_another_format(tmp_path):
    flown = log_of_flight(40.0)
    flown.tables["flow"] = {name: column[: len(column) // 2] for name, column in flown.tables["flow"].items()}
    (tmp_path / "x.ulg").write_bytes(ulog_of_flight(flown.tables).bytes())
    assert any(line.startswith("flow_rate ends at 19.") for line in summarise(open_log(tmp_path / "x.ulg"))["warnings"])
