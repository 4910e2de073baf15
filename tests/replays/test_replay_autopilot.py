"""The autopilot's own estimate beside a replay: its path in our frame, its errors, and both in the log again."""

from __future__ import annotations

import json

import numpy as np
import pytest
import typer
from pyulog import ULog
from typer.testing import CliRunner

from flownav.cli.records import export_to as export_command
from flownav.cli.replay import command as replay_command
from flownav.core.frames import quaternion_from_euler, rotation_from_quaternion, to_body, to_earth
from flownav.core.measurement import Sensor, Stream
from flownav.core.record import POSITION_NED, QUATERNION, VELOCITY_BODY, Record
from flownav.logs.ulog import read_ulog
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.replays.bundle import to_record
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import replay
from flownav.scoring.path import moved_by, placed_in
from flownav.scoring.phases import phases_of
from replay_logs import SyntheticLog, log_of_flight
from ulog_files import START_US, ulog_of_flight

OFF_BY = (5.0, -3.0, 0.5)  # the autopilot's origin is not the first fix


@pytest.fixture(scope="module")
def flown() -> SyntheticLog:
    return log_of_flight(20.0)


@pytest.fixture(scope="module")
def ulog(flown, tmp_path_factory):
    t_s = np.arange(0.5, 19.0, 0.1)
    position, velocity = path_of(flown, t_s)
    columns = {f"float__{name}": column for name, column in zip("xyz", (position + OFF_BY).T, strict=True)}
    columns |= {f"float__v{name}": column for name, column in zip("xyz", velocity.T, strict=True)}
    writer = ulog_of_flight(flown.tables).add("vehicle_local_position", t_s, **columns)
    return writer.write(tmp_path_factory.mktemp("log") / "garden.ulg")


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def path_of(flown: SyntheticLog, t_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return tuple(
        np.column_stack([np.interp(t_s, flown.t_s, column) for column in vectors.T])
        for vectors in (flown.position, flown.velocity)
    )


def call(command, *arguments):
    app = typer.Typer()
    app.command()(command)
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exception is None, result.exception
    return result.stdout


def columns(table, names) -> np.ndarray:
    return np.column_stack([table[name] for name in names])


def test_the_record_holds_it_in_our_frame_and_its_errors_beside_ours(ulog, tmp_path):
    scores = json.loads(call(replay_command, ulog, "--out", tmp_path / "a.fnr", "--no-report", "--json"))
    own = scores["autopilot"]
    assert (own["name"], own["against"]) == ("PX4 EKF2", "gps")
    assert own["horizontal_rms_m"] < 0.02
    record = Record.load(tmp_path / "a.fnr")
    assert record.manifest["scores"]["autopilot"] == own
    theirs, ours = record.tables["autopilot"], record.tables["estimate"]
    assert set(theirs) == {"t_s", *POSITION_NED, *VELOCITY_BODY, *QUATERNION}
    late = theirs["t_s"] > 2.0
    for name in (*POSITION_NED, *VELOCITY_BODY):
        assert theirs[name][late] == pytest.approx(np.interp(theirs["t_s"][late], ours["t_s"], ours[name]), abs=0.05)
    said = " ".join(call(replay_command, ulog, "--no-report").split())
    assert "The autopilot's own estimate (PX4 EKF2) against GPS, mean difference taken out: horizontal 0.0" in said


def test_a_replayed_ulog_takes_our_estimate_and_theirs_at_their_times(ulog, tmp_path):
    call(replay_command, ulog, "--out", tmp_path / "a.fnr", "--no-report")
    call(export_command, tmp_path / "a.fnr", "--to", "ulog", "--merge", ulog, "--out", tmp_path / "merged.ulg")
    merged, record = ULog(str(tmp_path / "merged.ulg")), Record.load(tmp_path / "a.fnr")
    first_reading_us = min(topic.data["timestamp"][0] for topic in ULog(str(ulog)).data_list)
    assert record.manifest["clock_start_s"] == pytest.approx(1e-6 * first_reading_us)
    for name in ("estimate", "autopilot"):
        stamps = merged.get_dataset(f"flownav_{name}").data["timestamp"]
        assert stamps == pytest.approx(first_reading_us + 1e6 * record.tables[name]["t_s"], abs=1.0)
    vehicle = merged.get_dataset("vehicle_local_position").data
    again = merged.get_dataset("flownav_autopilot").data
    assert np.array_equal(again["timestamp"], vehicle["timestamp"])
    assert vehicle["timestamp"][0] == START_US + 500_000
    assert vehicle["x"] - again["x"] == pytest.approx(np.full(len(again["x"]), OFF_BY[0]), abs=0.1)


def test_without_gps_it_is_turned_with_its_attitude_and_shifted(flown):
    """Its velocity over ground turns with the path; its body velocity stays."""
    t_s, turn = np.arange(1.0, 19.0, 0.1), 1.2
    position, velocity = path_of(flown, t_s)
    c, s = np.cos(turn), np.sin(turn)
    turned = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    yaw = np.linspace(-1.0, 2.0, len(t_s))
    straight = np.column_stack(quaternion_from_euler(0.1 + 0.0 * yaw, -0.05 + 0.0 * yaw, yaw))
    askew = np.column_stack(quaternion_from_euler(0.1 + 0.0 * yaw, -0.05 + 0.0 * yaw, yaw + turn))
    body = np.column_stack(to_body(rotation_from_quaternion(*straight.T), *velocity.T))
    estimate = {"t_s": t_s, **dict(zip(POSITION_NED, (position @ turned.T + OFF_BY).T, strict=True)),
                **dict(zip(VELOCITY_BODY, body.T, strict=True)),
                **dict(zip(QUATERNION, askew.T, strict=True))}  # fmt: skip
    placed = moved_by(estimate, placed_in(flown.t_s, flown.position, estimate, {}))
    assert columns(placed, POSITION_NED) == pytest.approx(position, abs=1e-6)
    assert columns(placed, VELOCITY_BODY) == pytest.approx(body)
    rotation = rotation_from_quaternion(*columns(placed, QUATERNION).T)
    assert np.column_stack(to_earth(rotation, *body.T)) == pytest.approx(velocity, abs=1e-6)


def test_it_is_left_out_where_nothing_says_where_it_lies(flown):
    t_s = np.arange(1.0, 19.0, 0.1)
    estimate = {"t_s": t_s + 1000.0, **dict(zip(POSITION_NED, path_of(flown, t_s)[0].T, strict=True))}
    gps = {Sensor.GPS_POSITION: Stream.of(Sensor.GPS_POSITION, t_s, path_of(flown, t_s)[0])}
    assert placed_in(flown.t_s, flown.position, estimate, {}) is None
    assert placed_in(flown.t_s, flown.position, estimate, gps) is None


def test_the_record_of_a_replay_keeps_the_landed_state_and_what_the_log_told_and_phases_follow_it(tmp_path):
    flown = log_of_flight(30.0)
    writer = ulog_of_flight(flown.tables).add("vehicle_status", [0.5, 9.0], uint8_t__nav_state=[2, 4])
    writer.add("vehicle_land_detected", [0.1, 12.0, 25.0], bool__landed=[True, False, True])
    log = read_ulog(writer.write(tmp_path / "flight.ulg"))
    record = to_record(replay(log, ReplayOptions(), NavigatorSettingsFile()), {"duration_s": 30.0}, "")
    assert record.tables["landed"]["landed"].tolist() == [1.0, 0.0, 1.0]
    phases = phases_of(record)
    assert phases[0].name == "ground"
    assert phases[0].t1 == pytest.approx(12.0, abs=0.2)
    assert [phase.name for phase in phases][-2:] == ["touchdown", "landed"]
    told = [row for row in zip(*(record.tables["events"][name] for name in ("source", "kind", "detail")), strict=True)
            if row[0] == "autopilot"]  # fmt: skip
    assert told == [("autopilot", "mode", "Position"), ("autopilot", "mode", "Hold")]
