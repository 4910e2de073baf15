"""A reference beside what the log's own sensors saw: mirrored, turned, stuck, late, upside down, or right."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.core.errors import InputError
from flownav.core.measurement import Sensor, Stream
from flownav.logs.heights_alike import heights_alike, upside_down
from flownav.logs.open_log import open_log
from places import data_root
from replay_logs import log_of_flight

FLIGHT_S = 60.0


def logged(tmp_path, spoil=lambda t_s, place, yaw: (t_s, place, yaw), without=(), heading=True, noise_m=0.001):
    """A made flight whose truth, with its heading, somebody has spoiled, read."""
    made = log_of_flight(FLIGHT_S)
    every = slice(1000, 1000 + round(1000.0 * FLIGHT_S), 20)
    t_s = made.t_s[every]
    place = made.position[every] + np.random.default_rng(3).normal(0.0, noise_m, (len(t_s), 3))
    t_s, place, yaw = spoil(t_s, place, 0.05 * t_s + 0.3)
    for name in without:
        del made.tables[name]
    made.tables["truth"] = {"t_s": t_s, **dict(zip(("x_m", "y_m", "z_m"), place.T, strict=True))}
    if heading:
        made.tables["heading_truth"] = {"t_s": t_s, "yaw_rad": yaw}
    return open_log(made.write(tmp_path / "log"))


def said(log):
    return [note for note in log.notes if note.startswith("truth.csv")]


def mirrored(t_s, place, yaw):
    return t_s, place * [1.0, -1.0, 1.0], yaw


def turned_by(angle_rad):
    def spoil(t_s, place, yaw):
        return t_s, place, yaw + angle_rad

    return spoil


def late_by(late_s):
    def spoil(t_s, place, yaw):
        return t_s + late_s, place, yaw

    return spoil


def stuck(t_s, place, yaw):
    held = place.copy()
    held[t_s > 0.5 * FLIGHT_S] = place[np.searchsorted(t_s, 0.5 * FLIGHT_S)]
    return t_s, held, yaw


def in_a_frame(frame_rad):
    def spoil(t_s, place, yaw):
        turn = np.array([[np.cos(frame_rad), -np.sin(frame_rad)], [np.sin(frame_rad), np.cos(frame_rad)]])
        return t_s + 0.1, np.column_stack([place[:, :2] @ turn.T, place[:, 2]]), yaw + frame_rad

    return spoil


NO_GPS, ONLY_FLOW, ONLY_GPS = ("gps",), ("gps", "imu"), ("flow", "imu")
ANY = [(), NO_GPS, ONLY_FLOW, ONLY_GPS]


@pytest.mark.parametrize("without", ANY)
@pytest.mark.parametrize("frame_rad", [0.0, 2.0])
def test_a_right_reference_in_any_frame_is_not_accused(tmp_path, without, frame_rad):
    log = logged(tmp_path, in_a_frame(frame_rad), without)
    assert said(log) == []
    assert log.heading_truth is not None


@pytest.mark.parametrize(
    ("first", "others", "without"),
    [("GPS", "the accelerometer and flow", ()), ("the accelerometer", "flow", NO_GPS)],
)
@pytest.mark.parametrize("axis", [0, 1])
def test_a_path_that_two_sensors_show_to_be_mirrored_is_left_out(tmp_path, first, others, without, axis):
    def spoil(t_s, place, yaw):
        return t_s, place * np.where(np.arange(3) == axis, -1.0, 1.0), yaw

    log = logged(tmp_path, spoil, without)
    assert log.truth is None
    assert log.heading_truth is None
    (note,) = said(log)
    assert note.startswith(f"truth.csv is left out: its path is mirrored, as {first} (R² ")
    assert note.endswith(f" as it is) and {others} show; give east to the right of north")


@pytest.mark.parametrize("without", ANY)
@pytest.mark.parametrize("across_m", [0.0, 0.1, 0.3])
def test_a_flight_to_and_fro_along_a_line_has_no_hand(tmp_path, without, across_m):
    """Its mirror image is a turned line: what is left of either is the sensors' small errors."""

    def along(t):
        return np.column_stack([3.8 * np.sin(1.6 * t), across_m * np.sin(0.3 * t), -2.0 + 0.1 * np.sin(0.3 * t)])

    made = beside_its_truth(log_of_flight(FLIGHT_S, along=along))
    for name in without:
        del made.tables[name]
    log = open_log(made.write(tmp_path / "log"))
    assert log.truth is not None
    assert not [note for note in said(log) if "mirrored" in note]


