"""`flownav sample`: what it writes is read by every command that it names, and is of one and the same flight."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from flownav.cli import app
from flownav.core.errors import InputError
from flownav.core.record import Record
from flownav.export.samples.kinds import KINDS, README, SAMPLES, sample_of, write_samples
from flownav.lab.identification.descent import Structure
from flownav.lab.identification.flight_identification import identify_flight
from flownav.logs.open_log import open_flight
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import Replay, replay
from flownav.studies.inspection import summarise

FLIGHTS = {"csv": "flight-csv", "ulog": "flight.ulg", "tlog": "flight.tlog", "dataflash": "flight.bin"}
MOST_BYTES = 5_000_000
GAIN, LATENCY_S = 0.88, 0.064  # of the flow sensor: data/samples/flow_sensor.toml, and the camera's latency
ALIKE_M, ALIKE_M_S = 0.05, 0.03


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    found = tmp_path_factory.mktemp("made") / "samples"
    write_samples(SAMPLES, found, 1)
    return found


@pytest.fixture(scope="module")
def replays(folder) -> dict[str, Replay]:
    def one(name: str) -> Replay:
        return replay(open_flight(folder / name), ReplayOptions(), NavigatorSettingsFile())

    return {kind: one(name) for kind, name in FLIGHTS.items()}


def test_a_seed_gives_the_same_bytes_and_nothing_is_large(folder, tmp_path):
    again = write_samples(SAMPLES, tmp_path / "again", 1)
    assert [each.state for each in again] == ["written"] * len(SAMPLES)
    files = [path.relative_to(folder) for path in folder.rglob("*") if path.is_file()]
    assert len(files) > 15
    for file in files:
        assert (folder / file).read_bytes() == (tmp_path / "again" / file).read_bytes(), file
    assert all(100_000 < each.size_bytes < MOST_BYTES for each in again)


def test_the_readme_names_every_file_and_commands_that_exist(folder):
    text = (folder / README).read_text()
    assert max(map(len, text.splitlines())) <= 80
    for sample in SAMPLES:
        assert (folder / sample.name).exists()
        for command in sample.commands:
            assert command.format(path=sample.name) in text


def test_every_format_replays_to_the_same_flight(replays):
    of_csv = replays["csv"]
    for kind, other in replays.items():
        assert _rms(other, "horizontal_rms_m") == pytest.approx(_rms(of_csv, "horizontal_rms_m"), abs=ALIKE_M), kind
        assert _rms(other, "velocity_rms_m_s") == pytest.approx(_rms(of_csv, "velocity_rms_m_s"), abs=ALIKE_M_S), kind
        apart = _path(other) - _path(of_csv)
        assert np.abs(apart - apart.mean(axis=0)).max() < 0.25, kind  # origins are where the first fix is, to 1 cm
        assert np.sqrt(np.mean((apart - apart.mean(axis=0)) ** 2)) < ALIKE_M, kind
    assert 0.1 < _rms(of_csv, "horizontal_rms_m") < 2.0  # GPS of 2 m CEP


def _rms(flown: Replay, name: str) -> float:
    scores = flown.scores()["truth"]
    assert scores is not None
    return float(scores[name])


def _path(flown: Replay) -> np.ndarray:
    """Positions at seconds 10 to 90 of the flight (n, 3)."""
    start_s = 20.0 if flown.log.path.suffix == ".tlog" else 0.0  # the vehicle's time since boot
    rows = flown.estimate
    return np.column_stack([np.interp(np.arange(10.0, 90.0) + start_s, rows[:, 0], rows[:, k]) for k in (1, 2, 3)])


@pytest.mark.parametrize("kind", FLIGHTS)
def test_info_finds_every_sensor_and_nothing_wrong(folder, kind):
    facts = summarise(open_flight(folder / FLIGHTS[kind]))
    found = {stream["sensor"] for stream in facts["streams"]}
    assert {"imu", "gps_position", "gps_velocity", "flow_rate", "range", "baro", "mag", "attitude", "landed"} <= found
    assert facts["warnings"] == []
    assert facts["truth"]["count"] > 1000


def test_the_estimate_in_the_ulog_is_not_called_px4s(folder):
    assert open_flight(folder / "flight.ulg").autopilot_name == "flownav simulator"


@pytest.mark.parametrize("kind", ["csv", "ulog", "dataflash"])
def test_identify_finds_the_simulated_flow_sensor(folder, kind):
    findings = identify_flight(folder / FLIGHTS[kind], [Structure(0)])
    assert len(findings.responses) == 2
    for response in findings.responses:
        reach = 0.5 * (response.gain.high - response.gain.low)
        assert abs(response.gain.value - GAIN) < 1.5 * reach  # of one flight; the interval holds 95 % of many
        assert response.gain.high - response.gain.low < 0.1
        assert response.latency_s.low < LATENCY_S < response.latency_s.high
        assert response.latency_s.high - response.latency_s.low < 0.05
    assert findings.axes.right


def test_the_record_is_a_flight_that_landed(folder):
    record = Record.load(folder / "pad_return.fnr")
    assert record.manifest["scores"]["touchdown"]["verdict"] == "landed"
    assert "written_utc" not in record.manifest["provenance"]


# -- what is there already ---------------------------------------------------------------------------------------
def test_what_is_there_is_kept_numbered_or_replaced_by_force(tmp_path):
    ulog = [sample_of("ulog")]
    first = write_samples(ulog, tmp_path, 1)[0]
    content = first.path.read_bytes()
    assert write_samples(ulog, tmp_path, 1)[0].state == "unchanged"
    other = write_samples(ulog, tmp_path, 2)[0]
    assert (other.path.name, other.instead_of) == ("flight-1.ulg", first.path)
    assert first.path.read_bytes() == content
    assert write_samples(ulog, tmp_path, 2, force=True)[0].state == "replaced"
    assert first.path.read_bytes() == other.path.read_bytes() != content
    (tmp_path / README).write_text("mine\n")
    with pytest.raises(InputError, match="not written by flownav"):
        write_samples(ulog, tmp_path, 1, force=True)
    assert (tmp_path / README).read_text() == "mine\n"
    assert not list(tmp_path.glob(".sample*"))


def test_the_command_writes_lists_and_refuses(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run = CliRunner()
    listed = run.invoke(app, ["sample", "--list"]).output
    assert all(sample.name in listed for sample in SAMPLES)
    assert not list(tmp_path.iterdir())
    said = run.invoke(app, ["sample", "dataflash"]).output
    assert "samples/flight.bin" in said
    assert "flownav identify samples/flight.bin --for ardupilot" in said
    assert max(map(len, said.splitlines())) <= 80
    facts = json.loads(run.invoke(app, ["sample", "dataflash", "--json"]).stdout)
    assert facts["samples"][0]["state"] == "unchanged"
    refused = run.invoke(app, ["sample", "flac"])
    assert isinstance(refused.exception, InputError)
    assert all(re.search(rf"\b{kind}\b", str(refused.exception)) for kind in KINDS)
