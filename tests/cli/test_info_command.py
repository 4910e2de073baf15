"""`flownav info`, and replay and identify of ULog files, as a user meets them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from command import printed
from flownav.cli import identify
from flownav.cli import replay as replay_command
from flownav.core.errors import InputError
from flownav.core.frames import quaternion_from_euler
from flownav.core.measurement import Sensor
from flownav.lab.identification.first_look import Look
from flownav.logs.open_log import open_log
from flownav.scoring.path import autopilot_errors
from flownav.studies.inspection import summarise
from replay_logs import log_of_flight
from ulog_files import ulog_of_flight


@pytest.fixture(scope="module")
def flown():
    return log_of_flight(40.0)


@pytest.fixture(scope="module")
def ulog(flown, tmp_path_factory) -> Path:
    writer = ulog_of_flight(flown.tables)
    t_s = np.arange(0.0, 39.0, 0.1)
    north, east, down = (np.interp(t_s, flown.t_s, column) for column in flown.position.T)
    speed = [np.interp(t_s, flown.t_s, column) for column in flown.velocity.T]
    writer.add(
        "vehicle_local_position", t_s, float__x=north + 5.0, float__y=east - 3.0, float__z=down,
        float__vx=speed[0] + 0.3, float__vy=speed[1] - 0.4, float__vz=speed[2],
    )  # fmt: skip
    return writer.write(tmp_path_factory.mktemp("ulog") / "garden.ulg")


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def call(command, *arguments):
    app = typer.Typer()
    app.command()(command)
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def facts_of(path: Path, *options) -> dict:
    result = call(replay_command.info, path, *options, "--json")
    assert result.exception is None, result.exception
    return json.loads(result.stdout, parse_constant=pytest.fail)  # no NaN, no Infinity


def test_json_holds_every_stream_with_its_figures(ulog):
    facts = facts_of(ulog)
    streams = {stream["sensor"]: stream for stream in facts["streams"]}
    assert set(streams) == {"attitude", "imu", "flow_rate", "range", "baro", "mag", "gps_velocity", "gps_position"}
    flow = streams["flow_rate"]
    assert flow["count"] == 800
    assert flow["rate_hz"] == pytest.approx(20.0)
    assert flow["largest_gap_s"] == pytest.approx(0.05, abs=1e-5)
    assert flow["delay_s"] == pytest.approx(0.004 + 0.025, abs=1e-5)
    assert facts["limits"]["range_m"]["low"] == pytest.approx(0.1)
    assert facts["limits"]["range_m"]["outside_share"] == 0.0
    assert facts["clock"] == facts["warnings"] == facts["absences"] == []
    assert facts["flow_is_wrong"] is False
    assert facts["checked"].endswith("flow with GPS velocity")
    assert not list(Path.cwd().iterdir())


def test_the_autopilots_error_is_that_of_its_velocity_and_not_of_its_origin(ulog):
    own = facts_of(ulog)["autopilot"]
    assert own["name"] == "PX4 EKF2"
    assert own["against"] == "gps"
    assert own["horizontal_rms_m"] < 0.02
    assert own["velocity_rms_m_s"] == pytest.approx(0.5, abs=0.02)


def test_the_autopilots_error_against_truth_does_not_see_the_frames_yaw(flown):
    t_s = np.arange(0.0, 39.0, 0.1)
    position = np.column_stack([np.interp(t_s, flown.t_s, column) for column in flown.position.T])
    c, s = np.cos(1.1), np.sin(1.1)
    turned = position @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + [3.0, -8.0, 1.0]
    wobble = 0.2 * np.sin(7.0 * t_s)[:, None] * [1.0, 0.0, 0.0]
    names = ("pos_n_m", "pos_e_m", "pos_d_m")
    estimate = {"t_s": t_s, **dict(zip(names, (position + wobble).T, strict=True))}
    truth = {"t_s": t_s, **dict(zip(names, turned.T, strict=True))}
    errors = autopilot_errors(estimate, truth, {})
    assert errors["against"] == "truth"
    assert errors["horizontal_rms_m"] == pytest.approx(0.2 / np.sqrt(2), rel=0.05)
    assert errors["yaw_rad"] == pytest.approx(-1.1, abs=0.01)
    assert errors["velocity_rms_m_s"] is None
    apart = {**truth, "t_s": t_s + 1000.0}
    assert autopilot_errors(estimate, apart, {})["against"] is None
    assert autopilot_errors(estimate, None, {})["horizontal_rms_m"] is None


def test_a_log_that_does_not_move_has_no_yaw():
    t_s = np.arange(0.0, 60.0, 0.1)
    random = np.random.default_rng(2)
    names = ("pos_n_m", "pos_e_m", "pos_d_m")
    drift = np.cumsum(0.02 * random.standard_normal((600, 3)), axis=0)
    estimate = {"t_s": t_s, **dict(zip(names, drift.T, strict=True))}
    truth = {"t_s": t_s, **dict(zip(names, np.zeros((3, 600)), strict=True))}
    errors = autopilot_errors(estimate, truth, {})
    assert errors["against"] == "truth"
    assert errors["yaw_rad"] is None


def test_the_verdict_stands_in_words(ulog):
    facts = facts_of(ulog)
    assert facts["verdict"].startswith("flow and GPS agree: lag 0.2")
    assert facts["agreement"]["scale"] == pytest.approx(1.0, abs=0.02)
    assert facts["agreement"]["correlation"] > 0.98
    assert f"Verdict: {facts['verdict']}" in call(replay_command.info, ulog).stdout


def indoors(flown, folder, *, sign=1.0, sonar=False, truth=True):
    """Flow, range and IMU alone, the flow without a gyro of its own."""
    tables = {name: dict(flown.tables[name]) for name in ("imu", "flow", "range")}
    flow, distance = tables["flow"], tables["range"]
    for axis in "xy":
        flow[f"flow_{axis}_rad_s"] = sign * flow[f"flow_{axis}_rad_s"]
        del flow[f"gyro_{axis}_rad_s"]
    if sonar:
        echo = np.arange(len(distance["t_s"])) % 7 == 3
        distance["range_m"] = np.where(echo, distance["range_m"] + 3.0, distance["range_m"])
    if truth:
        t_s = np.arange(0.0, 39.0, 0.02)
        place = [np.interp(t_s, flown.t_s, column) for column in flown.position.T]
        tables["truth"] = {"t_s": t_s, **dict(zip(("x_m", "y_m", "z_m"), place, strict=True))}
    return replace(flown, tables=tables).write(folder)


def test_an_imu_only_folder_is_replayable_and_its_flow_agrees(flown, tmp_path):
    facts = facts_of(indoors(flown, tmp_path / "indoors"))
    assert facts["replayable"] is True
    assert facts["obstacles"] == facts["warnings"] == []
    assert facts["verdict"].startswith("flow and truth.csv agree: lag ")
    assert facts["agreement"]["own_attitude"] is True
    instead = {absence["what"]: absence["instead"] for absence in facts["absences"]}
    assert instead["no attitude"].startswith("it is found from the IMU")
    assert instead["no gyro in the flow sensor"] == "rotation is taken out of the flow with the IMU"


@pytest.mark.parametrize("truth", [True, False], ids=["truth", "IMU alone"])
def test_inverted_flow_is_seen_without_gps_and_without_attitude(flown, tmp_path, truth):
    facts = facts_of(indoors(flown, tmp_path / "indoors", sign=-1.0, truth=truth))
    against = "truth.csv" if truth else "the IMU"
    said = f"flow: signs of x and y are inverted (sensor turned by 180 deg), against {against}"
    assert facts["warnings"] == [f"{said}; mend the log's flow columns"]
    assert facts["flow_is_wrong"] is True
    assert facts["verdict"].startswith(f"flow and {against} disagree: signs of x and y are inverted")
    assert facts["agreement"]["scale"] == pytest.approx(1.0, abs=0.1)


def test_a_range_that_jumps_is_seen(flown, tmp_path):
    facts = facts_of(indoors(flown, tmp_path / "indoors", sonar=True))
    assert len(facts["warnings"]) == 1
    assert facts["warnings"][0].startswith("range jumps in 28% of its steps in flight, by up to 3.")


def test_a_slow_imu_alone_cannot_be_replayed_and_info_says_why(flown, tmp_path):
    tables = {name: dict(flown.tables[name]) for name in ("imu", "flow", "range")}
    tables["imu"] = {name: values[::10] for name, values in tables["imu"].items()}
    facts = facts_of(replace(flown, tables=tables).write(tmp_path / "slow"))
    assert facts["replayable"] is False
    assert facts["obstacles"] == ["no attitude, and its IMU has 5.0 Hz: one of them is needed, an IMU of 20 Hz or more"]
    shown = call(replay_command.info, tmp_path / "slow").stdout
    assert "Cannot be replayed: no attitude" in shown


def test_people_see_the_same(ulog):
    result = call(replay_command.info, ulog)
    assert result.exception is None
    for said in ("garden.ulg: 40.0 s", "flow_rate", "Clock: no gap, no jump, nothing repeated",
                 "Stated limits of range_m: 0.1 to 12",
                 "The autopilot's own estimate: PX4 EKF2", "against GPS"):  # fmt: skip
        assert said in result.stdout


def test_what_is_wrong_and_missing_is_said(flown, tmp_path):
    writer = ulog_of_flight(flown.tables)
    for topic in writer.topics:
        if topic.name == "vehicle_optical_flow":
            topic.fields["float pixel_flow"] = -topic.fields["float pixel_flow"]
        if topic.name == "distance_sensor":
            keep = (topic.t_s < 10) | (topic.t_s > 15)
            topic.t_s, topic.fields = topic.t_s[keep], {name: value[keep] for name, value in topic.fields.items()}
    writer.topics = [topic for topic in writer.topics if topic.name != "vehicle_imu"]
    path = writer.write(tmp_path / "wrong.ulg")
    facts = facts_of(path)
    assert facts["flow_is_wrong"] is True
    assert any("flow sign is inverted (both axes)" in text for text in facts["warnings"])
    assert [absence["what"] for absence in facts["absences"]] == ["no inertial readings"]
    assert len(facts["clock"]) == 1
    assert facts["clock"][0].startswith("range: 1 gaps, 5.")
    shown = call(replay_command.info, path).stdout
    assert "Warning: flow sign is inverted" in shown
    assert "no inertial readings" in shown


@pytest.mark.parametrize("sign", [1, -1])
def test_without_gps_the_reference_tells_the_flows_sign(flown, tmp_path, sign):
    writer = ulog_of_flight(flown.tables)
    writer.topics = [topic for topic in writer.topics if topic.name != "sensor_gps"]
    fields = next(topic for topic in writer.topics if topic.name == "vehicle_optical_flow").fields
    fields["float pixel_flow"] = sign * fields["float pixel_flow"]
    t_s = np.arange(0.0, 39.0, 1 / 30)
    at = [np.interp(t_s, flown.t_s, column) for column in (*flown.position.T, *flown.velocity.T)]
    angles = [np.interp(t_s, flown.tables["attitude"]["t_s"], flown.tables["attitude"][f"{name}_rad"])
              for name in ("roll", "pitch")]  # fmt: skip
    yaw = np.interp(t_s, flown.tables["attitude"]["t_s"], np.unwrap(flown.tables["attitude"]["yaw_rad"]))
    writer.add(
        "vehicle_visual_odometry", t_s, float__position=np.column_stack(at[:3]),
        float__velocity=np.column_stack(at[3:]), float__q=np.column_stack(quaternion_from_euler(*angles, yaw)),
        uint8_t__pose_frame=0 * t_s + 1, uint8_t__velocity_frame=0 * t_s + 1,
    )  # fmt: skip
    facts = facts_of(writer.write(tmp_path / "indoors.ulg"))
    assert facts["checked"].endswith("flow with the reference's velocity")
    assert facts["flow_is_wrong"] is (sign < 0)
    text = "flow sign is inverted (both axes) against the reference; mend the log's flow columns"
    assert facts["warnings"] == ([text] if sign < 0 else [])
    assert facts["agreement"]["against"] == "visual odometry"
    identified = call(identify.command, tmp_path / "indoors.ulg", "--json")
    assert json.loads(identified.stdout)["reference"] == "visual odometry"


def test_a_log_that_cannot_be_replayed_is_shown_all_the_same(flown, tmp_path):
    writer = ulog_of_flight(flown.tables)
    writer.topics = [topic for topic in writer.topics if topic.name in ("vehicle_imu", "vehicle_optical_flow")]
    path = writer.write(tmp_path / "part.ulg")
    facts = facts_of(path)
    assert [stream["sensor"] for stream in facts["streams"]] == ["imu", "flow_rate"]
    assert facts["checked"].startswith("no two sensors: the log has no attitude")
    assert facts["verdict"] == (
        "flow is not compared with a reference: no range readings; a range is needed for the flow's scale and height"
    )
    assert facts["replayable"] is True  # IMU and flow are enough
    assert {"no GPS fix", "no range"} <= {absence["what"] for absence in facts["absences"]}
    writer.topics = [topic for topic in writer.topics if topic.name == "vehicle_optical_flow"]
    result = call(replay_command.command, writer.write(tmp_path / "flow.ulg"))
    assert isinstance(result.exception, InputError)
    assert "the log lacks an attitude or an IMU, which a replay needs" in str(result.exception)
    assert not list(Path.cwd().rglob("*.fnr"))


def test_csv_folders_are_shown_too(flown, tmp_path):
    facts = facts_of(flown.write(tmp_path / "csv"))
    assert len(facts["streams"]) == 8
    assert facts["autopilot"] is None
    with pytest.raises(InputError, match="flow_instance"):
        open_log(tmp_path / "csv", flow_instance=1)


def test_a_replayed_ulog_drifts_as_its_csv_does(flown, ulog, tmp_path):
    cut = ("--gps-outage", "15:35", "--json", "--no-report")
    both = [
        json.loads(call(replay_command.command, path, *cut).stdout) for path in (ulog, flown.write(tmp_path / "csv"))
    ]
    ours, theirs = (facts["outages"][0]["horizontal_rms_m"] for facts in both)
    assert ours == pytest.approx(theirs, abs=0.01)
    assert both[0]["record"] == "out/garden.ulg.fnr"
    assert "flow-instance 4 is not in the log" in printed(
        call(replay_command.command, ulog, "--flow-instance", "4").exception
    )


def test_identify_takes_a_ulog_and_says_what_a_rig_cannot_have(ulog, tmp_path):
    result = call(identify.command, ulog, "--json")
    assert result.exception is None, result.exception
    facts = json.loads(result.stdout)
    assert facts["kind"] == "flight"
    assert facts["gain"]["value"] == pytest.approx(1.0, abs=0.05)
    (tmp_path / "rig.csv").write_text("t_s\n0\n")
    wrong = call(identify.command, tmp_path / "rig.csv", "--flow-instance", "1").exception
    assert "--flow-instance: a rig log holds one flow sensor" in printed(wrong)
    wrong = call(identify.command, ulog, "--flow-instance", "4").exception
    assert "--flow-instance 4 is not in the log" in printed(wrong)


def test_a_real_log_of_two_flow_sensors(data_folder):
    path = data_folder / "px4-voxl-indoor" / "voxl_two_flow_sensors.ulg"
    if not path.is_file():
        pytest.skip(f"{path} is absent")
    facts = facts_of(path)
    streams = {stream["sensor"]: stream for stream in facts["streams"]}
    assert streams["flow_rate"]["rate_hz"] == pytest.approx(58.8, abs=0.1)
    assert facts["limits"]["range_m"]["outside_share"] > 0.5  # on the ground it reads below what it states
    assert facts["checked"].endswith("flow with the reference's velocity")
    assert facts["warnings"] == []
    assert facts["autopilot"]["against"] == "truth"
    assert 0.1 < facts["autopilot"]["horizontal_rms_m"] < 2.0
    log = open_log(path)
    flow = log.streams[Sensor.FLOW_RATE]
    swapped = replace(log, streams={**log.streams, Sensor.FLOW_RATE: replace(flow, value=flow.value[:, [1, 0, 2, 3]])})
    assert any("flow axes are swapped" in text for text in summarise(swapped)["warnings"])
    second = facts_of(path, "--flow-instance", "1")
    assert next(s for s in second["streams"] if s["sensor"] == "flow_rate")["count"] == 14438
    assert Sensor.IMU.name.lower() not in streams


@pytest.mark.parametrize(("lag_s", "scale", "said"), [
    (0.2, 1.02, "flow and GPS agree: lag 0.20 s, scale 1.02"),
    (-0.06, 0.88, "flow and GPS agree in shape, not in size and time: the flow reads 12 % too little and it lies "
     "0.06 s behind GPS (lag -0.06 s, scale 0.88)"),
    (0.0, 1.2, "flow and GPS agree in shape, not in size: the flow reads 20 % too much (lag 0.00 s, scale 1.20)"),
    (0.33, 0.99, "flow and GPS agree in shape, not in time: the flow lies 0.33 s ahead of GPS "
     "(lag 0.33 s, scale 0.99)"),
    (0.0, 0.44, "flow and GPS do not agree in size: alike in shape (correlation 0.97), the flow reads 56 % too little "
     "(lag 0.00 s, scale 0.44)"),
])  # fmt: skip
def test_flow_that_differs_in_size_and_time_does_not_simply_agree(lag_s, scale, said):
    look = Look("GPS", 0.97, lag_s, scale, "axes and signs are right", True, True, 0.0, False)
    assert look.verdict == said
    assert look.agrees == (0.8 <= scale <= 1.25)
    assert not look._replace(correlation=0.89).agrees
