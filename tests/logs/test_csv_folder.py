"""The CSV folder reader: units and frames, every error message, every counted rejection, and malformed files."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from flownav.core.errors import InputError
from flownav.core.frames import euler_from_quaternion
from flownav.core.measurement import Sensor
from flownav.logs.csv_folder import FILES, read_csv_folder
from places import DOCS
from replay_logs import ORIGIN, log_of_flight, path, write_table

DURATION_S = 30.0


@pytest.fixture(scope="module")
def pristine(tmp_path_factory) -> Path:
    return log_of_flight(DURATION_S).write(tmp_path_factory.mktemp("log") / "flight")


@pytest.fixture
def folder(pristine, tmp_path) -> Path:
    return Path(shutil.copytree(pristine, tmp_path / "flight"))


def rows_of(file: Path) -> list[list[str]]:
    return [line.split(",") for line in file.read_text().splitlines()]


def put(file: Path, rows: list[list[str]]) -> None:
    file.write_text("\n".join(",".join(row) for row in rows) + "\n")


def scale(file: Path, column: str, factor: float, offset: float = 0.0) -> None:
    header, *rows = rows_of(file)
    place = header.index(column)
    for row in rows:
        row[place] = repr(float(row[place]) * factor + offset)
    put(file, [header, *rows])


def complaint(folder: Path) -> str:
    """The reader's one line."""
    with pytest.raises(InputError) as caught:
        read_csv_folder(folder)
    text = str(caught.value)
    assert "\n" not in text
    assert str(folder) in text
    return text


# -- what is read ------------------------------------------------------------------------------------------
def test_every_sensor_arrives_in_si_units_and_the_conventions_of_measurement(folder):
    log = read_csv_folder(folder)
    assert {s.name for s in log.streams} == {
        "ATTITUDE", "IMU", "GPS_VELOCITY", "GPS_POSITION", "FLOW_RATE", "RANGE", "BARO", "MAG"
    }  # fmt: skip
    header, first, *_ = rows_of(folder / "attitude.csv")
    angles = [float(first[header.index(name)]) for name in ("roll_rad", "pitch_rad", "yaw_rad")]
    assert euler_from_quaternion(*log.streams[Sensor.ATTITUDE].value[0]) == pytest.approx(angles, abs=1e-12)
    header, first, *_ = rows_of(folder / "mag.csv")
    mgauss = [float(first[header.index(f"mag_{axis}_mgauss")]) for axis in "xyz"]
    assert log.streams[Sensor.MAG].value[0] == pytest.approx(np.array(mgauss) / 1000.0)
    assert log.span_s == pytest.approx((0.0, DURATION_S - 0.02))
    assert set(log.inputs) == {
        f"{name}.csv" for name in FILES if name not in ("px4flow", "landed", "truth", "heading_truth")
    }
    assert all(len(digest) == 64 for digest in log.inputs.values())


def test_gps_becomes_local_north_east_down_about_the_first_fix(folder):
    log = read_csv_folder(folder)
    gps = log.streams[Sensor.GPS_POSITION]
    assert log.origin_deg_m == pytest.approx(ORIGIN, abs=1e-6)
    assert np.abs(gps.value - path(gps.t_s - 0.22)).max() < 1e-3


def test_extra_columns_another_order_and_windows_line_ends_change_nothing(folder):
    before = read_csv_folder(folder)
    for file in folder.iterdir():
        header, *rows = rows_of(file)
        turned = [[*reversed(row), "note"] for row in ([*header], *rows)]
        turned[0][-1] = "remark"
        file.write_bytes(b"\xef\xbb\xbf" + "\r\n".join(",".join(row) for row in turned).encode() + b"\r\n")
    after = read_csv_folder(folder)
    for sensor, stream in before.streams.items():
        assert np.array_equal(stream.value, after.streams[sensor].value), sensor
        assert after.streams[sensor].rejected == {}


def test_sensors_that_are_not_there_are_left_out(folder):
    for name in ("baro", "mag", "imu", "gps"):
        (folder / f"{name}.csv").unlink()
    log = read_csv_folder(folder)
    assert set(log.streams) == {Sensor.ATTITUDE, Sensor.FLOW_RATE, Sensor.RANGE}
    assert log.origin_deg_m is None