@pytest.mark.parametrize(("by", "without"), [("GPS", ONLY_GPS), ("flow", ONLY_FLOW)])
def test_what_one_sensor_alone_shows_to_be_mirrored_is_named_and_kept(tmp_path, by, without):
    log = logged(tmp_path, mirrored, without)
    assert log.truth is not None
    (note,) = said(log)
    assert note.startswith(f"truth.csv: its path is mirrored against {by} (R² ")
    assert note.endswith(" as it is): an axis of one of them has the wrong sign")


def test_an_axis_of_the_flow_with_the_wrong_sign_is_no_fault_of_the_reference(tmp_path):
    made = log_of_flight(FLIGHT_S)
    del made.tables["gps"]
    for name in ("flow_x_rad_s", "gyro_x_rad_s"):
        made.tables["flow"][name] = -made.tables["flow"][name]
    log = open_log(beside_its_truth(made).write(tmp_path / "log"))
    assert said(log) == []
    assert log.truth is not None


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_heading_that_two_sensors_contradict_is_left_out(tmp_path, way):
    log = logged(tmp_path, turned_by(way * np.radians(70.0)), NO_GPS)
    assert log.truth is not None
    assert log.heading_truth is None
    (note,) = said(log)
    start, _, rest = note.partition(" points ")
    assert start == (
        "truth.csv: its path and its heading contradict each other: what the accelerometer and flow saw, turned by the "
        "heading,"
    )
    assert float(rest.split("°")[0]) == pytest.approx(70.0, abs=3.0)
    assert rest.endswith(f"° to the {'right' if way > 0.0 else 'left'} of the path; its heading is left out")


def test_a_heading_is_judged_with_the_lag_taken_out(tmp_path):
    """A path of 0.7 s before a heading of now would turn with the vehicle."""

    def spoil(t_s, place, yaw):
        return t_s + 0.7, place, yaw + np.radians(40.0)

    contradicted, late = said(logged(tmp_path, spoil, NO_GPS))
    angle_deg = float(contradicted.split(" points ")[1].split("°")[0])
    assert angle_deg == pytest.approx(40.0, abs=2.0)
    assert float(late.split(" ")[2]) == pytest.approx(0.7, abs=0.1)


def test_a_gyro_with_the_wrong_sign_leaves_nothing_out(tmp_path):
    """Without an attitude it turns what the accelerometer felt and what the flow saw."""

    def laps(t):
        return np.column_stack(
            [5.0 * np.sin(0.5 * t) + 2.0 * np.sin(0.13 * t), 5.0 - 5.0 * np.cos(0.5 * t), -3.0 + 0.0 * t]
        )

    made = beside_its_truth(log_of_flight(FLIGHT_S, yaw_rate=0.5, along=laps))
    for name in ("gps", "attitude", "heading_truth"):
        del made.tables[name]
    made.tables["imu"]["gyro_z_rad_s"] = -made.tables["imu"]["gyro_z_rad_s"]
    log = open_log(made.write(tmp_path / "log"))
    assert log.truth is not None
    assert said(log)[0].startswith("truth.csv: its path is mirrored against the accelerometer and flow (R² ")


@pytest.mark.parametrize("without", ANY)
def test_a_steady_circle_shows_no_lag(tmp_path, without):
    """A late circle is a turned circle."""
    made = beside_its_truth(log_of_flight(FLIGHT_S, along=_circling))
    noise = np.random.default_rng(5)
    for axis in "xy":
        accel = made.tables["imu"][f"accel_{axis}_m_s2"]
        made.tables["imu"][f"accel_{axis}_m_s2"] = accel + noise.normal(0.0, 0.3, len(accel))
    for name in without:
        del made.tables[name]
    assert not [note for note in said(open_log(made.write(tmp_path / "log"))) if "late" in note or "early" in note]


def test_two_sensors_against_gps_leave_nothing_out(tmp_path):
    """A vehicle whose IMU and flow are mirrored themselves."""
    made = log_of_flight(FLIGHT_S)
    for table, names in {
        "imu": ("accel_y_m_s2", "gyro_x_rad_s", "gyro_z_rad_s"), "flow": ("flow_x_rad_s", "gyro_x_rad_s")
    }.items():  # fmt: skip
        for name in names:
            made.tables[table][name] = -made.tables[table][name]
    del made.tables["attitude"]
    log = open_log(beside_its_truth(made).write(tmp_path / "log"))
    assert log.truth is not None
    assert said(log)[0].startswith("truth.csv: its path is mirrored against the accelerometer and flow (R² ")


def test_a_heading_that_the_flow_alone_contradicts_is_named_and_kept(tmp_path):
    log = logged(tmp_path, turned_by(np.radians(70.0)), ONLY_FLOW)
    assert log.heading_truth is not None
    assert said(log) == [
        "truth.csv: its path and its heading contradict each other, or flow is mounted turned: what it saw, turned by "
        "the heading, points 70° to the right of the path"
    ]


