"""`flownav validate`: rows, verdicts, the page, the command."""

from __future__ import annotations

import json

import pytest
from helpers.replay_logs import log_of_flight
from typer.testing import CliRunner

from flownav.cli import app
from flownav.core.errors import InputError
from flownav.core.measurement import Sensor
from flownav.logs.csv_folder import read_csv_folder
from flownav.logs.log import Log
from flownav.studies.validation.drawn import load_flights
from flownav.studies.validation.job import Row, row_of, validate_log
from flownav.studies.validation.page import MEANINGS, page, widened

HEAD = 'schema_version = 1\nname = "made"\nprovenance = "made for a test"\n'
VEHICLE = load_flights().vehicle


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    where = tmp_path_factory.mktemp("validate")
    log_of_flight(60.0, flow_hz=10.0).write(where / "made")
    numbers = "\n".join(f"{name} = {value}" for name, value in VEHICLE.model_dump().items())
    flight = '[[flight]]\nlog = "made"\nwindows_s = [[20.0, 50.0, 15.0]]\n'
    (where / "made.toml").write_text(f"{HEAD}{flight}[vehicle]\n{numbers}\n", encoding="utf-8")
    return where


@pytest.fixture(scope="module")
def rows(folder):
    return validate_log("made", read_csv_folder(folder / "made"), [(20.0, 35.0), (35.0, 50.0)], VEHICLE, 1, 2)


def test_a_log_without_error_is_kinder_than_any_simulated_flight(rows):
    by_figure = {row.figure: row for row in rows}
    drift = by_figure["outage_median_m"]
    assert 0.0 < drift.flown < drift.low <= drift.simulated <= drift.high
    assert drift.verdict == "too hard"
    without = by_figure["outage_median_no_flow_m"]
    assert without.low > drift.low
    assert by_figure["flow_gain"].flown == pytest.approx(1.0, abs=0.02)
    assert by_figure["range_outlier_share"].flown == 0.0
    assert by_figure["flow_noise_rad_s"].flown < by_figure["flow_noise_rad_s"].low
    for sensor in ("gps_position", "flow_rate", "range", "baro", "mag", "attitude"):
        assert {f"{sensor}_nis_per_dof", f"{sensor}_white", f"{sensor}_lag_one", f"{sensor}_slow_share"} <= set(
            by_figure
        )


@pytest.mark.parametrize(
    ("figure", "flown", "low", "high", "verdict"),
    [
        ("outage_median_m", 1.0, 0.9, 1.1, "as flown"),
        ("outage_median_m", 1.3, 0.9, 1.1, "as flown"),  # a quarter beyond counts as theirs
        ("outage_median_m", 1.5, 0.9, 1.1, "too kind"),
        ("outage_median_m", 0.5, 0.9, 1.1, "too hard"),
        ("range_white", 0.0, 1.0, 1.0, "too kind"),
        ("range_white", 1.0, 0.0, 0.0, "too hard"),
        ("range_lag_one", 0.6, -0.2, -0.1, "too kind"),
        ("range_lag_one", -0.05, -0.4, -0.3, "too hard"),
        ("range_lag_one", 0.1, -0.3, 0.2, "as flown"),
        ("flow_gain", 1.5, 0.9, 1.1, "other than flown"),
        ("flow_blind_share", 0.0, 0.01, 0.02, "as flown"),  # a hundredth more is no other sensor
    ],
)
def test_the_verdict_says_which_is_worse(figure, flown, low, high, verdict):
    assert Row("log", figure, flown, low, low, high).verdict == verdict


def test_a_row_is_the_median_and_the_ends_of_what_is_known():
    assert row_of("log", "f", 2.0, [3.0, float("nan"), 1.0, 2.0]) == Row("log", "f", 2.0, 2.0, 1.0, 3.0)
    nothing = row_of("log", "f", float("nan"), [float("nan")])
    assert nothing == Row("log", "f", None, None, None, None)
    assert nothing.verdict == "unknown"


def test_a_log_that_cannot_serve_is_refused_in_one_line(folder):
    log = read_csv_folder(folder / "made")
    bare = Log(log.path, {Sensor.GPS_POSITION: log.streams[Sensor.GPS_POSITION]}, log.origin_deg_m)
    with pytest.raises(InputError, match="has no flow_rate and no imu; a log to validate on needs GPS, flow and IMU"):
        validate_log("made", bare, [(20.0, 35.0)], VEHICLE, 1, 1)


def test_the_page_has_every_row_and_every_widened_number(rows):
    text = page(rows, 1, 2, 1.5)
    for row in rows:
        assert f"| `{row.figure}` |" in text
    assert len(widened()) >= 4
    for name, _, source in widened():
        assert f"| `{name}` |" in text
        assert "flownav validate" in source
    assert "## Where it is too hard" in text
    lost = [Row("made", "outage_worst_m", 1.0, 3.0, 1.0, 30.0)]
    assert "up to 30 m in the simulated flights, 1 m flown" in page(lost, 1, 2, 1.5)
    assert "## Simulated flights that went astray" not in text


def test_every_figure_has_a_meaning(rows):
    import fnmatch

    patterns = [part for name, _ in MEANINGS for part in name.split(", ")]
    for row in rows:
        assert any(fnmatch.fnmatch(row.figure, pattern) for pattern in patterns), row.figure


def test_the_command_prints_one_object_and_writes_the_page(folder, tmp_path):
    out = tmp_path / "validation.md"
    options = [
        "--data",
        str(folder),
        "--file",
        str(folder / "made.toml"),
        "--flights",
        "1",
        "--json",
        "--out",
        str(out),
    ]
    done = CliRunner().invoke(app, ["validate", *options])
    assert done.exit_code == 0, done.output
    facts = json.loads(done.stdout)
    assert {tuple(row) for row in facts["rows"]} == {("log", "figure", "flown", "simulated", "low", "high")}
    assert {row["log"] for row in facts["rows"]} == {"made"}
    assert out.read_text(encoding="utf-8").splitlines()[1].startswith("# Validated against flights")


def test_a_missing_folder_is_an_error_of_one_line(tmp_path):
    done = CliRunner().invoke(app, ["validate", "--data", str(tmp_path / "none")])
    assert isinstance(done.exception, InputError)
    assert "give the folder of logs by --data or FLOWNAV_DATA" in str(done.exception)


def test_the_outdoor_flight_is_flown_again(data_folder):
    recorded = load_flights().flight[2]
    log = read_csv_folder(data_folder / recorded.log)
    rows = validate_log(recorded.log, log, recorded.windows()[-1:], VEHICLE, 1, 1)
    found = {row.figure: row for row in rows}
    assert len(found) >= 40
    assert 0.1 < found["outage_median_m"].simulated < 30.0
    assert found["outage_median_no_flow_m"].simulated > found["outage_median_m"].simulated
    assert found["range_beyond_reach_hz"].verdict == "too kind"  # a sonar that jumps where it hears nothing