def test_flow_without_a_gyro_is_flow_with_gyro_unknown(folder):
    header, *rows = rows_of(folder / "flow.csv")
    keep = [header.index(name) for name in ("t_s", "flow_x_rad_s", "flow_y_rad_s", "quality")]
    put(folder / "flow.csv", [[row[i] for i in keep] for row in (header, *rows)])
    assert np.isnan(read_csv_folder(folder).streams[Sensor.FLOW_RATE].value[:, 2:]).all()


def test_what_says_that_it_stands_and_where_its_nose_truly_was(folder):
    write_table(folder / "landed.csv", {"t_s": np.array([0.0, 3.0, 29.0]), "landed": np.array([1.0, 0.0, 1.0])})
    t_s = np.arange(0.0, 29.0, 0.5)
    write_table(folder / "heading_truth.csv", {"t_s": t_s, "yaw_rad": 0.3 * t_s})
    log = read_csv_folder(folder)
    assert log.streams[Sensor.LANDED].value.tolist() == [[1.0], [0.0], [1.0]]  # however seldom, it is stated in seconds
    assert log.heading_truth["yaw_rad"] == pytest.approx(0.3 * t_s)
    assert {"landed.csv", "heading_truth.csv"} <= set(log.inputs)


def test_a_heading_in_degrees_and_a_landed_of_two_are_refused(folder):
    t_s = np.arange(0.0, 29.0, 0.5)
    write_table(folder / "heading_truth.csv", {"t_s": t_s, "yaw_rad": 90.0 + t_s})
    assert "heading_truth.csv: yaw_rad" in complaint(folder)
    (folder / "heading_truth.csv").unlink()
    write_table(folder / "landed.csv", {"t_s": t_s, "landed": 2.0 + 0.0 * t_s})
    assert "landed.csv: landed" in complaint(folder)


def test_px4flow_gives_velocity_and_range_and_yields_to_flow(folder, tmp_path):
    t_s = np.arange(0, DURATION_S, 0.02)
    columns = {"t_s": t_s, "flow_comp_m_x_m_s": 0 * t_s + 0.5, "flow_comp_m_y_m_s": 0 * t_s - 0.25,
               "ground_distance_m": 0 * t_s + 1.5, "flow_x_dpx": 0 * t_s, "quality": 0 * t_s + 200}  # fmt: skip
    write_table(folder / "px4flow.csv", columns)
    assert Sensor.FLOW_VELOCITY not in read_csv_folder(folder).streams
    (folder / "flow.csv").unlink()
    (folder / "range.csv").unlink()
    log = read_csv_folder(folder)
    velocity = log.streams[Sensor.FLOW_VELOCITY]
    assert velocity.value[0, :2] == pytest.approx([0.5, -0.25])
    assert np.isnan(velocity.value[:, 2]).all()
    assert velocity.quality[0] == 200
    assert log.streams[Sensor.RANGE].value[0, 0] == 1.5


def test_truth_is_carried_along(folder):
    t_s = np.arange(0, DURATION_S, 0.01)
    write_table(folder / "truth.csv", {"t_s": t_s, "x_m": t_s, "y_m": 2 * t_s, "z_m": -t_s})
    truth = read_csv_folder(folder).truth
    assert truth is not None
    assert truth["pos_e_m"] == pytest.approx(2 * t_s)


@pytest.mark.parametrize(("name", "sensor"), [("baro", Sensor.BARO), ("mag", Sensor.MAG)])
def test_a_slow_sensor_written_at_the_imus_rate_is_each_reading_once(folder, name, sensor):
    """A barometer of 25 Hz with 950 rows a second is no 950 independent readings a second."""
    header, *rows = rows_of(folder / f"{name}.csv")
    known = read_csv_folder(folder).streams[sensor]
    times = np.arange(0.0, DURATION_S - 0.1, 0.001)
    last = np.searchsorted(known.t_s, times, side="right") - 1
    put(folder / f"{name}.csv", [header, *([f"{t:.3f}", *rows[k][1:]] for t, k in zip(times, last, strict=True))])
    once = read_csv_folder(folder).streams[sensor]
    assert once.rejected == {"repeated": len(times) - len(once)}
    assert len(once) < 1.05 * len(known)
    assert np.array_equal(once.value[:50], known.value[np.searchsorted(known.t_s, once.t_s[:50], side="right") - 1])