def test_a_flow_sensor_that_is_mounted_turned_is_no_fault_of_the_heading(tmp_path):
    made = log_of_flight(FLIGHT_S)
    del made.tables["gps"]
    flow = made.tables["flow"]
    for kind in ("flow", "gyro"):
        x, y = flow[f"{kind}_x_rad_s"], flow[f"{kind}_y_rad_s"]
        flow |= {f"{kind}_x_rad_s": y, f"{kind}_y_rad_s": -x}
    log = open_log(beside_its_truth(made).write(tmp_path / "log"))
    assert said(log) == []
    assert log.heading_truth is not None


def beside_its_truth(made):
    """The made flight with its own path and heading as the reference."""
    every = slice(1000, 1000 + round(1000.0 * FLIGHT_S), 20)
    place = dict(zip(("x_m", "y_m", "z_m"), made.position[every].T, strict=True))
    made.tables["truth"] = {"t_s": made.t_s[every], **place}
    made.tables["heading_truth"] = {"t_s": made.t_s[every], "yaw_rad": 0.05 * made.t_s[every] + 0.3}
    return made


@pytest.mark.parametrize(("by", "without"), [("GPS", ()), ("flow", NO_GPS)])
def test_rows_in_which_a_tracker_is_stuck_are_left_out(tmp_path, by, without):
    log = logged(tmp_path, stuck, without)
    assert log.truth["t_s"][-1] == pytest.approx(0.5 * FLIGHT_S, abs=0.05)
    (note,) = said(log)
    assert note.startswith("truth.csv stands still from 30.0")
    assert note.endswith(f" while {by} shows that the vehicle goes on; these rows are left out")


def test_a_vehicle_that_circles_about_the_place_has_gone_on_too(tmp_path):
    made = beside_its_truth(log_of_flight(FLIGHT_S, along=_circling))
    truth = made.tables["truth"]
    held = truth["t_s"] > 30.0
    for name in ("x_m", "y_m", "z_m"):
        truth[name] = np.where(held, truth[name][np.searchsorted(truth["t_s"], 30.0)], truth[name])
    log = open_log(made.write(tmp_path / "log"))
    assert "truth.csv stands still from 30.0" in said(log)[0]
    assert log.truth["t_s"][-1] == pytest.approx(30.0, abs=0.1)


def _circling(t):
    """1.2 m about a place: never 3 m from where it was, which a bias of 0.1 m/s makes in 30 s."""
    return np.column_stack([1.2 * np.cos(0.8 * t), 1.2 * np.sin(0.8 * t), -2.0 - 0.01 * t])


def test_a_path_of_one_place_alone_is_kept(tmp_path):
    """Whether its tracker was blind, or the vehicle held while its flow drifted, nothing shows."""

    def spoil(t_s, place, yaw):
        return t_s, np.tile(place[0], (len(t_s), 1)), yaw

    log = logged(tmp_path, spoil, NO_GPS)
    assert said(log) == []
    assert len(log.truth["t_s"]) > 2000


@pytest.mark.parametrize("turning", [False, True])
def test_a_vehicle_that_stands_is_not_stuck(tmp_path, turning):
    """Until it takes off after 30 s; the flow sensor drifts meanwhile, and a gyro with a bias counts."""
    made = log_of_flight(FLIGHT_S, along=_standing_first)
    del made.tables["gps"]
    drift = np.where(made.tables["flow"]["t_s"] < 30.0, 2.0, 0.0)
    made.tables["flow"]["flow_x_rad_s"] = made.tables["flow"]["flow_x_rad_s"] + drift
    if turning:
        made.tables["imu"]["gyro_y_rad_s"] = made.tables["imu"]["gyro_y_rad_s"] + 0.01
    assert said(open_log(beside_its_truth(made).write(tmp_path / "log"))) == []


def _standing_first(t):
    going = np.clip(t - 30.0, 0.0, None)
    return np.column_stack([3.0 - 3.0 * np.cos(0.5 * going), 2.0 * np.sin(0.4 * going) ** 2, -0.1 * going])


@pytest.mark.parametrize(("by", "without"), [("the accelerometer", ()), ("flow", ONLY_FLOW), ("GPS", ONLY_GPS)])
@pytest.mark.parametrize("late_s", [0.7, -0.9])
def test_a_reference_that_is_late_is_named_with_its_lag(tmp_path, by, without, late_s):
    log = logged(tmp_path, late_by(late_s), without)
    (note,) = said(log)
    way = "late" if late_s > 0.0 else "early"
    lag_s = float(note.removeprefix("truth.csv is ").split(" s ")[0])
    assert f" s {way} against {by} (R² " in note
    assert lag_s == pytest.approx(abs(late_s), abs=0.3 if by == "GPS" else 0.1)  # a receiver's own delay is in it


