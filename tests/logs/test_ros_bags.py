"""ROS bags and MCAP files: a made flight comes out as from the CSV folder, in whatever container, axes and clock."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from fed_records import queue_of_flight, record_of
from flownav.core.errors import InputError
from flownav.core.measurement import Sensor
from flownav.export.formats import export
from flownav.logs.log import Log, frd, ned, ned_from_frd, ned_from_frd_of_nwu
from flownav.logs.open_log import log_kind, open_flight, open_log
from flownav.logs.ros.bag import Bag
from flownav.logs.ros.containers import messages
from flownav.logs.ros.reader import read_ros
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.replays.bundle import to_record
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import replay
from replay_logs import SyntheticLog, log_of_flight
from replayed_alike import apart, largest_difference

pytest.importorskip("rosbags")
from rosbags.rosbag2 import StoragePlugin

from ros_bags import BagMaker, enu_quaternion, px4_flight, ros_flight

# what single precision and nanoseconds cost, in each sensor's unit
CLOSE = {
    Sensor.GPS_POSITION: 1e-4, Sensor.GPS_VELOCITY: 1e-6, Sensor.FLOW_RATE: 1e-6, Sensor.RANGE: 1e-6, Sensor.IMU: 2e-6,
    Sensor.ATTITUDE: 1e-3, Sensor.BARO: 1e-5, Sensor.MAG: 1e-6,
}  # fmt: skip
ALIKE_M, ALIKE_M_S = 0.005, 0.01


@pytest.fixture(scope="module")
def flown() -> SyntheticLog:
    return log_of_flight(20.0)


@pytest.fixture(scope="module")
def folder(flown, tmp_path_factory) -> Path:
    return flown.write(tmp_path_factory.mktemp("csv") / "flight")


@pytest.fixture(scope="module")
def truth(flown) -> dict[str, np.ndarray]:
    part = slice(1000, -1000, 20)
    return {"t_s": flown.t_s[part], **dict(zip("ned", flown.position[part].T, strict=True))}


@pytest.fixture(scope="module")
def bags(flown, truth, tmp_path_factory) -> dict[str, Path]:
    root = tmp_path_factory.mktemp("bags")
    made = ros_flight(flown.tables, truth)
    return {
        "mcap folder": made.write(root / "mcap"),
        "mcap file": next((root / "mcap").glob("*.mcap")),
        "sqlite folder": made.write(root / "db3", StoragePlugin.SQLITE3),
        "sqlite file": next((root / "db3").glob("*.db3")),
        "px4": px4_flight(flown.tables).write(root / "px4"),
    }


CONTAINERS = ("mcap folder", "mcap file", "sqlite folder", "sqlite file", "px4")


@pytest.mark.parametrize("name", CONTAINERS)
def test_every_sensor_reads_as_in_the_csv_folder(bags, folder, name):
    log, known = open_log(bags[name]), open_log(folder)
    assert set(log.streams) == set(known.streams) - ({Sensor.MAG} if name == "px4" else set())
    for sensor in log.streams:
        assert largest_difference(log, known, sensor) < CLOSE[sensor], sensor
    assert log.origin_deg_m == pytest.approx(known.origin_deg_m)
    assert log.limits["range_m"] == pytest.approx((0.1, 12.0))


def test_a_receiver_whose_bag_has_no_velocity_topic_has_no_velocity(flown, tmp_path):
    """Not one that was received and never fused, which ends a replay with a warning and status 1."""
    made = ros_flight(flown.tables)
    made.rows = [row for row in made.rows if "gps_vel" not in row[1]]
    log = open_log(made.write(tmp_path / "mcap"))
    assert Sensor.GPS_POSITION in log.streams
    assert Sensor.GPS_VELOCITY not in log.streams
    found = replay(log, ReplayOptions(), NavigatorSettingsFile()).findings
    assert not any(each.unfused for each in found)


@pytest.mark.parametrize("name", ["mcap file", "px4"])
def test_the_replay_comes_out_as_that_of_the_csv_folder(bags, folder, flown, tmp_path, name):
    csv = folder
    if name == "px4":  # that bag has no magnetometer
        csv = SyntheticLog({n: t for n, t in flown.tables.items() if n != "mag"}).write(tmp_path / "csv")
    distance_m, speed_m_s = apart(csv, bags[name])
    assert distance_m < ALIKE_M
    assert speed_m_s < ALIKE_M_S


def test_motion_capture_is_the_reference_in_ned(bags, flown):
    log = open_log(bags["mcap file"])
    assert log.truth_name == "/vrpn/vehicle/pose"
    for k, name in enumerate(("pos_n_m", "pos_e_m", "pos_d_m")):
        so = np.interp(log.truth["t_s"], flown.t_s, flown.position[:, k])
        assert np.allclose(log.truth[name][2:-2], so[2:-2], atol=2e-3)
    assert any(note.startswith("truth is /vrpn/vehicle/pose (") for note in log.notes)
    assert any("is taken to look down" in note for note in log.notes)


def test_axes_are_turned_with_the_right_signs():
    """Nose north and level: REP 103 says a yaw of 90 degrees. East, north, up 1, 2, 3 is north 2, east 1, down -3."""
    assert ned(np.array([[1.0, 2.0, 3.0]])).tolist() == [[2.0, 1.0, -3.0]]
    assert frd(np.array([[1.0, 2.0, 3.0]])).tolist() == [[1.0, -2.0, -3.0]]
    north = ned_from_frd(np.array([[np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]]))[0]
    assert abs(north[0]) == pytest.approx(1.0)
    east = ned_from_frd(np.array([[1.0, 0.0, 0.0, 0.0]]))[0]  # ENU's yaw 0
    assert np.allclose(east * np.sign(east[0]), [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
    left = ned_from_frd_of_nwu(np.array([[np.cos(0.1), 0.0, 0.0, np.sin(0.1)]]))[0]  # 0.2 rad to the left
    assert np.allclose(left, [np.cos(0.1), 0.0, 0.0, -np.sin(0.1)])
    from flownav.core.frames import euler_from_quaternion

    for angles in ((0.1, 0.2, 0.3), (-0.3, 0.1, -2.0), (0.05, -0.2, 3.0)):
        turned = ned_from_frd(np.array([enu_quaternion(*angles)]))[0]
        assert np.allclose(euler_from_quaternion(*turned), angles)


def test_stamps_in_headers_count_and_their_age_is_the_delay(flown, folder, tmp_path):
    log = open_log(ros_flight(flown.tables, late_s=0.03).write(tmp_path / "late"))
    known = open_log(folder)
    for sensor in (Sensor.IMU, Sensor.RANGE, Sensor.GPS_POSITION):
        assert log.streams[sensor].delay_s == pytest.approx(0.03, abs=1e-6)
        assert np.allclose(log.streams[sensor].t_s - 0.03, known.streams[sensor].t_s, atol=1e-6)
    assert log.streams[Sensor.FLOW_RATE].delay_s == pytest.approx(0.03 + 0.025, abs=1e-6)
    assert log.clock_start_s == pytest.approx(1.76e9)


@pytest.mark.parametrize(("which", "note"), [
    ("all", "no stamps in the headers: the times at which messages were logged are taken"),
    ("imu", "no stamp in the headers of /mavros/imu/data: the times of logging are taken"),
    ("decades", ""),
    ("torn", "the headers' stamps are of different clocks: the times at which messages were logged are taken"),
])  # fmt: skip
def test_headers_without_a_sound_stamp(flown, folder, tmp_path, which, note):
    """None at all; none in one topic; a simulator's clock that starts at 0; two clocks a year apart."""
    made = ros_flight(flown.tables)
    for _, topic, _, message in made.rows:
        stamp = message.header.stamp
        if which == "all" or (which == "imu" and topic == "/mavros/imu/data"):
            stamp.sec = stamp.nanosec = 0
        elif which == "decades" or (which == "torn" and "imu" in topic):
            stamp.sec -= 1_759_999_000
    log, known = open_log(made.write(tmp_path / "bag")), open_log(folder)
    assert [each for each in log.notes if "stamp" in each] == ([note] if note else [])
    imu, fixes = log.streams[Sensor.IMU], log.streams[Sensor.GPS_POSITION]
    assert np.allclose(imu.t_s - imu.t_s[0], known.streams[Sensor.IMU].t_s, atol=1e-6)
    assert np.allclose(fixes.t_s - imu.t_s[0], known.streams[Sensor.GPS_POSITION].t_s, atol=1e-6)