def test_a_receiver_that_never_tells_a_velocity_has_none(folder):
    header, *rows = rows_of(folder / "gps.csv")
    place = header.index("vel_n_m_s")
    put(folder / "gps.csv", [header, *([*row[:place], "nan", "nan", "nan"] for row in rows)])
    streams = read_csv_folder(folder).streams
    assert Sensor.GPS_POSITION in streams
    assert Sensor.GPS_VELOCITY not in streams


def test_a_slow_sensor_that_repeats_itself_at_its_own_rate_stays_as_it_is(folder):
    header, *rows = rows_of(folder / "baro.csv")
    put(folder / "baro.csv", [header, *([row[0], "12.5"] for row in rows)])
    baro = read_csv_folder(folder).streams[Sensor.BARO]
    assert len(baro) == len(rows)
    assert baro.rejected == {}


# -- what cannot be read -----------------------------------------------------------------------------------
def test_no_folder(tmp_path):
    assert "no such folder" in complaint(tmp_path / "absent")


def test_an_empty_folder_names_everything_it_needs(tmp_path):
    text = complaint(tmp_path)
    assert "one of attitude.csv, imu.csv and one of gps.csv, flow.csv, px4flow.csv missing" in text
    assert "range.csv" in text


def test_an_attitude_or_an_imu_is_needed(folder):
    (folder / "attitude.csv").unlink()
    assert Sensor.ATTITUDE not in read_csv_folder(folder).streams
    (folder / "imu.csv").unlink()
    assert "one of attitude.csv, imu.csv missing" in complaint(folder)


def test_without_attitude_the_imus_clock_is_the_common_one(folder):
    (folder / "attitude.csv").unlink()
    header, *rows = rows_of(folder / "range.csv")
    place = header.index("t_s")
    for row in rows:
        row[place] = str(float(row[place]) + 1e5)
    put(folder / "range.csv", [header, *rows])
    said = complaint(folder)
    assert "range.csv covers" in said
    assert "imu.csv" in said


def test_gps_or_flow_is_needed(folder):
    (folder / "gps.csv").unlink()
    (folder / "flow.csv").unlink()
    assert "one of gps.csv, flow.csv, px4flow.csv missing" in complaint(folder)


REQUIRED = [(name, column) for name in ("attitude", "imu", "gps", "flow", "range", "baro", "mag")
            for column in ("t_s", *(c.name for c in FILES[name] if c.required))]  # fmt: skip


@pytest.mark.parametrize(("name", "column"), REQUIRED)
def test_a_missing_column_is_named_with_its_file(folder, name, column):
    header, *rows = rows_of(folder / f"{name}.csv")
    place = header.index(column)
    put(folder / f"{name}.csv", [row[:place] + row[place + 1 :] for row in (header, *rows)])
    text = complaint(folder)
    assert f"{name}.csv: no column {column};" in text


def test_a_column_twice(folder):
    header, *rows = rows_of(folder / "range.csv")
    put(folder / "range.csv", [[*row, row[1]] for row in (header, *rows)])
    assert "range.csv: column range_m stands twice" in complaint(folder)


@pytest.mark.parametrize("content", ["", "\n", "t_s,range_m,valid\n", "t_s,range_m,valid"])
def test_a_file_without_rows(folder, content):
    (folder / "range.csv").write_text(content)
    text = complaint(folder)
    assert "range.csv: no" in text


def test_a_file_that_is_a_folder(folder):
    (folder / "range.csv").unlink()
    (folder / "range.csv").mkdir()
    assert "range.csv: cannot be read" in complaint(folder)


