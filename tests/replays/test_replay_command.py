"""`flownav replay` as a user meets it: JSON, tables, options, one-line errors, whole files."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from command import printed
from flownav.cli.replay import command, error_lines
from flownav.core.errors import InputError
from flownav.core.record import POSITION_NED, QUATERNION, Record
from flownav.scoring.headline import WITH_GPS
from replay_logs import log_of_flight, write_table


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return log_of_flight(40.0).write(tmp_path_factory.mktemp("log") / "garden")


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def call(*arguments):
    app = typer.Typer()
    app.command()(command)
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def answer(*arguments):
    result = call(*arguments, "--no-report", "--json")
    assert result.exception is None, result.exception
    return json.loads(result.stdout)


def complaint(*arguments) -> str:
    result = call(*arguments, "--no-report")
    assert isinstance(result.exception, InputError), result.exception
    assert result.stdout == ""
    assert not list(Path.cwd().rglob("*.fnr"))
    text = printed(result.exception)
    assert "\n" not in text
    return text


def test_json_holds_the_promised_keys_and_nothing_else_is_printed(folder):
    facts = answer(folder, "--gps-outage", "15:25", "--gps-outage", "30:38")
    assert set(facts) == {"duration_s", "outages", "velocity_rms_m_s", "end_drift_m", "consistency", "coverage",
                          "rejected", "readings", "warnings", "record", "protection", "schema"}  # fmt: skip
    assert facts["warnings"] == []
    assert facts["duration_s"] == pytest.approx(39.98)
    assert [(o["t0"], o["t1"]) for o in facts["outages"]] == [(15.0, 25.0), (30.0, 38.0)]
    assert all(0 <= o["horizontal_rms_m"] <= o["horizontal_max_m"] < 0.02 for o in facts["outages"])
    assert facts["velocity_rms_m_s"] < 0.01
    assert facts["rejected"]["gps_position"]["outage"] == 3 * (50 + 40)
    cut = facts["readings"]["gps_position"]
    assert cut["rejected"]["outage"] == 50 + 40
    assert cut["fused"] + cut["in_part"] <= cut["offered"] - 90
    assert facts["record"] == "out/garden.fnr"
    assert Record.load(Path(facts["record"])).manifest["command"][0] == "flownav"


def test_every_sensor_says_when_it_spoke_and_whether_the_filter_knew_it(folder):
    facts = answer(folder)
    assert set(facts["coverage"]) == {"attitude", "imu", "gps_velocity", "gps_position", "flow_rate", "range", "baro",
                                      "mag"}  # fmt: skip
    assert facts["coverage"]["gps_position"] == pytest.approx({"t0": 0.0, "t1": 39.8})
    assert set(facts["consistency"]) <= set(facts["coverage"]) - {"imu"}
    for judged in facts["consistency"].values():
        assert set(judged) == {"nis_per_dof", "samples", "white", "refused"}
        assert judged["nis_per_dof"] > 0.0
        assert judged["samples"] > 0
        assert judged["white"] in (True, False)
    assert facts["end_drift_m"] is None


def test_protection_levels_are_told_with_the_share_of_errors_beyond_them(folder, hall):
    for log, unsaid in ((folder, None), (hall, 0.0)):  # without and with a truth
        found = answer(log)["protection"]
        assert set(found) == {"horizontal_m", "vertical_m", "flagged_fraction", "exceeded_unsaid_fraction"}
        for level in (found["horizontal_m"], found["vertical_m"]):
            assert set(level) == {"median", "p95"}
            assert 0.0 < level["median"] <= level["p95"] < 50.0
        assert 0.0 <= found["flagged_fraction"] <= 1.0
        assert found["exceeded_unsaid_fraction"] == unsaid
        words = " ".join(call(log, "--no-report").stdout.split())
        level = found["horizontal_m"]
        assert f"Protection level, horizontal: {level['median']:.2f} m in the median, {level['p95']:.2f} m at" in words
        assert ("The error stayed within it, or a warning stood" in words) == (unsaid is not None)


def test_an_error_beyond_the_level_that_nothing_says_is_counted(hall):
    """From 20 s of 40 s on the truth moves away by 10 m/s, up to 100 m: no leap, which would be a reference's error."""
    lines = (hall / "truth.csv").read_text().splitlines()
    rows = [line.split(",") for line in lines[1:]]
    moved = [[t, str(float(x) + min(max(10.0 * (float(t) - 20.0), 0.0), 100.0)), y, z] for t, x, y, z in rows]
    (hall / "truth.csv").write_text("\n".join([lines[0], *map(",".join, moved)]) + "\n")
    found = answer(hall)["protection"]
    assert found["exceeded_unsaid_fraction"] > 0.3
    assert found["flagged_fraction"] < 0.2


