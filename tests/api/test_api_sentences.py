"""The sentences of the API that others rely on, word by word, and that the command line says the same."""

from __future__ import annotations

import json

import numpy as np
import pandas
import pytest
from typer.testing import CliRunner

import flownav
from flownav.cli import app
from flownav.core.errors import InputError
from replay_logs import log_of_flight
from rig_logs import swing


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return log_of_flight(40.0).write(tmp_path_factory.mktemp("log") / "garden")


@pytest.fixture(scope="module")
def record():
    record = flownav.fly("landing", seed=1)
    return record


@pytest.fixture(scope="module")
def replayed(path):
    record = flownav.replay(path, gps_outages=[(20, 26)])
    return record


def test_a_record_of_a_landing(record):
    assert isinstance(record, flownav.Record)
    assert record.estimate["pos_n_m"].dtype == np.float64
    assert isinstance(record.estimate["pos_n_m"], np.ndarray)
    assert record["estimate"]["pos_n_m"] is record.estimate["pos_n_m"]
    frame = record.estimate.to_pandas()
    assert isinstance(frame, pandas.DataFrame)
    assert frame.index.name == "t_s"
    assert np.array_equal(frame["pos_n_m"].to_numpy(), record.estimate["pos_n_m"])
    assert record.scores["touchdown"]["success"] is True


def test_a_record_of_a_log(replayed):
    assert [(cut["t0"], cut["t1"]) for cut in replayed.scores["outages"]] == [(20.0, 26.0)]
    assert replayed.scores["outages"][0]["horizontal_rms_m"] < 0.1
    assert replayed.verdict == ""


def test_a_sensor_of_a_rig(tmp_path):
    path = swing(tmp_path / "swing.csv", gain=0.9, delay_s=0.08)
    with pytest.raises(InputError, match="its height is unknown"):
        flownav.identify([path])
    sensor = flownav.identify([path], heights_m=0.6)
    assert sensor.gain.low <= sensor.gain.value <= sensor.gain.high
    assert sensor.gain.value == pytest.approx(0.9, abs=0.03)
    assert sensor.latency_s.value == pytest.approx(0.08, abs=0.01)
    assert sensor.facts["gain"]["value"] == pytest.approx(sensor.gain.value, rel=1e-6)
    assert f"latency {1e3 * sensor.latency_s.value:.0f} ms [" in repr(sensor)
    unseen = sensor.changed(identification={"identifiable": 1})  # as of a log whose motion shows the gain alone
    assert repr(unseen).endswith("latency not shown by its log>")
    kept = flownav.Sensor.load(sensor.save(tmp_path / "sensor.toml"))
    assert (kept.gain, kept.latency_s, kept.file) == (sensor.gain, sensor.latency_s, sensor.file)
    assert set(sensor.save_parameters(tmp_path / "sensor.param", "ardupilot")) >= {"EK3_FLOW_DELAY"}
    flown = flownav.fly("landing", flight={"duration_s": 6.0}, flow_sensor=sensor)
    assert flown.manifest["parameters"]["flow_sensor"]["name"] == sensor.name


def test_a_report_and_a_file(record, tmp_path):
    assert record.report(tmp_path / "landing.html").read_text(encoding="utf-8").startswith("<!")
    path = record.save(tmp_path / "landing.fnr")
    again = flownav.load(path)
    assert again.manifest == json.loads(json.dumps(record.manifest, default=str)) | {"schema": 1}
    assert list(again) == list(record)
    assert all(np.array_equal(again[t][c], record[t][c], equal_nan=record[t][c].dtype.kind == "f")
               for t in record for c in record[t])  # fmt: skip


def test_another_estimate(record):
    frame = record.flown.to_pandas()
    assert record.rescore(estimate=frame).scores == record.scores


def test_the_command_line_prints_the_scores_of_the_record(record, tmp_path):
    said = CliRunner().invoke(
        app, ["fly", "landing", "--seed", "1", "--json", "--no-report", "--out", str(tmp_path / "a.fnr")]
    )
    facts = json.loads(said.stdout)
    assert {name: facts[name] for name in record.scores} == record.scores
    assert facts["scenario"] == record.manifest["scenario"]


def test_the_command_line_prints_the_scores_of_a_replay(replayed, path, tmp_path):
    out = str(tmp_path / "a.fnr")
    said = CliRunner().invoke(
        app, ["replay", str(path), "--gps-outage", "20:26", "--json", "--no-report", "--out", out]
    )
    facts = json.loads(said.stdout)
    assert (facts.pop("record"), facts.pop("schema")) == (out, 1)
    assert facts == replayed.scores