WRONG_UNITS = [
    ("attitude", ("roll_rad", "pitch_rad", "yaw_rad"), 57.29578, "radians"),
    ("range", ("range_m",), 1000.0, "millimetres"),
    ("range", ("range_m",), 100.0, "centimetres"),
    ("gps", ("lat_deg", "lon_deg"), 1e7, "degrees * 1e7"),
    ("gps", ("lat_deg", "lon_deg"), np.pi / 180, "degrees (lat_deg, lon_deg)"),
    ("gps", ("vel_n_m_s", "vel_e_m_s", "vel_d_m_s"), 100.0, "m"),
    ("gps", ("alt_m",), 1000.0, "metres"),
    ("imu", ("accel_x_m_s2", "accel_y_m_s2", "accel_z_m_s2"), 1 / 9.8, "m/s2 are needed (g?"),
    ("imu", ("accel_x_m_s2", "accel_y_m_s2", "accel_z_m_s2"), 1000 / 9.8, "accel"),
    ("imu", ("accel_x_m_s2", "accel_y_m_s2", "accel_z_m_s2"), -1.0, "about down"),
    ("imu", ("gyro_x_rad_s", "gyro_y_rad_s", "gyro_z_rad_s"), 57.29578, "rad/s are needed"),
    ("imu", ("gyro_y_rad_s",), -1.0, "turns against the attitude"),
    ("flow", ("gyro_x_rad_s", "gyro_y_rad_s"), 57.29578, "rad/s are needed"),
    ("flow", ("gyro_y_rad_s",), -1.0, "turns against the attitude"),
    ("flow", ("quality",), 2.0, "0 (no data) to 255"),
    ("baro", ("alt_m",), 1e4, "pascal"),
    ("mag", ("mag_x_mgauss", "mag_y_mgauss", "mag_z_mgauss"), 1e-3, "gauss?"),
    ("mag", ("mag_x_mgauss", "mag_y_mgauss", "mag_z_mgauss"), 100.0, "nanotesla"),
    ("range", ("t_s",), 1e6, "seconds are needed"),
]


@pytest.mark.parametrize(("name", "columns", "factor", "said"), WRONG_UNITS)
def test_a_unit_that_cannot_be_is_refused(folder, name, columns, factor, said):
    for column in columns:
        scale(folder / f"{name}.csv", column, factor)
    assert said in complaint(folder)


@pytest.mark.parametrize("duration_s", [30.0, 60.0, 90.0, 120.0])
def test_smooth_flight_whose_flow_runs_in_step_with_its_rotation_is_read(tmp_path, duration_s):
    assert read_csv_folder(log_of_flight(duration_s).write(tmp_path / "log")).streams


def test_flow_in_degrees_is_found(data_folder, tmp_path):
    for name in ("attitude", "range", "gps"):
        lines = (data_folder / "quad-px4flow-outdoor" / f"{name}.csv").read_text().splitlines()
        (tmp_path / f"{name}.csv").write_text("\n".join(lines[:3000]))
    lines = (data_folder / "quad-px4flow-outdoor" / "flow.csv").read_text().splitlines()[:1001]
    rows = np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])
    rows[:, 1:3] = np.clip(rows[:, 1:3] * 180.0 / np.pi, -69.0, 69.0)  # past the limits on single values
    text = [lines[0], *(",".join(f"{cell:.9g}" for cell in row) for row in rows)]
    (tmp_path / "flow.csv").write_text("\n".join(text))
    with pytest.raises(InputError, match=r"flow_. is \d+ times as fast"):
        read_csv_folder(tmp_path)


def test_degrees_in_a_calm_hover_are_found_by_the_accelerometer(tmp_path):
    log = log_of_flight(4.0)  # on the ground and level
    for name in ("roll_rad", "pitch_rad"):
        log.tables["attitude"][name] = 0 * log.tables["attitude"]["t_s"] + 1.2
    log.tables["attitude"]["yaw_rad"] *= 0
    assert "about down" in complaint(log.write(tmp_path / "hover"))


def test_files_of_different_clocks(folder):
    scale(folder / "flow.csv", "t_s", 1.0, 5000.0)
    assert "all files need one clock" in complaint(folder)


def test_a_clock_that_restarts_names_the_row(folder):
    header, *rows = rows_of(folder / "imu.csv")
    put(folder / "imu.csv", [header, *rows, *rows])
    text = complaint(folder)
    assert "the clock runs back from 29.98 s to 0 s" in text
    assert f"at row {len(rows) + 2};" in text


def test_no_fix_at_all(folder):
    scale(folder / "gps.csv", "fix_type", 0.0, 1.0)
    assert "no row has a 3-D fix" in complaint(folder)


