"""`flownav compare` as a user meets it: rows, the table, the page, one-line errors; and the league."""

from __future__ import annotations

import importlib.util
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from command import printed
from flownav.cli.compare import command
from flownav.core.errors import InputError
from flownav.studies.compare.job import HEADINGS, cells, default_windows, logs_in, markdown, names_of, page, play
from places import PROJECT
from replay_logs import log_of_flight, write_table
from ulog_files import ulog_of_flight

KEYS = {"log", "settings", "estimator", "against", "horizontal_rms_m", "velocity_rms_m_s", "samples", "airborne",
        "end_drift_m", "outages"}  # fmt: skip


@pytest.fixture(scope="module")
def garden(tmp_path_factory) -> Path:
    """40 s with GPS."""
    return log_of_flight(40.0).write(tmp_path_factory.mktemp("logs") / "garden")


@pytest.fixture(scope="module")
def hall(tmp_path_factory) -> Path:
    """The same without GPS and attitude, with truth that moves."""
    flown = log_of_flight(40.0)
    del flown.tables["gps"], flown.tables["attitude"]
    t_s = np.arange(0.0, 39.5, 0.02)
    north, east, down = (np.interp(t_s, flown.t_s, column) for column in flown.position.T)
    folder = flown.write(tmp_path_factory.mktemp("logs") / "hall")
    write_table(folder / "truth.csv", {"t_s": t_s, "x_m": north, "y_m": east, "z_m": down})
    return folder


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")


def call(*arguments):
    app = typer.Typer()
    app.command()(command)
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def answer(*arguments) -> list[dict]:
    result = call(*arguments, "--json")
    assert result.exception is None, result.exception
    facts = json.loads(result.stdout, parse_constant=pytest.fail)  # no NaN, no Infinity
    return facts["rows"]


# -- rows ---------------------------------------------------------------------------------------------------
def test_each_log_has_its_estimators_and_each_row_its_keys(garden, hall):
    rows = answer(garden, hall, "--outages", "15:35:10")
    assert [(row["log"], row["estimator"], row["settings"]) for row in rows] == [
        ("garden", "flownav", "default"), ("garden", "dead reckoning", None),
        ("hall", "flownav", "default"), ("hall", "dead reckoning", None),
    ]  # fmt: skip
    assert all(set(row) == KEYS for row in rows)
    outside, reckoned, inside, _ = rows
    assert (outside["against"], inside["against"]) == ("gps", "truth")
    assert outside["end_drift_m"] is None
    assert inside["end_drift_m"] >= 0.0
    assert outside["samples"] == reckoned["samples"] > 150
    assert inside["airborne"]["samples"] < inside["samples"]
    assert [(cut["t0"], cut["t1"]) for cut in outside["outages"]["windows"]] == [(15.0, 25.0), (25.0, 35.0)]
    assert outside["outages"]["worst_m"] == max(cut["horizontal_rms_m"] for cut in outside["outages"]["windows"])
    assert reckoned["outages"]["worst_m"] < 0.3  # sensors without error
    assert inside["outages"] == {"median_m": None, "worst_m": None, "windows": []}


def test_a_log_with_gps_whole_says_what_its_place_shows(garden):
    whole = " ".join(call(garden, "--outages", "15:35:10").stdout.split())
    assert "receiver's own slow error" in whole
    assert "The columns named cut show that: the rms drift through 10 s without GPS." in whole


def test_a_log_with_nothing_to_hold_it_against_says_so(hall, tmp_path):
    bare = Path(shutil.copytree(hall, tmp_path / "bare"))
    (bare / "truth.csv").unlink()
    for row in answer(bare):
        assert row["against"] is row["horizontal_rms_m"] is row["velocity_rms_m_s"] is row["airborne"] is None
        assert row["samples"] == 0