def test_the_command_line_prints_the_figures_of_a_campaign(tmp_path):
    asked = ["landing", "--flights", "16", "--set", "flight.duration_s=8", "--records", "0", "--json"]
    said = CliRunner().invoke(app, ["campaign", *asked, "--out", str(tmp_path / "c")])
    facts = json.loads(said.stdout)
    found = flownav.campaign("landing", flights=16, flight={"duration_s": 8.0})
    assert {name: facts[name] for name in found.summary} == found.summary
    frame = found.to_pandas()
    assert len(frame) == 16
    worst = found.worst[0]
    again = found.record(worst["flight"], cell=worst["cell"])
    row = frame.iloc[worst["flight"]]
    assert again.scores["max_position_error_m"] == pytest.approx(row["max_position_error_m"], rel=1e-12)


def test_a_record_says_how_it_was_called(record, replayed):
    assert record.manifest["command"] == "flownav.fly('landing', seed=1, flight=0)"
    assert str(replayed.manifest["command"]).startswith("flownav.replay(")
    assert "gps_outages=[(20, 26)]" in replayed.manifest["command"]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: flownav.fly("nowhere"), "nowhere: no such scenario"),
        (lambda: flownav.fly("landing", wnd={"speed_20ft_m_s": 3.0}), "wnd: unknown key; known here: "),
        (lambda: flownav.fly("landing", wind={"speed": 3.0}), "wind.speed: unknown key"),
        (lambda: flownav.fly("landing", gps="rtk"), "gps.model: Input should be 'white' or 'midg'"),
        (lambda: flownav.fly("landing", seed=-1), "seed = -1: must be a whole number from 0"),
        (lambda: flownav.fly("landing", flight=-3), "flight = -3: must be"),
        (lambda: flownav.fly("landing", vehicle="no.toml"), "no.toml: no such file"),
        (lambda: flownav.replay("no.ulg"), "no.ulg: no such log"),
        (lambda: flownav.identify([]), "no log given"),
        (lambda: flownav.identify(["no.csv"]), "no.csv: no such file or folder"),
        (lambda: flownav.campaign("landing", flights=0), "flights = 0: must be"),
        (lambda: flownav.campaign("landing", sampling="grid"), "sampling grid: must be"),
        (lambda: flownav.campaign("landing", engine="tpu"), "engine tpu: must be"),
        (lambda: flownav.load("no.fnr"), "no.fnr: no such record"),
        (lambda: flownav.Vehicle.load("no.toml"), "no.toml: no such file"),
        (lambda: flownav.Sensor.load("no.toml"), "no.toml: no such file"),
    ],
)
def test_a_mistake_is_one_line(call, message):
    with pytest.raises(flownav.InputError) as caught:
        call()
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_window_that_is_none_is_one_line(path):
    with pytest.raises(InputError, match=r"gps_outages: 5: a window \(t0, t1\)"):
        flownav.replay(path, gps_outages=[5])
    with pytest.raises(InputError, match="settings: gps_gate: unknown key"):
        flownav.replay(path, settings={"gps_gate": 3.0})


def test_a_replays_call_can_be_called_again(path):
    record = flownav.replay(path, flow=False, flow_scale=(1.2, 1.2), gps_delay_s=0.1)
    assert record.manifest["command"].endswith("flow=False, flow_scale=(1.2, 1.2), gps_delay_s=0.1)")


def test_a_filter_of_a_class_is_called_by_its_name_in_the_call():
    from flownav.parts.examples.complementary import ComplementaryFilter

    class Mine(ComplementaryFilter):
        name = ""

    record = flownav.fly("landing", filter=Mine, flight={"duration_s": 6.0})
    assert "filter='Mine'" in record.manifest["command"]
    assert "filter Mine" in repr(record)


def test_an_estimate_of_a_part_of_the_flight_is_said_to_be_one():
    record = flownav.fly("landing", flight={"duration_s": 8.0})
    frame = record.flown.to_pandas()
    part = record.rescore(estimate=frame[frame.index < 6.5])
    assert 0.3 < part.manifest["covered_fraction"] < 0.6
    assert "covers" in part.verdict
    assert "covers" in repr(part)
    with pytest.raises(flownav.InputError, match="no finite position"):
        record.rescore(estimate=frame * float("nan"))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: flownav.fly("landing", seed=1.9), "seed: 1.9 is given; a whole number is needed"),
        (lambda: flownav.campaign("landing", flights=2.5), "flights: 2.5 is given; a whole number is needed"),
        (lambda: flownav.campaign("landing", sweep={"wind.speed_20ft_m_s": []}), "sweep wind.speed_20ft_m_s: a list"),
        (lambda: flownav.campaign("landing", sweep={"wind.speed_20ft_m_s": 3.0}), "sweep wind.speed_20ft_m_s: a list"),
        (lambda: flownav.fly("landing", sensors=object), "sensors: type is given; a list is needed"),
        (lambda: flownav.replay(3), "log: 3 is given; a path is needed"),
        (lambda: flownav.identify(None), "logs: None is given; a path or a list is needed"),
        (lambda: flownav.replay("x.ulg", filter="paper"), "the paper's filter flies in simulation only"),
    ],
)
def test_what_is_no_argument_is_told_in_one_line(call, message):
    with pytest.raises(flownav.InputError, match=message) as caught:
        call()
    assert "\n" not in str(caught.value)
