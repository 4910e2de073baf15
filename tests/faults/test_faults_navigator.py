"""The navigator itself with failing sensors: in what order it is fed, what it refuses, and how far a fault moves it."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from command import run
from flownav.campaigns.faults.catalogue import faults_named
from flownav.campaigns.faults.inject import WAIT_S, Restamped, arrival_of, as_fed, stamped_ahead
from flownav.campaigns.faults.table import fault_table, flight_at, window_start
from flownav.cli.faults import navigator
from flownav.core.errors import InputError
from flownav.core.measurement import Sensor, Stream

NAMED = (
    "gps_loss", "gps_jump", "gps_clock", "flow_garbage", "flow_clock", "range_stuck_descent", "range_floor",
    "nan_bursts", "duplicates", "out_of_order", "silence",
)  # fmt: skip


def stream(sensor, t_s, delay_s=0.0):
    width = {Sensor.RANGE: 1, Sensor.IMU: 6}[sensor]
    return Stream.of(sensor, np.array(t_s, float), np.zeros((len(t_s), width)), delay_s=delay_s)


# -- in what order -------------------------------------------------------------------------------------------
def test_a_reading_arrives_with_its_stamp_but_not_before_those_ahead_of_it():
    np.testing.assert_array_equal(arrival_of(stream(Sensor.IMU, [0.4, 0.2, 0.3, 0.5])), [0.4, 0.4, 0.4, 0.5])


@given(st.permutations(range(6)))
def test_any_order_within_the_wait_is_mended(order):
    times = 1.0 + 0.01 * np.array(order)
    fed = as_fed({Sensor.IMU: stream(Sensor.IMU, [0.0, *times, 2.0])})
    np.testing.assert_array_equal(fed.t_s, np.sort(fed.t_s))
    assert len(fed.t_s) == 8


def test_what_comes_after_its_turn_is_fed_late_and_not_lost():
    late = 3.0 * WAIT_S
    fed = as_fed({Sensor.IMU: stream(Sensor.IMU, [0.0, late, 0.01, 2.0])})
    np.testing.assert_array_equal(fed.t_s, [0.0, 0.01, late, 2.0])
    other = as_fed(
        {
            Sensor.IMU: stream(Sensor.IMU, np.arange(0.0, 2.0, 0.1)),
            Sensor.RANGE: stream(Sensor.RANGE, [1.0, 0.3]),  # arrives at 1.0, when the filter is at 1.0 - WAIT_S
        }
    )
    place = int(np.flatnonzero((other.sensor == Sensor.RANGE) & (other.t_s == 0.3))[0])
    assert other.t_s[:place].max() <= 1.0 - WAIT_S + 1e-9


def test_streams_are_merged_by_the_instants_that_they_describe():
    fed = as_fed({Sensor.IMU: stream(Sensor.IMU, [0.0, 0.1, 0.2]), Sensor.RANGE: stream(Sensor.RANGE, [0.25], 0.2)})
    np.testing.assert_allclose(fed.t_s, [0.0, 0.05, 0.1, 0.2])


def test_a_stamp_ahead_of_the_clock_is_not_fed():
    honest = stream(Sensor.RANGE, [0.0, 1.0, 2.0])
    jumped = Restamped(**vars(honest) | {"t_s": np.array([0.0, 2.0, 2.0])}, arrival_s=honest.t_s)
    np.testing.assert_array_equal(stamped_ahead(jumped), [False, True, False])
    fed = as_fed({Sensor.RANGE: jumped, Sensor.IMU: stream(Sensor.IMU, [0.0])})
    np.testing.assert_array_equal(fed.row[fed.sensor == Sensor.RANGE], [0, 2])


def test_nothing_at_all_is_an_empty_queue():
    assert len(as_fed({Sensor.IMU: stream(Sensor.IMU, [])}).t_s) == 0


# -- the landing filter with faults --------------------------------------------------------------------------
@pytest.fixture(scope="module")
def rows():
    table = fault_table(navigator(), faults_named(NAMED), (1.5,), (2.0,), seed=1)
    return {row.fault: row.scores for row in table}


def test_no_fault_of_these_gives_nan_or_a_silent_error(rows):
    for name, scores in rows.items():
        assert scores.max_error_m is not None, name
        assert scores.unflagged_above_3_sigma_s <= (5.0 if name == "silence" else 1.0), name
        assert scores.touchdown_error_m is not None, name


def test_the_pose_on_the_pad_is_heard_so_that_errors_are_not_those_of_the_gps_frame(rows):
    """Before its navigator has levelled and started it would be lost: then the touchdown's error was 5.5 m."""
    assert rows["none"].touchdown_error_m < 1.0


def test_a_gps_jump_moves_the_estimate_no_further_than_no_gps_at_all(rows):
    jump = rows["gps_jump"]
    assert 0.0 <= jump.detected_after_s <= 0.25  # a fix comes five times a second
    assert jump.wrongly_fused == 0
    assert jump.moved_m <= rows["gps_loss"].moved_m + 0.02
    assert jump.touchdown_error_m == pytest.approx(rows["none"].touchdown_error_m, abs=0.02)


def test_a_stuck_range_is_noticed_in_descent(rows):
    assert rows["range_stuck_descent"].detected_after_s <= 2.0


@pytest.mark.parametrize("name", ["gps_clock", "flow_clock"])
def test_a_clock_that_jumps_ahead_silences_its_sensor_and_no_other(rows, name):
    silent = {"gps_clock": "gps_loss"}.get(name)
    assert rows[name].wrongly_fused == 0
    if silent:
        assert rows[name].max_error_m == pytest.approx(rows[silent].max_error_m, abs=1e-3)


def test_the_floor_of_the_sonar_and_nan_are_never_taken_in(rows):
    assert rows["range_floor"].wrongly_fused == rows["nan_bursts"].wrongly_fused == 0


def test_duplicates_and_disorder_change_little(rows):
    assert rows["duplicates"].moved_m < 1e-6
    assert rows["duplicates"].wrongly_fused == 0
    assert rows["out_of_order"].moved_m < 0.4


def test_garbage_is_flagged_while_it_lasts():
    log, t0_s = flight_at(1.5, 2.0, 1), window_start(1.5)
    run = navigator()(faults_named(["flow_garbage"])[0].inject(log.streams, t0_s, t0_s + 2.0, 1))
    assert any(t0_s < flag.t0_s < t0_s + 1.0 and flag.source == "flow" for flag in run.flags)


def test_after_silence_the_estimate_knows_that_it_was_lost():
    """A gap of the IMU is coasted: one reading after it is not taken for all of it."""
    log, t0_s = flight_at(1.5, 5.0, 1), window_start(1.5)
    run = navigator()(faults_named(["silence"])[0].inject(log.streams, t0_s, t0_s + 5.0, 1))
    after = int(np.flatnonzero(run.t_s > t0_s + 4.5)[0])
    assert (run.sigma_ned_m[after, :2] > 5.0).all()
    assert np.isfinite(run.position_ned_m).all()
    assert [event for event in run.events if event.kind == "lost" and event.source == "imu"]


def test_without_a_start_the_navigator_says_so():
    log = flight_at(0.5, 1.0, 1)
    with pytest.raises(InputError, match="the navigator never started"):
        navigator()({Sensor.RANGE: log.streams[Sensor.RANGE]})


def test_the_command_prints_one_object_and_ends_with_0(tmp_path):
    done = run("faults", "--faults", "gps_jump", "--heights", "0.5", "--durations", "1", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert [row["fault"] for row in json.loads(done.stdout)["rows"]] == ["none, pad camera", "none", "gps_jump"]
