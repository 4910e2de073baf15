"""ULog as pyulog reads it: PX4's names and units, innovations by sensor and component, events as strings."""

from __future__ import annotations

import numpy as np
import pytest
from pyulog import ULog
from pyulog.px4 import PX4ULog

from export_records import awkward
from flownav.core.frames import euler_from_quaternion
from flownav.core.record import POSITION_NED, QUATERNION, VELOCITY_BODY, Record
from flownav.export.formats import export
from flownav.export.ulog_topics import message
from report_records import flight, replay


def read(path):
    log = ULog(str(path))
    assert not log.file_corruption
    for topic in log.data_list:
        assert (np.diff(topic.data["timestamp"].astype(np.int64)) >= 0).all()
    return log


def vector(topic, name, count):
    return np.column_stack([topic.data[f"{name}[{k}]"] for k in range(count)])


@pytest.fixture(scope="module")
def landing(tmp_path_factory):
    path = tmp_path_factory.mktemp("ulog") / "l.ulg"
    export(flight("landing"), "ulog", path)
    return read(path)


@pytest.mark.parametrize(("table", "suffix"), [("estimate", ""), ("truth", "_groundtruth")])
def test_px4_names_carry_the_estimate_and_the_truth(landing, table, suffix):
    record = flight("landing")
    place = landing.get_dataset(f"vehicle_local_position{suffix}")
    xyz = np.column_stack([place.data[axis] for axis in "xyz"])
    assert np.allclose(xyz, record.matrix(table, POSITION_NED), atol=1e-6)
    assert np.array_equal(place.data["timestamp"], np.rint(record.tables[table]["t_s"] * 1e6))
    assert place.data["xy_valid"].all()
    assert place.data["v_xy_valid"].all()
    attitude = landing.get_dataset(f"vehicle_attitude{suffix}")
    assert np.allclose(vector(attitude, "q", 4), record.matrix(table, QUATERNION), atol=1e-6)


def test_flight_review_s_angles_are_the_record_s(landing):
    PX4ULog(landing).add_roll_pitch_yaw()
    topic = landing.get_dataset("vehicle_attitude")
    angles = np.array([euler_from_quaternion(*q) for q in flight("landing").matrix("estimate", QUATERNION)])
    for k, name in enumerate(("roll", "pitch", "yaw")):
        assert np.allclose(topic.data[name], angles[:, k], atol=1e-6)
    assert np.allclose(landing.get_dataset("vehicle_local_position").data["heading"], angles[:, 2], atol=1e-6)


def test_our_estimate_holds_doubles_and_standard_deviations(landing):
    record, topic = flight("landing"), landing.get_dataset("flownav_estimate")
    assert np.array_equal(topic.data["x"], record.tables["estimate"]["pos_n_m"])
    for name in (*POSITION_NED, *VELOCITY_BODY):
        assert np.array_equal(topic.data[f"std_{name}"], record.tables["estimate"][f"std_{name}"])
    place = landing.get_dataset("vehicle_local_position")
    assert place.data["eph"] == pytest.approx(np.hypot(topic.data["std_pos_n_m"], topic.data["std_pos_e_m"]), abs=1e-6)


def test_velocity_is_in_the_earth_s_axes(tmp_path):
    record = replay(duration_s=30.0)
    export(record, "ulog", tmp_path / "r.ulg")
    topic, table = read(tmp_path / "r.ulg").get_dataset("flownav_estimate"), record.tables["estimate"]
    yaw = 2.0 * np.arctan2(table["qz"], table["qw"])
    north = table["vel_u_m_s"] * np.cos(yaw) - table["vel_v_m_s"] * np.sin(yaw)
    assert np.allclose(topic.data["vx"], north)


def test_flow_and_range_are_what_px4_would_log(tmp_path):
    record = replay(duration_s=30.0)
    export(record, "ulog", tmp_path / "r.ulg")
    log = read(tmp_path / "r.ulg")
    flow, table = log.get_dataset("vehicle_optical_flow"), record.tables["flow_rate"]
    span_s = flow.data["integration_timespan_us"] * 1e-6
    assert span_s == pytest.approx(np.median(np.diff(table["t_s"])), abs=1e-6)
    for k, axis in enumerate("xy"):
        assert np.allclose(flow.data[f"pixel_flow[{k}]"] / span_s, table[f"flow_{axis}_rad_s"], rtol=1e-5, atol=1e-7)
        assert np.allclose(flow.data[f"delta_angle[{k}]"] / span_s, table[f"gyro_{axis}_rad_s"], rtol=1e-5, atol=1e-7)
    assert np.isnan(flow.data["delta_angle[2]"]).all()
    assert np.array_equal(flow.data["quality"], table["quality"])
    distance = log.get_dataset("distance_sensor")
    assert np.allclose(distance.data["current_distance"], record.tables["range"]["range_m"], rtol=1e-6)
    assert set(distance.data["signal_quality"]) == {100}
    record.tables["range"]["quality"] = np.linspace(0.0, 255.0, len(record.tables["range"]["t_s"]))
    export(record, "ulog", tmp_path / "r.ulg")
    percent = read(tmp_path / "r.ulg").get_dataset("distance_sensor").data["signal_quality"]
    assert np.allclose(percent, np.linspace(0.0, 100.0, len(percent)), atol=0.5)
    assert set(distance.data["orientation"]) == {25}


