"""A replay's warnings on a log whose flow, heading, clock or climb is wrong, and none on a good one."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from flownav.cli.replay import command
from flownav.core.errors import VerdictError
from flownav.core.record import Record
from flownav.logs.csv_folder import read_csv_folder
from flownav.logs.log import Log
from flownav.replays.prepare import ReplayOptions, prepare
from flownav.replays.sentinel import findings
from replay_logs import SyntheticLog, log_of_flight, write_table

Tables = dict[str, dict[str, np.ndarray]]
CUT = ((60.0, 100.0),)


# -- ways to spoil a log's tables --------------------------------------------------------------------------
def flow_read_as(matrix) -> Callable[[Tables], None]:
    def spoil(tables: Tables) -> None:
        flow = tables["flow"]
        both = np.array(matrix, float) @ np.array([flow["flow_x_rad_s"], flow["flow_y_rad_s"]])
        flow["flow_x_rad_s"], flow["flow_y_rad_s"] = both

    return spoil


def yaw_by(degrees: float) -> Callable[[Tables], None]:
    def spoil(tables: Tables) -> None:
        yaw = tables["attitude"]["yaw_rad"] + np.radians(degrees)
        tables["attitude"]["yaw_rad"] = (yaw + np.pi) % (2 * np.pi) - np.pi

    return spoil


def gps_late_by(seconds: float) -> Callable[[Tables], None]:
    def spoil(tables: Tables) -> None:
        tables["gps"]["t_s"] = tables["gps"]["t_s"] + seconds

    return spoil


def climb_negated(tables: Tables) -> None:
    tables["gps"]["vel_d_m_s"] = -tables["gps"]["vel_d_m_s"]


def both(*spoils: Callable[[Tables], None]) -> Callable[[Tables], None]:
    def spoil(tables: Tables) -> None:
        for one in spoils:
            one(tables)

    return spoil


SPOILT = {
    "signs": (flow_read_as([[-1, 0], [0, -1]]), ["flow sign is inverted (both axes)"], True),
    "sign of x": (flow_read_as([[-1, 0], [0, 1]]), ["flow sign is inverted on the x axis"], True),
    "sign of y": (flow_read_as([[1, 0], [0, -1]]), ["flow sign is inverted on the y axis"], True),
    "axes": (flow_read_as([[0, 1], [1, 0]]), ["flow axes are swapped"], True),
    "axes and signs": (flow_read_as([[0, -1], [-1, 0]]), ["flow axes are swapped and their signs inverted"], True),
    "a turned sensor": (flow_read_as([[0, 1], [-1, 0]]), ["flow axes are swapped and the sign of one"], True),
    "heading": (yaw_by(90.0), ["heading is off by about", "clockwise of"], False),
    "heading the other way": (yaw_by(-90.0), ["heading is off by about", "anticlockwise of"], False),
    "a late clock": (gps_late_by(5.0), ["GPS clock is late by about"], False),
    "an early clock": (gps_late_by(-3.0), ["GPS clock is early by about"], False),
    "climb": (climb_negated, ["vel_d of GPS has the wrong sign"], False),
    "heading and clock": (both(yaw_by(90.0), gps_late_by(5.0)), ["heading is off by", "GPS clock is late by"], False),
}


@pytest.fixture(scope="module")
def outdoor_tables(data_folder) -> Tables:
    """The first two minutes of the outdoor log, as tables."""
    tables = {}
    for name in ("attitude", "imu", "gps", "flow", "range", "baro"):
        path = data_folder / "quad-px4flow-outdoor" / f"{name}.csv"
        columns = path.read_text().split("\n", 1)[0].split(",")
        rows = np.loadtxt(path, delimiter=",", skiprows=1)
        rows = rows[rows[:, 0] < 120.0]
        tables[name] = dict(zip(columns, rows.T.copy(), strict=True))
    return tables


def folder_of(tables: Tables, spoil: Callable[[Tables], None], folder: Path) -> Path:
    copy = {name: dict(columns) for name, columns in tables.items()}
    spoil(copy)
    folder.mkdir()
    for name, columns in copy.items():
        write_table(folder / f"{name}.csv", columns)
    return folder


def found_in(log: Log, outages=(), **options) -> list[tuple[str, bool]]:
    streams = prepare(log, ReplayOptions(**options)).streams
    return [(finding.text, finding.flow_is_wrong) for finding in findings(streams, outages)]


def expect(found: list[tuple[str, bool]], words: list[str], wrong: bool) -> None:
    assert len(found) == 1, found
    assert all(word in found[0][0] for word in words), found
    assert found[0][1] == wrong


@pytest.mark.parametrize("how", SPOILT)
def test_a_spoilt_copy_of_the_outdoor_log_is_found_out(outdoor_tables, tmp_path, how):
    spoil, words, wrong = SPOILT[how]
    expect(found_in(read_csv_folder(folder_of(outdoor_tables, spoil, tmp_path / "log")), CUT), words, wrong)


@pytest.mark.parametrize("how", [how for how in SPOILT if how != "a turned sensor"])
def test_a_spoilt_synthetic_log_is_found_out(tmp_path, how):
    """Without quick rotation a turned sensor is the same as a turned heading; all else is not."""
    spoil, words, wrong = SPOILT[how]
    synthetic = log_of_flight(90.0, gps_hz=10.0)
    expect(found_in(read_csv_folder(folder_of(synthetic.tables, spoil, tmp_path / "log"))), words, wrong)


def test_the_clocks_error_and_the_headings_are_told_by_size(outdoor_tables, tmp_path):
    late = folder_of(outdoor_tables, gps_late_by(5.0), tmp_path / "late")
    (said, _), = found_in(read_csv_folder(late), CUT)  # fmt: skip
    assert float(said.split("about ")[1].split(" s")[0]) == pytest.approx(5.0, abs=0.3)
    assert found_in(read_csv_folder(late), CUT, gps_delay_s=5.0) == []
    turned = folder_of(outdoor_tables, yaw_by(90.0), tmp_path / "turned")
    (said, _), = found_in(read_csv_folder(turned), CUT)  # fmt: skip
    assert float(said.split("about ")[1].split(" deg")[0]) == pytest.approx(90.0, abs=8.0)


def part(log: Log, t0: float, t1: float) -> Log:
    streams = {}
    for sensor, stream in log.streams.items():
        rows = (stream.t_s >= t0) & (stream.t_s < t1)
        columns = {name: getattr(stream, name)[rows] for name in ("t_s", "value", "variance", "quality")}
        streams[sensor] = replace(stream, **columns)
    return replace(log, streams=streams)


def test_nothing_is_said_of_the_outdoor_log_whole_or_in_any_part(data_folder):
    log = read_csv_folder(data_folder / "quad-px4flow-outdoor")
    assert found_in(log) == []
    for length in (30.0, 60.0, 120.0):
        for t0 in np.arange(0.0, 840.0 - length, 30.0):
            assert found_in(part(log, t0, t0 + length)) == [], (t0, length)


@pytest.mark.parametrize("options", [{}, {"yaw_rate": 0.3}, {"sensor_gyro": False}, {"gps_hz": 1.0}, {"flow_hz": 50.0}])
def test_nothing_is_said_of_a_good_synthetic_log(tmp_path, options):
    assert found_in(read_csv_folder(log_of_flight(60.0, **options).write(tmp_path / "log"))) == []


def test_nothing_is_said_without_gps_or_motion(outdoor_tables, tmp_path):
    inverted = flow_read_as([[-1, 0], [0, -1]])
    log = read_csv_folder(folder_of(outdoor_tables, inverted, tmp_path / "log"))
    assert found_in(log, ((0.0, 200.0),)) == []
    assert found_in(part(log, 0.0, 12.0)) == []  # take-off and hover


def test_a_velocity_of_the_wrong_sign_is_found_out_too(tmp_path):
    def as_velocity(tables: Tables, sign: float) -> Tables:
        flow, range_m = tables.pop("flow"), tables["range"]["range_m"]
        tables["px4flow"] = {
            "t_s": flow["t_s"],
            "flow_comp_m_x_m_s": sign * (flow["flow_y_rad_s"] - flow["gyro_y_rad_s"]) * range_m,
            "flow_comp_m_y_m_s": sign * (flow["gyro_x_rad_s"] - flow["flow_x_rad_s"]) * range_m,
            "ground_distance_m": range_m,
            "quality": flow["quality"],
        }
        return tables

    for sign, words in ((1.0, None), (-1.0, "flow sign is inverted (both axes)")):
        tables = as_velocity(log_of_flight(60.0).tables, sign)
        found = found_in(read_csv_folder(SyntheticLog(tables).write(tmp_path / f"{sign:g}")))
        assert (words is None and found == []) or (words in found[0][0] and found[0][1])


# -- as a user meets it ------------------------------------------------------------------------------------
def call(*arguments):
    app = typer.Typer()
    app.command()(command)
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture
def inverted(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return folder_of(log_of_flight(40.0).tables, flow_read_as([[-1, 0], [0, -1]]), tmp_path / "inverted")


def test_wrong_flow_is_a_bad_verdict_after_everything_is_written(inverted):
    result = call(inverted, "--no-report", "--json")
    assert isinstance(result.exception, VerdictError)
    assert "flow sign is inverted" in str(result.exception)
    facts = json.loads(result.stdout)
    assert [warning.split(" (")[0] for warning in facts["warnings"]] == ["flow sign is inverted"]
    events = Record.load(Path(facts["record"])).tables["events"]
    assert "warning" in list(events["kind"])
    result = call(inverted, "--no-report")
    assert isinstance(result.exception, VerdictError)
    assert "Warning: flow sign is inverted" in result.stdout


def test_another_fault_is_a_warning_and_no_bad_verdict(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = call(folder_of(log_of_flight(40.0).tables, yaw_by(90.0), tmp_path / "turned"), "--no-report")
    assert result.exception is None
    assert "Warning: heading is off by about" in result.stdout


def test_a_replay_that_fuses_nothing_says_so(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    tables = log_of_flight(20.0).tables
    folder = SyntheticLog({name: tables[name] for name in ("attitude", "flow")}).write(tmp_path / "blind")
    assert "Note: nothing horizontal was fused" in call(folder, "--no-report").stdout
    facts = json.loads(call(folder, "--no-report", "--json").stdout)
    assert facts["warnings"][0].startswith("nothing horizontal was fused")


def test_without_flow_or_gps_the_barometer_alone_is_nothing_horizontal(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    tables = log_of_flight(20.0).tables
    folder = SyntheticLog({name: tables[name] for name in ("attitude", "flow", "baro")}).write(tmp_path / "blind")
    assert json.loads(call(folder, "--no-report", "--json").stdout)["warnings"][0].startswith("nothing horizontal")