def test_a_clock_that_leaps_by_years_in_the_middle_is_refused(folder):
    for file in folder.iterdir():
        header, *rows = rows_of(file)
        for row in rows[len(rows) // 2 :]:
            row[header.index("t_s")] = repr(float(row[header.index("t_s")]) + 1e9)
        put(file, [header, *rows])
    assert "covers 0 to 1e+09 s, more than two days; the clock has leapt" in complaint(folder)


# -- what is thrown away and counted -----------------------------------------------------------------------
BAD_CELLS = [
    ("range", "range_m", "nan", Sensor.RANGE, "not_finite"),
    ("range", "range_m", "", Sensor.RANGE, "not_finite"),
    ("range", "range_m", "inf", Sensor.RANGE, "not_finite"),
    ("range", "range_m", "oops", Sensor.RANGE, "not_finite"),
    ("range", "range_m", "4000", Sensor.RANGE, "out_of_range"),
    ("range", "valid", "0", Sensor.RANGE, "invalid"),
    ("range", "t_s", "nan", Sensor.RANGE, "not_finite"),
    ("range", "t_s", "-3", Sensor.RANGE, "out_of_order"),
    ("range", "t_s", "25", Sensor.RANGE, "out_of_order"),
    ("attitude", "pitch_rad", "3", Sensor.ATTITUDE, "out_of_range"),
    ("imu", "accel_z_m_s2", "-9800", Sensor.IMU, "out_of_range"),
    ("gps", "lat_deg", "470000000", Sensor.GPS_POSITION, "out_of_range"),
    ("gps", "lat_deg", "nan", Sensor.GPS_VELOCITY, "not_finite"),
    ("gps", "fix_type", "2", Sensor.GPS_POSITION, "no_fix"),
    ("flow", "flow_x_rad_s", "nan", Sensor.FLOW_RATE, "not_finite"),
    ("flow", "quality", "300", Sensor.FLOW_RATE, "out_of_range"),
    ("baro", "alt_m", "1e9", Sensor.BARO, "out_of_range"),
]


def test_a_receiver_that_wakes_up_at_zero_zero_does_not_move_the_origin(folder):
    header, *rows = rows_of(folder / "gps.csv")
    for row in rows[:3]:
        row[header.index("lat_deg")] = row[header.index("lon_deg")] = "0"
    put(folder / "gps.csv", [header, *rows])
    log = read_csv_folder(folder)
    assert log.streams[Sensor.GPS_POSITION].rejected == {"out_of_range": 3}
    assert log.origin_deg_m == pytest.approx(ORIGIN, abs=1e-6)


@pytest.mark.parametrize(("name", "column", "cell", "sensor", "reason"), BAD_CELLS)
def test_a_bad_cell_costs_its_row_and_is_counted(folder, name, column, cell, sensor, reason):
    header, *rows = rows_of(folder / f"{name}.csv")
    rows[40][header.index(column)] = cell
    put(folder / f"{name}.csv", [header, *rows])
    stream = read_csv_folder(folder).streams[sensor]
    assert stream.rejected == {reason: 1}
    assert len(stream) == len(rows) - 1


def test_rows_of_another_length_are_counted(folder):
    header, *rows = rows_of(folder / "range.csv")
    rows[10] = rows[10][:1]
    rows[20] = [*rows[20], "1", "2"]
    put(folder / "range.csv", [header, *rows])
    stream = read_csv_folder(folder).streams[Sensor.RANGE]
    assert stream.rejected == {"malformed_row": 2}


def test_rows_of_another_length_that_are_no_text_are_counted(folder):
    with (folder / "range.csv").open("ab") as file:
        file.write(b"29.97,\xff\xfe,1,9\n29.98,\xff,1\n")
    stream = read_csv_folder(folder).streams[Sensor.RANGE]
    assert stream.rejected == {"malformed_row": 1, "not_finite": 1}


def test_a_row_cut_off_at_the_end_is_counted(folder):
    text = (folder / "range.csv").read_text().rstrip("\n")
    (folder / "range.csv").write_text(text[: text.rindex(",")])
    assert read_csv_folder(folder).streams[Sensor.RANGE].rejected == {"malformed_row": 1}


def test_duplicates_go_and_two_readings_at_one_time_stay(folder):
    header, *rows = rows_of(folder / "range.csv")
    other = [rows[30][0], "7.5", "1"]
    put(folder / "range.csv", [header, *rows[:21], rows[20], *rows[21:31], other, *rows[31:]])
    stream = read_csv_folder(folder).streams[Sensor.RANGE]
    assert stream.rejected == {"duplicate": 1}
    assert len(stream) == len(rows) + 1


def test_a_last_row_from_another_day_is_counted(folder):
    with (folder / "range.csv").open("a") as file:
        file.write("1000000,2.5,1\n")
    log = read_csv_folder(folder)
    assert log.streams[Sensor.RANGE].rejected == {"clock_jump": 1}
    assert log.span_s[1] < DURATION_S


def test_shuffled_rows_are_sorted_and_said_so(folder):
    before = read_csv_folder(folder)
    random = np.random.default_rng(1)
    for file in folder.iterdir():
        header, *rows = rows_of(file)
        put(file, [header, *(rows[i] for i in random.permutation(len(rows)))])
    after = read_csv_folder(folder)
    for sensor, stream in before.streams.items():
        assert np.array_equal(stream.t_s, after.streams[sensor].t_s)
        assert np.array_equal(stream.value, after.streams[sensor].value)
    assert len(after.notes) == len(list(folder.iterdir()))
    assert "sorted by t_s" in after.notes[0]


CELLS = ["t_s", "range_m", "1", "-2", "nan", "1e400", "x", '"', "", "0x1f"]


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    name=st.sampled_from(["attitude", "gps", "flow", "range", "imu", "baro", "mag"]),
    content=st.one_of(
        st.binary(max_size=400),
        st.text(max_size=300).map(lambda text: text.encode("utf-8", "replace")),
        st.lists(st.lists(st.sampled_from(CELLS), max_size=5), max_size=12).map(
            lambda rows: "\n".join(",".join(row) for row in rows).encode()
        ),
    ),
)
def test_malformed_content_is_never_another_error(folder, name, content):
    kept = (folder / f"{name}.csv").read_bytes()
    try:
        (folder / f"{name}.csv").write_bytes(content)
        with pytest.raises(InputError) as caught:
            read_csv_folder(folder)
        assert "\n" not in str(caught.value)
    finally:
        (folder / f"{name}.csv").write_bytes(kept)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_mutilated_rows_are_counted_or_refused_in_one_line(folder, data):
    name = data.draw(st.sampled_from(["attitude", "gps", "flow", "range", "imu"]))
    kept = (folder / f"{name}.csv").read_text()
    lines = kept.splitlines()
    for _ in range(data.draw(st.integers(1, 5))):
        line = data.draw(st.integers(1, len(lines) - 1))
        start = data.draw(st.integers(0, len(lines[line])))
        lines[line] = lines[line][:start] + data.draw(st.text(max_size=6)) + lines[line][start + 2 :]
    try:
        (folder / f"{name}.csv").write_text("\n".join(lines), encoding="utf-8", errors="replace")
        log = read_csv_folder(folder)
        assert all(np.all(np.diff(stream.t_s) >= 0) for stream in log.streams.values())
    except InputError as error:
        said = str(error)
    else:
        said = ""
    finally:
        (folder / f"{name}.csv").write_text(kept)
    assert "\n" not in said