def doubled(flown: SyntheticLog) -> BagMaker:
    """Two IMUs, of which the camera's has more messages, and two flow sensors, of which one sees little."""
    made = ros_flight(flown.tables)
    for ns, topic, kind, message in list(made.rows):
        if topic == "/mavros/imu/data":
            made.rows += [(ns + k, "/camera/imu", kind, message) for k in range(2)]
        if "optical_flow_rad" in topic and ns % 3 == 0:
            made.rows.append((ns, "/second/flow", kind, message))
    return made


def test_of_several_topics_one_is_taken_and_a_note_says_which_and_why(flown, tmp_path):
    bag = doubled(flown).write(tmp_path / "bag")
    log = open_log(bag)
    assert len(log.streams[Sensor.IMU]) == 1000
    assert "imu is /mavros/imu/data (1000 messages, by its name: imu); not used: /camera/imu (2000)" in log.notes
    second = open_log(bag, flow_instance=1)
    assert len(second.streams[Sensor.FLOW_RATE]) < 0.5 * len(log.streams[Sensor.FLOW_RATE])
    asked = read_ros(bag, topics={"flow": "/second/flow"})
    assert len(asked.streams[Sensor.FLOW_RATE]) == len(second.streams[Sensor.FLOW_RATE])
    assert "flow is /second/flow, as asked" in asked.notes
    with pytest.raises(InputError, match=r"flow_instance 2: the bag's flow topics are 0 \(/mavros"):
        open_log(bag, flow_instance=2)
    with pytest.raises(InputError, match="topics imu=/none: no such topic; for imu the bag has /camera/imu, /mavros"):
        read_ros(bag, topics={"imu": "/none"})
    with pytest.raises(InputError, match="topics sonar=/x: the roles are imu, gps"):
        read_ros(bag, topics={"sonar": "/x"})