@pytest.fixture
def hall(tmp_path) -> Path:
    """The flight without GPS, with a truth of its own making: the replay's own path, turned by a radian and moved."""
    flown = log_of_flight(40.0)
    del flown.tables["gps"]
    folder = flown.write(tmp_path / "hall")
    answer(folder)
    record = Record.load(Path("out/hall.fnr"))
    t_s = record.tables["estimate"]["t_s"]
    north, east, down = record.matrix("estimate", POSITION_NED).T
    c, s = np.cos(1.0), np.sin(1.0)
    columns = {"t_s": t_s, "x_m": c * north - s * east + 3.0, "y_m": s * north + c * east - 4.0, "z_m": down}
    write_table(folder / "truth.csv", columns)
    return folder


def test_a_truth_tells_where_the_flight_ended(hall):
    assert answer(hall)["end_drift_m"] == pytest.approx(0.0, abs=1e-6)  # turned onto it by least squares
    record = Record.load(Path("out/hall.fnr"))
    w, x, y, z = record.matrix("estimate", QUATERNION).T
    yaw = np.unwrap(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
    heading = {"t_s": record.tables["estimate"]["t_s"], "yaw_rad": yaw + 1.0}
    write_table(hall / "heading_truth.csv", heading)
    assert answer(hall)["end_drift_m"] == pytest.approx(0.0, abs=1e-6)
    write_table(hall / "heading_truth.csv", heading | {"yaw_rad": yaw + 1.2})
    position = record.matrix("estimate", POSITION_NED)
    away = np.flatnonzero(abs(position[:, 2] - position[0, 2]) > 0.05)
    way = np.hypot(*(position[away[-1]] - position[away[0]])[:2])
    assert answer(hall)["end_drift_m"] == pytest.approx(2.0 * np.sin(0.1) * way, rel=1e-3)
    told = call(hall, "--no-report")
    assert "At the end of the flight" in told.stdout


def test_a_sensor_that_falls_silent_is_a_warning_in_all_that_is_said(hall):
    lines = (hall / "range.csv").read_text().splitlines()
    (hall / "range.csv").write_text("\n".join(lines[:501]) + "\n")
    said = "range ends at 24.9 s of 40.0 s"
    assert answer(hall, "--force")["warnings"] == [said]
    assert said in Record.load(Path("out/hall.fnr")).tables["events"]["detail"].tolist()
    told = call(hall, "--force")
    assert told.exception is None  # a warning is no bad verdict
    assert f"Warning: {said}" in told.stdout
    assert "Rangefinder" in told.stdout
    assert "refused [%]" not in told.stdout
    figures = call(hall, "--force", "--verbose").stdout
    for head in ("refused", "[%]", "NIS"):  # a head is broken between its words where 80 columns do not hold it
        assert head in figures
        assert head not in told.stdout
    page = Path("out/hall.html").read_text()
    assert said in page
    assert "0.0 to 24.9" in page


def test_the_outage_table_adds_its_median_and_worst(folder):
    facts = answer(folder, "--outage-table", "15:35:10")
    assert [(o["t0"], o["t1"]) for o in facts["outages"]] == [(15.0, 25.0), (25.0, 35.0)]
    rms = [o["horizontal_rms_m"] for o in facts["outages"]]
    assert facts["outage_median_rms_m"] == pytest.approx(sum(rms) / 2)
    assert facts["outage_worst_rms_m"] == max(rms)
    assert "outage" not in facts["rejected"]["gps_position"]


def test_options_reach_the_filter(folder):
    cut = ("--gps-outage", "15:38")
    good = answer(folder, *cut)["outages"][0]["horizontal_rms_m"]
    assert answer(folder, *cut, "--flow-scale", "1.2,1.2")["outages"][0]["horizontal_rms_m"] > 10 * good
    assert answer(folder, *cut, "--no-flow")["rejected"]["flow_rate"]["outage"] > 1000
    assert answer(folder, "--gps-delay", "0.6")["velocity_rms_m_s"] > 0.1


def test_settings_come_from_a_file(folder, tmp_path):
    (tmp_path / "strict.toml").write_text("gate_sigma = 0.001\n")
    rejected = answer(folder, "--settings", tmp_path / "strict.toml")["rejected"]
    assert sum(counts.get("innovation_gate", 0) for counts in rejected.values()) > 50


def test_people_get_tables_and_files(folder):
    result = call(folder, "--gps-outage", "15:25", "--out", "here/garden.fnr")
    assert result.exception is None
    assert "15 to 25" in result.stdout
    assert "Horizontal velocity against GPS" in result.stdout
    assert Path("here/garden.fnr").is_file()
    assert "</html>" in Path("here/garden.html").read_text()


@pytest.mark.parametrize(("arguments", "said"), [
    (("--gps-outage", "15"), "--gps-outage 15: T0:T1 is needed"),
    (("--gps-outage", "a:b"), "--gps-outage a:b"),
    (("--gps-outage", "nan:20"), "--gps-outage nan:20"),
    (("--gps-outage", "30:20"), "the end must come after the start"),
    (("--gps-outage", "500:600"), "outside the log"),
    (("--flow-scale", "1"), "--flow-scale 1: X,Y is needed"),
    (("--flow-scale", "0,1"), "--flow-scale 0,1"),
    (("--flow-scale", "-1,1"), "--flow-scale -1,1: factors from 0.1 to 10"),
    (("--flow-scale", "1,100"), "--flow-scale 1,100"),
    (("--gps-delay", "-3"), "--gps-delay -3"),
    (("--gps-delay", "inf"), "--gps-delay inf"),
    (("--outage-table", "0:10"), "T0:T1:LENGTH"),
    (("--outage-table", "0:10:50"), "0 windows"),
    (("--outage-table", "100:400:60"), "--outage-table: 100 to 160 s is outside the log"),
    (("--settings", "absent.toml"), "absent.toml: no such file"),
    (("--out", "there.html", "--report"), "name it .fnr"),
])  # fmt: skip
def test_a_wrong_option_is_one_line_and_leaves_no_file(folder, arguments, said):
    result = call(folder, *arguments)
    assert isinstance(result.exception, InputError), result.exception
    assert said in printed(result.exception)
    assert "\n" not in str(result.exception)
    assert list(Path.cwd().iterdir()) == []


def test_a_folder_that_is_not_there(tmp_path):
    assert "no such log; give a folder of CSV files" in complaint(tmp_path / "absent")


def test_a_record_that_cannot_be_written(folder, tmp_path):
    (tmp_path / "taken").write_text("")
    assert "cannot be written" in complaint(folder, "--out", tmp_path / "taken" / "garden.fnr")


def test_a_folder_without_attitude_is_replayed_by_its_imu(tmp_path):
    logged = log_of_flight(40.0)
    del logged.tables["attitude"]
    facts = answer(logged.write(tmp_path / "bare"), "--gps-outage", "20:38")
    assert facts["outages"][0]["horizontal_rms_m"] < 0.1
    assert facts["velocity_rms_m_s"] < 0.05
    assert facts["warnings"] == []


@pytest.mark.parametrize(("sensors", "explained"), [(("flow_rate", "gps_position"), 1), (("flow_rate",), 0)])
def test_errors_against_a_truth_are_explained_where_gps_shares_them(sensors, explained):
    truth = {"reference": "the simulator", "yaw_rad": None, "horizontal_rms_m": 0.7, "horizontal_max_m": 1.3,
             "velocity_rms_m_s": 0.1}  # fmt: skip
    scores = {"velocity_rms_m_s": None, "end_drift_m": 1.6, "protection": None, "coverage": dict.fromkeys(sensors)}
    assert error_lines(scores | {"truth": truth}).count(f"{WITH_GPS} (--gps-outage)") == explained
    assert WITH_GPS not in " ".join(error_lines(scores | {"end_drift_m": None}))
