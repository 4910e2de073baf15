"""`flownav identify` as a user meets it: JSON, a sensor file that flies, autopilot files, one-line errors."""

from __future__ import annotations

import json

import numpy as np
import pytest

from command import run
from flownav.core.parameter_files import shipped
from flownav.sensors.datasheet import load_sensor
from rig_logs import swing, write_csv

INTERVAL = {"value", "low", "high"}


def identified(log, cwd, *options):
    """The JSON of a run that must do."""
    done = run("identify", log, "--json", *options, cwd=cwd)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def refused(cwd, *arguments):
    """The only line of a refused command, besides the notice that kernels are compiled where none are yet."""
    done = run("identify", *arguments, cwd=cwd)
    assert done.returncode == 2, done.stderr
    assert done.stdout == ""
    lines = [line for line in done.stderr.strip().splitlines() if not line.startswith("flownav: compiling")]
    assert len(lines) == 1, done.stderr
    return lines[0]


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    """A simulated pendulum run, identified for PX4: the folder, its files and the facts."""
    folder = tmp_path_factory.mktemp("rig")
    done = run("rig", "--height", 0.6, "--duration", 8, "--out", folder / "log", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder, identified(folder / "log", folder, "--for", "px4", "--out", folder / "sensor.toml")


def test_the_json_has_every_key_and_intervals_hold_their_values(rig):
    _, facts = rig
    keys = {"axes", "gain", "latency_s", "order", "fit_percent", "excitation", "noise", "sensor"}
    assert keys <= set(facts)
    assert {"parameters", "identifiable", "verdict"} == set(facts["excitation"])
    for name in ("gain", "latency_s"):
        assert set(facts[name]) == INTERVAL
        assert facts[name]["low"] < facts[name]["value"] < facts[name]["high"]
    assert facts["axes"] == "sign is right (one axis)"
    assert (facts["excitation"]["parameters"], facts["excitation"]["identifiable"]) == (3, 2)
    assert "not identifiable" in facts["excitation"]["verdict"]
    assert 0.8 < facts["gain"]["value"] < 1.2
    assert 0.07 < facts["latency_s"]["value"] < 0.12  # 70 ms of chain, then exposure
    assert facts["noise"]["by_height"][0]["height_m"] == 0.6


def test_the_sensor_file_loads_and_flies(rig):
    folder, facts = rig
    assert facts["sensor"] == str(folder / "sensor.toml")
    assert load_sensor(folder / "sensor.toml").name
    text = shipped("landing.toml").read_text(encoding="utf-8")
    assert "duration_s = 50.0" in text
    (folder / "short.toml").write_text(text.replace("duration_s = 50.0", "duration_s = 7.0"), encoding="utf-8")
    done = run(
        "fly", "short.toml", "--sensor", "sensor.toml", "--json", "--no-report", "--out", "f.fnr", cwd=folder
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert np.isfinite(json.loads(done.stdout)["max_position_error_m"])


def test_px4_parameters_are_in_a_file_that_a_ground_station_loads(rig):
    folder, facts = rig
    assert facts["parameters"] == str(folder / "sensor.params")
    lines = (folder / "sensor.params").read_text(encoding="utf-8").splitlines()
    rows = [line.split("\t") for line in lines if not line.startswith("#")]
    assert all(len(row) == 5 and row[:2] == ["1", "1"] and row[4] in ("6", "9") for row in rows)
    values = {row[2]: float(row[3]) for row in rows}
    assert values == facts["autopilot"]
    assert {"EKF2_OF_CTRL", "EKF2_OF_DELAY", "EKF2_OF_N_MIN", "EKF2_OF_N_MAX", "SENS_FLOW_SCALE"} == set(values)
    assert values["EKF2_OF_DELAY"] == pytest.approx(1e3 * facts["latency_s"]["value"], rel=1e-3)
    assert 0.05 <= values["EKF2_OF_N_MIN"] <= values["EKF2_OF_N_MAX"]


def test_ardupilot_parameters_come_from_the_known_gain_and_delay(tmp_path):
    log = swing(tmp_path / "swing.csv")
    facts = identified(log, tmp_path, "--heights", 1.0, "--for", "ardupilot", "--out", tmp_path / "s.toml")
    assert facts["gain"]["low"] - 0.01 < 0.9 < facts["gain"]["high"] + 0.01
    assert facts["latency_s"]["value"] == pytest.approx(0.08, abs=0.005)
    lines = (tmp_path / "s.param").read_text(encoding="utf-8").splitlines()
    values = {name: float(value) for name, value in (line.split(",") for line in lines if line[0] != "#")}
    assert {"EK3_FLOW_DELAY", "EK3_FLOW_M_NSE", "EK3_FLOW_I_GATE"} <= set(values)
    assert values["EK3_FLOW_DELAY"] == pytest.approx(30.0, abs=5.0)  # EKF3 takes off 50 ms by itself
    assert values["FLOW_FYSCALER"] == pytest.approx(1e3 * (1.0 / 0.9 - 1.0), abs=15.0)
    assert values == facts["autopilot"]


def test_an_inverted_sensor_is_named(tmp_path):
    facts = identified(swing(tmp_path / "s.csv", gain=-0.9), tmp_path, "--heights", 1.0, "--order", "delay")
    assert facts["axes"] == "sign is inverted"
    assert facts["gain"]["value"] == pytest.approx(-0.9, abs=0.02)


def test_people_get_the_same_figures(tmp_path):
    done = run("identify", swing(tmp_path / "s.csv"), "--heights", "1.0", "--order", "delay", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "Axes: sign is right" in done.stdout
    assert "Excitation: the input excites" in done.stdout
    assert (tmp_path / "out" / "s.toml").exists()


def test_a_missing_folder_is_refused(tmp_path):
    assert "nowhere: no such file or folder" in refused(tmp_path, "nowhere")


def test_a_folder_that_is_no_log_is_refused(tmp_path):
    (tmp_path / "log").mkdir()
    assert "neither a rig log" in refused(tmp_path, "log")


@pytest.mark.parametrize("text", ["", "t_s,reference_velocity_m_s,flow_velocity_m_s\n"], ids=["nothing", "header"])
def test_an_empty_csv_is_refused(tmp_path, text):
    (tmp_path / "empty.csv").write_text(text, encoding="utf-8")
    assert "empty.csv" in refused(tmp_path, "empty.csv", "--heights", "1.0")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("still", ["reference", "sensor"])
def test_constant_data_are_refused(tmp_path, still):
    t_s = np.arange(0.0, 10.0, 0.01)
    moving, constant = np.sin(3.0 * t_s), np.full(len(t_s), 0.1)
    columns = (constant, moving) if still == "reference" else (moving, constant)
    line = refused(tmp_path, write_csv(tmp_path / "still.csv", t_s, *columns), "--heights", "1.0")
    assert "still.csv" in line
    assert f"the {still}'s velocity is constant" in line


@pytest.mark.parametrize("rows", [30, 80])
def test_too_short_data_are_refused(tmp_path, rows):
    line = refused(tmp_path, swing(tmp_path / "brief.csv", duration_s=rows / 100.0), "--heights", "1.0")
    assert "brief.csv" in line
    assert "at least 50" in line


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (("--order", "9"), "--order"),
        (("--for", "betaflight"), "choose from px4, ardupilot"),
        (("--heights", "high"), "--heights"),
        (("--out", "sensor.txt"), ".toml"),
    ],
)
def test_wrong_options_are_refused(tmp_path, options, word):
    assert word in refused(tmp_path, swing(tmp_path / "s.csv"), *options)


def test_an_outdoor_flights_axes_are_right_and_its_gains_near_one(data_folder, tmp_path):
    facts = identified(data_folder / "quad-px4flow-outdoor", tmp_path)
    assert facts["kind"] == "flight"
    assert facts["axes"] == "axes and signs are right"
    gains = {response["axis"]: response["gain"]["value"] for response in facts["responses"]}
    assert set(gains) == {"x", "y"}
    assert all(0.85 < value < 1.15 for value in gains.values()), gains
    load_sensor(tmp_path / facts["sensor"])


def test_a_motion_capture_flight_gives_a_positive_latency(data_folder, tmp_path):
    facts = identified(data_folder / "quad-px4flow-mocap", tmp_path)
    assert facts["reference"] == "truth.csv"
    assert facts["latency_s"]["low"] > 0.0