def test_every_setting_gives_a_row(garden, tmp_path):
    (tmp_path / "a.toml").write_text("gate_sigma = 0.001\n")
    (tmp_path / "b.toml").write_text("gate_sigma = 5.0\n")
    rows = answer(garden, "--with", "default", "--with", "a.toml", "--with", "b.toml")
    assert [row["settings"] for row in rows] == ["default", "a.toml", "b.toml", None]
    assert rows[1]["horizontal_rms_m"] != rows[2]["horizontal_rms_m"]
    assert rows[0]["horizontal_rms_m"] == rows[2]["horizontal_rms_m"]  # 5 is what is shipped


def test_the_autopilots_own_estimate_is_scored_at_its_own_instants(tmp_path):
    flown = log_of_flight(40.0)
    writer = ulog_of_flight(flown.tables)
    t_s = np.arange(5.0, 39.0, 0.1)
    t_s = t_s[(t_s < 20.0) | (t_s > 24.0)]  # a pause
    north, east, down = (np.interp(t_s, flown.t_s, column) for column in flown.position.T)
    speed = [np.interp(t_s, flown.t_s, column) for column in flown.velocity.T]
    writer.add(
        "vehicle_local_position", t_s, float__x=north + 5.0, float__y=east - 3.0, float__z=down,
        float__vx=speed[0], float__vy=speed[1], float__vz=speed[2],
    )  # fmt: skip
    rows = answer(writer.write(tmp_path / "garden.ulg"))
    assert [(row["estimator"], row["settings"]) for row in rows][-1] == ("autopilot", "PX4 EKF2")
    assert {row["samples"] for row in rows} == {rows[0]["samples"]}
    assert rows[0]["samples"] == pytest.approx((34.0 - 4.0) * 5.0, abs=5)
    assert rows[-1]["horizontal_rms_m"] < 0.1  # its origin is another: no error
    assert rows[-1]["outages"]["windows"] == []


# -- what people see ----------------------------------------------------------------------------------------
def test_people_get_one_table_and_a_page(garden, hall):
    result = call(garden, hall, "--out", "pages/compared.html", "--outages", "15:35:10")
    assert result.exception is None, result.exception
    for word in ("garden, by gps", "hall, by truth", "  flownav (default) ", "  dead reckoning ", "end drift"):
        assert word in result.stdout
    text = Path("pages/compared.html").read_text()
    assert "</html>" in text
    assert "<script" not in text
    assert "15 to 25 s" in text
    assert text.count("dead reckoning") == 3  # two rows, and the GPS cuts of one log


def test_names_on_the_page_are_escaped(garden, tmp_path):
    nasty = Path(shutil.copytree(garden, tmp_path / "<b>bold"))
    assert call(nasty, "--out", "page.html").exception is None
    assert "<b>bold" not in Path("page.html").read_text()


def test_figures_and_dashes_stand_under_their_headings():
    row = {"log": "a", "settings": None, "estimator": "dead reckoning", "against": None, "horizontal_rms_m": None,
           "velocity_rms_m_s": 0.125, "airborne": {"horizontal_rms_m": 2.0, "velocity_rms_m_s": None, "samples": 9},
           "end_drift_m": 0.5, "outages": {"median_m": None, "worst_m": 1.25, "windows": []}, "samples": 5}  # fmt: skip
    assert cells(row) == ("a", "dead reckoning", "-", "-", "2.00", "0.12", "-", "0.50", "-", "1.25")
    assert len(cells(row)) == len(HEADINGS)
    lines = markdown([row]).splitlines()
    assert len(lines) == 3
    assert len({line.count("|") for line in lines}) == 1


@pytest.mark.parametrize(("span", "first", "count"), [
    ((0.0, 848.9), 60.0, 12), ((-0.016, 702.1), 60.0, 9), ((1000.4, 1200.0), 1060.0, 1),
])  # fmt: skip
def test_the_usual_cuts_are_whole_minutes_inside_the_flight(span, first, count):
    windows = default_windows(span)
    assert len(windows) == count
    assert all(t1 - t0 == 60.0 and t1 <= span[1] - 60.0 for t0, t1 in windows)
    assert not windows or windows[0][0] == first