def test_a_flow_that_is_late_is_no_fault_of_the_reference(tmp_path):
    made = log_of_flight(FLIGHT_S)
    del made.tables["gps"]
    made.tables["flow"]["t_s"] = made.tables["flow"]["t_s"] + 0.6
    assert said(open_log(beside_its_truth(made).write(tmp_path / "log"))) == []


# -- up and down ---------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("without", [(), ("range",)])
def test_a_barometer_in_rotor_wash_does_not_hide_what_is_upside_down(tmp_path, without):
    """It agrees clearly with neither sign, and was the only one that was asked."""

    def spoil(t_s, place, yaw):
        return t_s, place * [1.0, 1.0, -1.0], yaw

    made = log_of_flight(FLIGHT_S)
    every = slice(1000, 1000 + round(1000.0 * FLIGHT_S), 20)
    wash = np.random.default_rng(4).normal(0.0, 2.0, len(made.tables["baro"]["t_s"]))
    made.tables["baro"]["alt_m"] = made.tables["baro"]["alt_m"] + wash
    for name in without:
        del made.tables[name]
    place = dict(zip(("x_m", "y_m", "z_m"), made.position[every].T, strict=True))
    made.tables["truth"] = {"t_s": made.t_s[every], **place}
    right = open_log(made.write(tmp_path / "right"))
    assert right.truth is not None
    likeness = dict(heights_alike(right.truth["t_s"], -right.truth["pos_d_m"], right.streams))
    assert abs(likeness["baro"]) < 0.7
    made.tables["truth"]["z_m"] = -place["z_m"]
    wrong = open_log(made.write(tmp_path / "wrong"))
    assert wrong.truth is None
    assert "its down points up, as the accelerometer " in said(wrong)[0]


def test_a_barometer_that_drifts_does_not_turn_a_range_upside_down():
    """A slow climb of 0.8 m while the pressure rises by what 2.4 m are."""

    def along(t):
        return np.column_stack([5 * np.sin(0.3 * t), 4 * np.sin(0.21 * t), -1.0 - 0.8 / (1 + np.exp(-(t - 60) / 6))])

    made = log_of_flight(120.0, along=along)
    t_s, up = made.t_s, -made.position[:, 2]
    truth = {"t_s": t_s, "pos_n_m": made.position[:, 0], "pos_e_m": made.position[:, 1], "pos_d_m": -up}
    baro = Stream.of(Sensor.BARO, t_s[::100], (up - 0.02 * t_s)[::100, None])
    distance = Stream.of(Sensor.RANGE, t_s[::50], up[::50, None])
    assert upside_down(truth, {Sensor.BARO: baro, Sensor.RANGE: distance}) == ""
    turned = truth | {"pos_d_m": up}
    assert upside_down(turned, {Sensor.RANGE: distance}) == "range"


def test_a_range_over_a_slope_is_outvoted_by_the_accelerometer():
    made = log_of_flight(FLIGHT_S)
    t_s, up = made.t_s, -made.position[:, 2]
    truth = {"t_s": t_s, "pos_n_m": made.position[:, 0], "pos_e_m": made.position[:, 1], "pos_d_m": -up}
    imu = made.tables["imu"]
    names = [f"{kind}_{axis}_{unit}" for kind, unit in (("gyro", "rad_s"), ("accel", "m_s2")) for axis in "xyz"]
    streams = {
        Sensor.RANGE: Stream.of(Sensor.RANGE, t_s[::50], 30.0 - 2.0 * up[::50, None]),
        Sensor.IMU: Stream.of(Sensor.IMU, imu["t_s"], np.column_stack([imu[name] for name in names])),
    }
    assert upside_down(truth, {Sensor.RANGE: streams[Sensor.RANGE]}) == "range"
    assert upside_down(truth, streams) == ""


# -- real flights --------------------------------------------------------------------------------------------------
REAL = ("indoor-made/*", "crazyflie-util/*", "crazyflie-util/raw/*", "quad-px4flow-mocap", "px4-voxl-indoor/*.ulg",
        "dataflash/*.bin", "mavlink/*.tlog", "ardupilot-live/*/from_vehicle.tlog")  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("pattern", REAL)
def test_no_real_reference_is_accused(pattern):
    """Motion capture, visual odometry and simulators' truths, of which each is right."""
    paths = [path for path in sorted(data_root().glob(pattern)) if path.suffix not in (".md", ".py")]
    if not paths:
        pytest.skip(f"{data_root()} has no {pattern}")
    for path in paths:
        try:
            log = open_log(path)
        except InputError:  # a recorded link without a sensor
            continue
        words = ("mirrored", "contradict", "stands still", " late ", " early ", "points up")
        assert not [
            note for note in log.notes if note.startswith(log.truth_name) and any(map(note.__contains__, words))
        ]
