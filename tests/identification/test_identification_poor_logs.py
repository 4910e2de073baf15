"""Flights as they come: long on the ground, without attitude, with a sonar that jumps, with a scale that falls."""

from __future__ import annotations

import json

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

import replay_logs
from flownav.cli import identify as identify_command
from flownav.core.errors import InputError
from flownav.core.measurement import Sensor
from flownav.lab.identification.flight import flight, jumps
from flownav.lab.identification.flight_identification import identify_flight
from flownav.lab.identification.job import identify
from flownav.lab.identification.quantities import CANDIDATES
from flownav.logs.csv_folder import read_csv_folder
from flownav.replays.judged import airborne_of, flying_at

YAW_RAD = 0.7


def made(duration_s=60.0, *, gain=lambda speed: 0.9 + 0.0 * speed, without=("gps",), noise_rad_s=0.02):
    """A flight against truth.csv, turned, whose sensor reads gain(speed) of the motion; on the ground to 3 s."""
    log, random = replay_logs.log_of_flight(duration_s), np.random.default_rng(4)
    flow = log.tables["flow"]
    speed = np.interp(flow["t_s"], log.t_s, np.hypot(*log.velocity[:, :2].T))
    for axis in "xy":
        moving = flow[f"flow_{axis}_rad_s"] - flow[f"gyro_{axis}_rad_s"]
        error = noise_rad_s * random.standard_normal(len(moving))
        flow[f"flow_{axis}_rad_s"] = flow[f"gyro_{axis}_rad_s"] + gain(speed) * moving + error
    t_s = np.arange(0.0, duration_s, 0.02)
    north, east, down = (np.interp(t_s, log.t_s, column) for column in log.position.T)
    c, s = np.cos(YAW_RAD), np.sin(YAW_RAD)
    log.tables["truth"] = {"t_s": t_s, "x_m": c * north - s * east, "y_m": s * north + c * east, "z_m": down}
    for name in without:
        del log.tables[name]
    return log


def parked(log, seconds):
    """The same log after so long on the ground: its first rows stand still for that time."""
    for name, table in log.tables.items():
        step = float(np.median(np.diff(table["t_s"])))
        count = round(seconds / step)
        for column, values in table.items():
            still = values[0] - step * np.arange(count, 0, -1) if column == "t_s" else np.full(count, values[0])
            table[column] = np.concatenate([still, values])
        table["t_s"] = table["t_s"] + seconds
        log.tables[name] = table
    return log