@pytest.mark.parametrize(("span", "windows"), [
    ((0.0, 179.9), [(36.0, 89.0), (89.0, 142.0)]), ((0.2, 100.0), [(20.0, 50.0), (50.0, 80.0)]),
    ((500.0, 534.0), [(507.0, 517.0), (517.0, 527.0)]), ((0.0, 30.0), []), ((0.0, 0.0), []),
])  # fmt: skip
def test_a_short_flight_is_cut_twice_in_its_middle(span, windows):
    assert default_windows(span) == windows


def test_logs_of_one_name_are_told_apart():
    paths = [Path("/d/a/x.tlog"), Path("/d/b/x.tlog"), Path("/d/y.bin"), Path("/e/a/x.tlog")]
    assert names_of(paths) == ["d/a/x.tlog", "b/x.tlog", "y.bin", "e/a/x.tlog"]
    assert names_of([]) == []


# -- mistakes -----------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("arguments", "said"), [
    (("absent",), "absent: no such log; give a folder of CSV files"),
    (("GARDEN", "--with", "absent.toml"), "absent.toml: no such file"),
    (("GARDEN", "--with", "default", "--with", "default"), "--with default: named twice"),
    (("GARDEN", "--sensor", "absent.toml"), "absent.toml"),
    (("GARDEN", "--outages", "10:20"), "--outages 10:20: T0:T1:LENGTH is needed, numbers"),
    (("GARDEN", "--outages", "20:10:5"), "--outages 20:10:5: T0:T1:LENGTH is needed"),
    (("GARDEN", "--outages", "0:10:50"), "--outages 0:10:50: that is 0 windows"),
    (("GARDEN", "--outages", "100:160:60"), "--outages 100:160:60: 100 to 160 s is outside the log"),
    (("HALL", "--outages", "10:20:5"), "--outages 10:20:5: none of the logs has GPS to cut"),
    (("GARDEN", "--out", "taken/page.html"), "cannot be written"),
])  # fmt: skip
def test_a_mistake_is_one_line_and_leaves_no_file(garden, hall, tmp_path, arguments, said):
    (tmp_path / "taken").write_text("")
    places = {"GARDEN": garden, "HALL": hall}
    result = call(*(places.get(argument, argument) for argument in arguments))
    assert isinstance(result.exception, InputError), result.exception
    assert said in printed(result.exception)
    assert "\n" not in str(result.exception)
    assert result.stdout == ""
    assert [path.name for path in Path.cwd().iterdir()] == ["taken"]


# -- the league ---------------------------------------------------------------------------------------------
@pytest.fixture
def stock(garden, tmp_path) -> Path:
    """A folder of logs: one that flies, one that has no IMU, one that is no log."""
    shutil.copytree(garden, tmp_path / "stock" / "outside" / "garden")
    lame = Path(shutil.copytree(garden, tmp_path / "stock" / "lame"))
    for name in ("imu", "attitude"):
        (lame / f"{name}.csv").unlink()
    (tmp_path / "stock" / "README.md").write_text("none")
    return tmp_path / "stock"


def test_the_league_plays_what_can_fly_and_says_what_cannot(stock):
    assert logs_in(stock) == [stock / "lame", stock / "outside" / "garden"]
    rows, left_out = play(logs_in(stock), lambda name: None)
    assert [row["log"] for row in rows] == ["garden", "garden"]
    assert [name for name, _ in left_out] == ["lame"]
    text = page(rows, left_out)
    assert "- `lame`: one of attitude.csv, imu.csv missing" in text
    assert "| garden | flownav (default) | gps |" in text


def test_its_page_is_written_whole_and_bears_no_date(stock, capsys):
    spec = importlib.util.spec_from_file_location("league", PROJECT / "tools" / "league.py")
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    tool.main(stock, Path("league.md"))
    first = Path("league.md").read_text()
    assert capsys.readouterr().out.strip() == first.strip()
    tool.main(stock, Path("league.md"))
    assert Path("league.md").read_text() == first


@pytest.mark.parametrize("name", ["absent", "empty"])
def test_a_league_of_nothing_says_so_in_one_line(tmp_path, name):
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="set FLOWNAV_DATA to the folder of logs") as caught:
        logs_in(tmp_path / name)
    assert "\n" not in str(caught.value)