def test_innovations_are_a_topic_a_sensor_and_component(tmp_path):
    record = awkward()
    export(record, "ulog", tmp_path / "a.ulg")
    log = read(tmp_path / "a.ulg")
    table = record.tables["innovation"]
    reasons = dict(pair.split(" ") for pair in log.msg_info_dict["flownav_reasons"].split(", "))
    for sensor, component in (("gps_position", "pos_n_m"), ("range", "pos_d_m")):
        topic, of = log.get_dataset(f"flownav_innovation_{sensor}_{component}"), table["sensor"] == sensor
        assert np.array_equal(topic.data["innovation"], table["innovation"][of])
        assert np.isnan(topic.data["test_ratio"]).all()
        assert np.array_equal(topic.data["fused"].astype(bool), table["fused"][of])
        assert [reasons[str(code)] for code in topic.data["reason"]] == table["reason"][of].tolist()
        assert "observation" not in topic.data


def test_events_are_logged_strings_at_their_level(tmp_path):
    export(awkward(), "ulog", tmp_path / "a.ulg")
    strings = [(s.timestamp, s.log_level_str(), s.message) for s in read(tmp_path / "a.ulg").logged_messages]
    assert strings == [
        (800_000, "WARNING", '[flownav] replay warning: a "quoted", comma\nand a second line'),
        (1_500_000, "INFO", "[flownav] gps lost: for this long [s] 0.2"),
        (1_700_000, "INFO", "[flownav] gps back"),
    ]


def test_what_a_record_lacks_is_not_made_up(tmp_path):
    written = export(awkward(), "ulog", tmp_path / "a.ulg")
    log = read(tmp_path / "a.ulg")
    names = {topic.name for topic in log.data_list}
    assert "vehicle_attitude_groundtruth" not in names
    assert "flownav_autopilot" not in names
    truth = log.get_dataset("vehicle_local_position_groundtruth")
    assert not truth.data["v_xy_valid"].any()
    assert np.isnan(truth.data["vx"]).all()
    assert not any(name.startswith("q") for name in log.get_dataset("flownav_truth").data)
    assert np.isnan(log.get_dataset("distance_sensor").data["current_distance"]).sum() == 5
    assert set(log.message_formats) >= {"vehicle_optical_flow"}  # an empty table is defined, without rows
    assert np.array_equal(log.get_dataset("flownav_flags").data["level"], np.arange(40)[np.argsort(_flag_times())])
    assert written.notes == [
        "estimate: 1 of 40 rows left out, not finite",
        "all times are 1 s later than in the record: the format has no negative time",
        "flags: ULog topics hold numbers; left out: mode",
    ]


def _flag_times():
    return awkward().tables["flags"]["t_s"]


def test_rows_without_a_time_are_counted(tmp_path):
    record = flight("landing")
    t_s = record.tables["gps_position"]["t_s"]
    record.tables["gps_position"]["t_s"] = np.where(np.arange(len(t_s)) == 5, np.nan, t_s)
    for to, name in (("ulog", "a.ulg"), ("mcap", "a.mcap")):
        notes = export(record, to, tmp_path / name).notes
        assert notes == ["gps_position: rows without a time left out: 1"]


def test_a_table_without_px4_s_columns_keeps_its_own_name(tmp_path):
    record = flight("landing")
    record.add("range", {"t_s": np.arange(3.0), "range_m": np.ones(3)})
    export(record, "ulog", tmp_path / "a.ulg")
    assert read(tmp_path / "a.ulg").get_dataset("flownav_range").data["range_m"].tolist() == [1.0, 1.0, 1.0]


def test_the_shortest_record_is_a_log(tmp_path):
    record = Record()
    record.add("estimate", {"t_s": np.array([2.0]), **{name: np.array([1.0]) for name in POSITION_NED}})
    export(record, "ulog", tmp_path / "a.ulg")
    log = read(tmp_path / "a.ulg")
    assert log.start_timestamp == log.last_timestamp == 2_000_000


def test_a_message_that_is_too_long_is_refused():
    with pytest.raises(ValueError, match="65535 bytes, not 65536"):
        message("L", bytes(65536))


def test_heading_and_accuracies_are_each_their_own(tmp_path):
    record = awkward()
    export(record, "ulog", tmp_path / "a.ulg")
    place = read(tmp_path / "a.ulg").get_dataset("vehicle_local_position")
    table = record.tables["estimate"]
    rows = np.flatnonzero(np.isfinite(table["pos_e_m"]))
    rows = rows[np.argsort(table["t_s"][rows], kind="stable")]
    yaw = [euler_from_quaternion(*(table[name][row] for name in QUATERNION))[2] for row in rows]
    assert place.data["heading"] == pytest.approx(np.array(yaw), abs=1e-5)
    assert place.data["epv"] == pytest.approx(table["std_pos_d_m"][rows], abs=1e-6)