def sonar(log, share, seed=1):
    """A share of the ranges in flight are echoes of something else, metres away, a few readings long."""
    random, distance = np.random.default_rng(seed), log.tables["range"]
    wrong = np.repeat(random.random(len(distance["t_s"]) // 2 + 1) < share, 2)[: len(distance["t_s"])]
    wrong &= distance["t_s"] > 6.0
    distance["range_m"] = np.where(wrong, random.uniform(0.3, 6.0, len(wrong)), distance["range_m"])
    return log


# -- without an attitude -----------------------------------------------------------------------------------
def test_a_flight_without_attitude_is_identified_on_the_navigators_own(tmp_path):
    folder = made(without=("gps", "attitude", "mag", "baro")).write(tmp_path / "flight")
    found = identify([folder])
    assert found.kind == "flight"
    assert found.reference == "truth.csv"
    assert found.axes.right
    for response in found.responses:
        assert response.gain.value == pytest.approx(0.9, abs=0.03)
        assert response.latency_s.low <= 0.025 <= response.latency_s.high
    assert any("the log has no attitude: it is the navigator's own" in note for note in found.notes)
    assert found.details["reference_yaw_deg"] == pytest.approx(np.degrees(YAW_RAD) + np.degrees(0.3), abs=6.0)


def test_neither_attitude_nor_imu_is_refused_in_one_line(tmp_path):
    read = read_csv_folder(made().write(tmp_path))
    for sensor in (Sensor.ATTITUDE, Sensor.IMU):
        del read.streams[sensor]
    with pytest.raises(InputError, match="neither attitude nor IMU"):
        flight(read)


# -- in flight only ----------------------------------------------------------------------------------------
def test_readings_on_the_ground_are_left_out(tmp_path):
    """Two minutes on the ground and one in the air: the height is that of the flight."""
    log = parked(made(), 120.0)
    found = identify_flight(log.write(tmp_path / "truth"), CANDIDATES)
    assert found.responses[0].height_m > 2.0
    assert found.details["usable_share"] < 0.4
    del log.tables["truth"]
    read = read_csv_folder(parked(made(without=()), 120.0).write(tmp_path / "gps"))
    read = type(read)(read.path, read.streams)  # nobody but the range says when it flew
    start, _ = airborne_of(read)
    assert 122.0 < start < 125.5
    assert not flying_at(read, np.array([60.0]))[0]
    assert flying_at(read, np.array([150.0]))[0]


def test_a_landing_between_two_flights_is_left_out(tmp_path):
    log = made()
    log.tables["landed"] = {"t_s": np.array([0.0, 4.0, 30.0, 40.0]), "landed": np.array([1.0, 0.0, 1.0, 0.0])}
    read = read_csv_folder(log.write(tmp_path))
    assert flying_at(read, np.array([2.0, 20.0, 35.0, 50.0])).tolist() == [False, True, False, True]
    flown = flight(read)
    assert not flown.good[(flown.t_s > 30.2) & (flown.t_s < 40.0)].any()


def test_flow_without_a_range_beside_it_is_left_out(tmp_path):
    log = made()
    distance = log.tables["range"]
    kept = (distance["t_s"] < 20.0) | (distance["t_s"] > 30.0)
    log.tables["range"] = {name: values[kept] for name, values in distance.items()}
    flown = flight(read_csv_folder(log.write(tmp_path)))
    assert not flown.good[(flown.t_s > 21.0) & (flown.t_s < 29.0)].any()


# -- a range that jumps ------------------------------------------------------------------------------------
def test_the_intervals_take_in_a_range_that_jumps(tmp_path):
    clean, poor = (
        identify_flight(sonar(made(), share).write(tmp_path / str(share)), CANDIDATES) for share in (0.0, 0.3)
    )
    assert not any("jumps" in note for note in clean.notes)
    assert any(note.startswith("range: it jumps in") for note in poor.notes)
    for before, after in zip(clean.responses, poor.responses, strict=True):
        assert after.gain.low < 0.9 < after.gain.high
        assert after.gain.high - after.gain.low > 3.0 * (before.gain.high - before.gain.low)
        assert after.gain.high - after.gain.low > 0.2


def test_a_range_that_is_all_jumps_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"the range jumps in \d+% of its steps in flight"):
        identify_flight(sonar(made(), 0.95).write(tmp_path), CANDIDATES)


def test_a_climb_is_no_jump():
    t_s = np.arange(0.0, 20.0, 0.05)
    assert jumps(t_s, 1.0 + 3.0 * t_s) == (0.0, 0.0)
    share, doubt = jumps(t_s, np.where(np.arange(400) % 10 == 5, 4.0, 2.0))
    assert share == pytest.approx(0.2, abs=0.01)
    assert doubt == pytest.approx(share)


def test_flow_that_does_not_follow_the_reference_is_refused(tmp_path):
    log = made()
    random = np.random.default_rng(8)
    for axis in "xy":
        log.tables["flow"][f"flow_{axis}_rad_s"] = random.standard_normal(len(log.tables["flow"]["t_s"]))
    with pytest.raises(InputError, match=r"the flow does not follow the reference \(truth.csv; their velocities'"):
        identify_flight(log.write(tmp_path), CANDIDATES)


# -- scale against speed -----------------------------------------------------------------------------------
def test_a_scale_that_falls_with_speed_is_found_with_its_interval(tmp_path):
    found = identify_flight(made(120.0, gain=lambda speed: 0.95 - 0.05 * speed).write(tmp_path), CANDIDATES)
    law = found.scale_with_speed
    assert law.matters
    assert law.per_m_s.low < -0.05 < law.per_m_s.high
    assert law.per_m_s.high - law.per_m_s.low < 0.04
    assert law.at_slow.low < 0.95 - 0.05 * law.slow_m_s < law.at_slow.high
    assert law.verdict.startswith("the scale falls with speed: 0.")
    assert any(law.verdict in note for note in found.notes)


def test_a_scale_that_stays_is_said_to_stay(tmp_path):
    law = identify_flight(made(120.0).write(tmp_path), CANDIDATES).scale_with_speed
    assert not law.matters
    assert law.per_m_s.low < 0.0 < law.per_m_s.high
    assert law.verdict.startswith("no change of the scale with speed beyond 0.0")


# -- the command -------------------------------------------------------------------------------------------
def test_the_command_prints_the_law_and_what_the_reference_is(tmp_path):
    app = typer.Typer()
    app.command()(identify_command.command)
    folder = made(120.0, gain=lambda speed: 0.95 - 0.05 * speed).write(tmp_path / "flight")
    arguments = [str(folder), "--out", str(tmp_path / "sensor.toml")]
    shown = CliRunner().invoke(app, arguments).stdout
    assert "Flow sensor against truth.csv" in shown
    assert "Speed: the scale falls with speed" in shown
    facts = json.loads(CliRunner().invoke(app, [*arguments, "--json"]).stdout)
    law = facts["scale_with_speed"]
    assert law["matters"] is True
    assert law["per_m_s"]["low"] < -0.05 < law["per_m_s"]["high"]
    assert facts["details"]["range_jumping_share"] == 0.0