def test_the_documentation_names_every_file_and_column():
    page = (DOCS / "reference" / "csv-folder.md").read_text(encoding="utf-8")
    for name, columns in FILES.items():
        assert f"`{name}.csv`" in page
        for column in columns:
            assert f"`{column.name}`" in page or column.name.replace("_y_", "_x_") in page, column.name


# -- real logs ---------------------------------------------------------------------------------------------
def test_the_outdoor_log_reads_whole(data_folder):
    log = read_csv_folder(data_folder / "quad-px4flow-outdoor")
    assert {sensor.name: len(stream) for sensor, stream in log.streams.items()} == {
        "ATTITUDE": 48494, "IMU": 40520, "GPS_VELOCITY": 4235, "GPS_POSITION": 4235, "FLOW_RATE": 8051,
        "RANGE": 48493, "BARO": 8117, "MAG": 8115,
    }  # fmt: skip
    assert np.abs(log.streams[Sensor.GPS_POSITION].value[:, :2]).max() < 100


def test_the_motion_capture_log_reads_with_its_truth(data_folder):
    log = read_csv_folder(data_folder / "quad-px4flow-mocap")
    assert set(log.streams) == {Sensor.ATTITUDE, Sensor.IMU, Sensor.FLOW_VELOCITY, Sensor.RANGE}
    assert log.truth is not None
    assert len(log.truth["t_s"]) == 5967