def test_px4_and_motion_capture_in_one_bag_share_px4s_clock(flown, truth, tmp_path):
    made = px4_flight(flown.tables)
    poses = [row for row in ros_flight(flown.tables, truth).rows if row[1] == "/vrpn/vehicle/pose"]
    made.rows += [(ns + 3_000_000, *rest) for ns, *rest in poses]
    log = open_log(made.write(tmp_path / "bag"))
    assert log.truth_name == "/vrpn/vehicle/pose"
    so = np.interp(log.truth["t_s"], flown.t_s, flown.position[:, 0])
    assert np.allclose(log.truth["pos_n_m"][2:-2], so[2:-2], atol=0.02)


def test_a_bag_that_was_cut_off_is_read_as_far_as_it_goes(bags, tmp_path):
    """The bag of a computer that lost its power: no index, no footer, a chunk in the middle."""
    content = bags["mcap file"].read_bytes()
    (tmp_path / "cut.mcap").write_bytes(content[: len(content) // 2])
    log = read_ros(tmp_path / "cut.mcap")
    whole = read_ros(bags["mcap file"])
    assert 0.2 * len(whole.streams[Sensor.IMU]) < len(log.streams[Sensor.IMU]) < 0.8 * len(whole.streams[Sensor.IMU])
    assert any(note.startswith("cut.mcap: damaged (a record of") for note in log.notes)


def test_a_chunk_that_claims_gigabytes_is_left_out(tmp_path):
    from mcap.writer import CompressionType, Writer

    with (tmp_path / "bomb.mcap").open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD, chunk_size=1 << 30)
        writer.start(profile="ros2", library="other")
        schema = writer.register_schema("sensor_msgs/msg/Imu", "ros2msg", b"")
        channel = writer.register_channel("/imu", "cdr", schema)
        for k in range(40):
            writer.add_message(channel, k, bytes(8 << 20), k)
        writer.finish()
    assert (tmp_path / "bomb.mcap").stat().st_size < 1 << 20
    bag = Bag()
    assert list(messages(tmp_path / "bomb.mcap", bag, lambda channel: True)) == []
    assert bag.notes == ["bomb.mcap: one record is damaged and left out"]
    with pytest.raises(
        InputError, match=r"no message can be read .bomb.mcap: one record is damaged and left out.; copy"
    ):
        read_ros(tmp_path / "bomb.mcap")


def test_a_bag_without_definitions_takes_those_of_ros_and_says_what_it_lacks(bags, tmp_path):
    """SQLite bags from before ROS 2 Iron have none: sensor_msgs are known, mavros_msgs are not."""
    import sqlite3

    file = tmp_path / "old.db3"
    file.write_bytes(bags["sqlite file"].read_bytes())
    with sqlite3.connect(file) as base:
        base.execute("DROP TABLE message_definitions")
    log = open_log(file)
    assert Sensor.IMU in log.streams
    assert Sensor.FLOW_RATE not in log.streams
    lacking = "the bag lacks the definition of /mavros/px4flow/raw/optical_flow_rad; left out"
    assert lacking in log.notes


def test_what_a_damaged_bag_says_over_several_lines_is_said_in_one(bags, tmp_path):
    """SQLite quotes the schema that it cannot read; a topic may be named anything."""
    import sqlite3

    file = tmp_path / "old.db3"
    content = bags["sqlite file"].read_bytes()
    schema = content.index(b"CREATE TABLE topics")
    place = content.index(b"NOT NULL", schema)
    file.write_bytes(content[:place] + b'"OT NULL' + content[place + 8 :])
    with pytest.raises(InputError, match=r"no readable ROS 2 bag \(malformed database schema") as told:
        open_log(file)
    assert "\n" not in str(told.value)
    named = content[:place].replace(b"tabletopicstopics", b"table\xdfopicstopics")  # what SQLite quotes is no text
    file.write_bytes(named + b'"OT NULL' + content[place + 8 :])
    with pytest.raises(InputError, match=r"no readable ROS 2 bag \(") as told:
        open_log(file)
    assert "\n" not in str(told.value)
    file.write_bytes(content)
    with sqlite3.connect(file) as base:
        base.execute("UPDATE topics SET name = 'two' || char(10) || 'lines', type = 'a' || char(10) || 'b'")
    with pytest.raises(InputError, match=r"the bag holds two lines \(a b\)$"):
        open_log(file)


def test_a_value_that_sqlite_has_no_memory_for_is_damage(bags, monkeypatch):
    """Seed 401440: SQLite's module raises MemoryError, without a word, of a length that a flipped bit has made."""

    def raises(base, size):
        raise MemoryError

    monkeypatch.setattr("flownav.logs.ros.bag._channels", raises)
    with pytest.raises(InputError, match=r"no readable ROS 2 bag \(MemoryError\); give another log$"):
        open_log(bags["sqlite file"])


def test_what_holds_nothing_known_is_said_with_what_it_holds(tmp_path):
    made = BagMaker()
    made.put(0.0, "/chatter", "std_msgs/msg/String", made.kind("std_msgs/msg/String")(data="hello"))
    bag = made.write(tmp_path / "bag")
    with pytest.raises(InputError, match=r"no message of a known type; the bag holds /chatter \(std_msgs/msg/String\)"):
        open_log(bag)


@pytest.mark.parametrize(("name", "head", "kind"), [
    ("a.raw", b"\x89MCAP0\r\n", "ros"), ("a.raw", b"SQLite format 3\0", "ros"), ("a.raw", b"#ROSBAG V2.0\n", "ros"),
    ("a.mcap", b"", "ros"), ("a.db3", b"", "ros"),
])  # fmt: skip
def test_bags_are_known_by_their_first_bytes(tmp_path, name, head, kind):
    (tmp_path / name).write_bytes(head)
    assert log_kind(tmp_path / name) == kind


def test_a_ros_1_bag_is_read_too(flown, folder, tmp_path):
    ros_flight({name: flown.tables[name] for name in flown.tables}).write_ros_1(tmp_path / "flight.bag")
    log, known = open_log(tmp_path / "flight.bag"), open_log(folder)
    for sensor in (Sensor.IMU, Sensor.ATTITUDE, Sensor.RANGE, Sensor.GPS_POSITION):
        assert largest_difference(log, known, sensor) < CLOSE[sensor], sensor


# -- flownav's own MCAP ------------------------------------------------------------------------------------
def replayed(log: Log):
    return replay(log, ReplayOptions(), NavigatorSettingsFile())


def test_a_replayed_record_exported_as_mcap_reads_as_its_streams(folder, tmp_path):
    first = replayed(open_flight(folder))
    export(to_record(first, {"duration_s": 0.0}, []), "mcap", tmp_path / "flight.mcap")
    log = open_log(tmp_path / "flight.mcap")  # a replay's record keeps no inertial readings
    known = open_flight(folder)
    for sensor in (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY, Sensor.FLOW_RATE, Sensor.RANGE, Sensor.BARO):
        assert np.array_equal(log.streams[sensor].t_s, known.streams[sensor].t_s)
        assert np.array_equal(log.streams[sensor].value, known.streams[sensor].value)
    assert log.origin_deg_m == known.origin_deg_m
    assert log.notes == ("a record of flownav's, exported as MCAP",)


def test_a_flown_record_exported_as_mcap_is_fed_again_bit_for_bit(tmp_path):
    record = record_of(queue_of_flight())
    record.add("estimate", {"t_s": np.arange(2.0), **{f"pos_{axis}_m": np.zeros(2) for axis in "ned"}})
    record.save(tmp_path / "a.fnr")
    export(record, "mcap", tmp_path / "a.mcap")
    one, other = open_flight(tmp_path / "a.fnr"), open_flight(tmp_path / "a.mcap")
    for first, second in zip(one.fed, other.fed, strict=True):
        assert first.equipment == second.equipment
        for a, b in zip(first.queue, second.queue, strict=True):
            assert np.array_equal(a, b, equal_nan=True)


def test_a_damaged_export_gives_its_streams_or_one_line(folder, tmp_path):
    export(to_record(replayed(open_flight(folder)), {"duration_s": 0.0}, []), "mcap", tmp_path / "flight.mcap")
    content = (tmp_path / "flight.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(content[: 2 * len(content) // 3])
    log = open_log(tmp_path / "cut.mcap")
    assert 0 < len(log.streams[Sensor.RANGE]) <= 400
    assert any("damaged" in note for note in log.notes)
    with pytest.raises(InputError, match="is a record of flownav's, of one flow sensor"):
        open_log(tmp_path / "flight.mcap", flow_instance=0)


def test_a_topic_is_asked_for_on_the_command_line_and_from_python(flown, tmp_path, folder):
    from typer.testing import CliRunner

    import flownav
    from flownav.cli import app

    bag = doubled(flown).write(tmp_path / "bag")
    run = CliRunner()
    done = run.invoke(app, ["info", str(bag), "--json", "--topic", "imu=/camera/imu"])
    assert "imu is /camera/imu, as asked" in json.loads(done.stdout)["notes"]
    record = flownav.replay(bag, topics={"flow": "/second/flow"})
    assert len(record.tables["flow_rate"]["t_s"]) < 200
    for arguments, why in (
        ([str(bag), "--topic", "imu"], "ROLE=TOPIC is needed"),
        ([str(bag), "--topic", "imu=/a", "--topic", "imu=/b"], "is the second for its role"),
        ([str(folder), "--topic", "imu=/a"], "is no ROS bag"),
    ):
        error = run.invoke(app, ["info", *arguments]).exception
        assert isinstance(error, InputError)
        assert why in str(error)


def test_info_says_which_topic_was_taken(flown, tmp_path):
    from typer.testing import CliRunner

    from flownav.cli import app

    bag = doubled(flown).write(tmp_path / "bag")
    done = CliRunner().invoke(app, ["info", str(bag), "--json"])
    assert done.exit_code == 0, done.output
    assert any(note.startswith("imu is /mavros/imu/data") for note in json.loads(done.stdout)["notes"])


def test_set_points_and_battery_of_a_bag(flown, truth, tmp_path):
    made = ros_flight(flown.tables, truth)
    plain = read_ros(made.write(tmp_path / "plain"))
    for t_s, mask, east, north, up in ((1.0, 0, 2.0, 1.0, 3.0), (2.0, 4, 2.5, 1.5, 9.0)):
        still = made.vector(0.0, 0.0, 0.0)
        message = made.kind("mavros_msgs/msg/PositionTarget")(
            header=made.header(t_s), coordinate_frame=1, type_mask=mask, position=made.vector(east, north, up, "Point"),
            velocity=still, acceleration_or_force=still, yaw=0.0, yaw_rate=0.0,
        )  # fmt: skip
        made.put(t_s, "/mavros/setpoint_raw/target_local", "mavros_msgs/msg/PositionTarget", message)
    nan, none = float("nan"), np.zeros(0, np.float32)
    battery = made.kind("sensor_msgs/msg/BatteryState")(
        header=made.header(3.0), voltage=15.5, temperature=nan, current=-8.0, charge=nan, capacity=nan,
        design_capacity=nan, percentage=0.75, power_supply_status=0, power_supply_health=0, power_supply_technology=0,
        present=True, cell_voltage=none, cell_temperature=none, location="", serial_number="",
    )  # fmt: skip
    made.put(3.0, "/mavros/battery", "sensor_msgs/msg/BatteryState", battery)
    log = read_ros(made.write(tmp_path / "told"))
    (place,) = log.setpoints
    assert np.diff(place["t_s"]) == pytest.approx(1.0)
    assert place["pos_n_m"].tolist() == [1.0, 1.5]
    assert place["pos_e_m"].tolist() == [2.0, 2.5]
    assert place["pos_d_m"][0] == -3.0
    assert np.isnan(place["pos_d_m"][1])
    assert (log.battery["voltage_v"].tolist(), log.battery["current_a"].tolist()) == ([15.5], [8.0])
    assert log.battery["remaining_percent"].tolist() == [75.0]
    assert (plain.setpoints, plain.battery) == ((), None)
    assert log.span_s == plain.span_s
