"""The figures of a fault on results made by hand, each with its answer known beforehand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flownav.campaigns.faults.navigator import Event, Flag, Navigated, Offers
from flownav.campaigns.faults.score import course_of, detected_after, score, touchdown_error, unflagged, wrongly_fused
from flownav.core.measurement import Sensor, Stream

T_S = np.arange(0.0, 20.0, 0.02)
GPS = (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY)
WINDOW = (5.0, 7.0)


def truth(on_ground: np.ndarray | None = None) -> dict[str, np.ndarray]:
    """A straight flight north at 1 m/s, 2 m up; on the ground from 15 s on."""
    return {
        "t_s": T_S,
        "pos_n_m": T_S,
        "pos_e_m": np.zeros(len(T_S)),
        "pos_d_m": np.full(len(T_S), -2.0),
        "on_ground": (T_S >= 15.0).astype(float) if on_ground is None else on_ground,
    }


def offers(rows: list[tuple[float, Sensor, int, bool, str]]) -> Offers:
    t_s, sensor, component, fused, reason = zip(*rows, strict=True) if rows else ([], [], [], [], [])
    return Offers(
        np.array(t_s, float), np.array(sensor, np.int64), np.array(component, np.int64), np.array(fused, bool),
        np.array(reason, str),
    )  # fmt: skip


def navigated(error_ned_m=None, sigma_m: float = 0.1, rows=(), events=(), flags=(), t_s=T_S) -> Navigated:
    """An estimate with this error (n, 3) or (n,) northwards."""
    position = np.column_stack([t_s, np.zeros(len(t_s)), np.full(len(t_s), -2.0)])
    if error_ned_m is not None:
        error = np.asarray(error_ned_m, float)
        position[:, : 3 if error.ndim == 2 else 1] += error if error.ndim == 2 else error[:, None]
    return Navigated(t_s, position, np.full((len(t_s), 3), sigma_m), offers(list(rows)), tuple(events), tuple(flags))


def pulse(t0: float, t1: float, height: float) -> np.ndarray:
    return np.where((t0 - 1e-9 <= T_S) & (t1 - 1e-9 > T_S), height, 0.0)


def scored(run: Navigated, without: Navigated | None = None, sensors=GPS, window=WINDOW, ground=None):
    return score(run, without or navigated(), truth(ground), sensors, window, {}, {})


# -- detected ------------------------------------------------------------------------------------------------
def test_a_first_rejection_of_a_struck_sensor_is_the_detection():
    rows = [
        (4.0, Sensor.GPS_POSITION, 0, False, "innovation_gate"),  # before the window
        (5.2, Sensor.GPS_POSITION, 0, True, "fused"),
        (5.5, Sensor.FLOW_VELOCITY, 0, False, "innovation_gate"),  # another sensor
        (5.8, Sensor.GPS_VELOCITY, 2, False, "innovation_gate"),
        (5.6, Sensor.GPS_POSITION, 1, False, "not_finite"),
    ]
    assert scored(navigated(rows=rows)).detected_after_s == pytest.approx(0.6)


def test_what_the_run_without_the_fault_says_at_the_same_time_is_no_detection():
    usual = [(5.6, Sensor.GPS_POSITION, 0, False, "innovation_gate")]
    late = (6.4, Sensor.GPS_POSITION, 0, False, "innovation_gate")
    without = navigated(rows=usual)
    assert scored(navigated(rows=usual), without).detected_after_s is None
    assert scored(navigated(rows=[*usual, late]), without).detected_after_s == pytest.approx(1.4)
    other_reason = [(5.6, Sensor.GPS_POSITION, 0, False, "no_data")]
    assert scored(navigated(rows=other_reason), without).detected_after_s == pytest.approx(0.6)


@pytest.mark.parametrize(
    ("source", "counts"), [("gps", True), ("gps_velocity", True), ("filter", True), ("flow", False), ("imu", False)]
)
def test_events_and_flags_of_the_sensor_and_of_the_filter_count(source, counts):
    expected = pytest.approx(0.5) if counts else None
    assert scored(navigated(events=[Event(5.5, source, "reset")])).detected_after_s == expected
    assert scored(navigated(flags=[Flag(5.5, 9.0, source, "lost")])).detected_after_s == expected


def test_detection_may_come_after_the_window_and_the_earliest_sign_wins():
    events = [Event(9.0, "gps", "reset"), Event(8.0, "filter", "dead_reckoning")]
    assert scored(navigated(events=events)).detected_after_s == pytest.approx(3.0)
    usual = navigated(events=events[1:])
    assert scored(navigated(events=events), usual).detected_after_s == pytest.approx(4.0)
    assert detected_after(usual, usual, GPS, 5.0) is None


# -- errors --------------------------------------------------------------------------------------------------
def test_the_largest_error_is_that_of_all_three_axes_from_the_window_on():
    error = np.zeros((len(T_S), 3))
    error[T_S < 5.0] = 100.0
    error[400] = (2.0, -3.0, 6.0)
    assert scored(navigated(error)).max_error_m == pytest.approx(7.0)


def test_an_estimate_that_is_no_number_has_no_largest_error_and_is_beyond_3_sigma():
    run = navigated(np.where((T_S >= 6.0 - 1e-9) & (T_S < 9.0 - 1e-9), np.nan, 0.0))
    found = scored(run)
    assert found.max_error_m is None
    assert found.unflagged_above_3_sigma_s == pytest.approx(2.98)
    assert found.recovered_after_s == pytest.approx(2.0)


def test_a_sigma_that_is_no_number_is_beyond_3_sigma():
    run = navigated()
    run = replace(run, sigma_ned_m=np.full((len(T_S), 3), np.nan))
    assert course_of(run, truth()).beyond.all()


def test_the_truth_is_taken_at_the_estimates_own_instants():
    shifted = T_S[5:-5] + 0.007
    assert scored(navigated(t_s=shifted)).max_error_m == pytest.approx(0.0, abs=1e-9)


def test_instants_that_the_truth_does_not_cover_are_left_out():
    beyond = np.arange(-3.0, 30.0, 0.02)
    run = navigated(np.where(beyond > 25.0, 50.0, 0.0), t_s=beyond)
    assert scored(run).max_error_m == pytest.approx(0.0, abs=1e-9)


# -- recovered -----------------------------------------------------------------------------------------------
def test_an_error_that_goes_back_recovers_when_it_does():
    assert scored(navigated(pulse(5.0, 9.0, 1.0))).recovered_after_s == pytest.approx(2.0)
    assert scored(navigated()).recovered_after_s == pytest.approx(0.0)
    assert scored(navigated(pulse(5.0, 6.0, 1.0))).recovered_after_s == pytest.approx(0.0)
    assert scored(navigated(pulse(5.0, 99.0, 1.0))).recovered_after_s is None


def test_an_error_that_only_passes_through_has_not_recovered():
    error = pulse(5.0, 8.0, 1.0) + pulse(8.5, 10.0, -1.0)
    assert scored(navigated(error)).recovered_after_s == pytest.approx(3.0)
    stays = pulse(5.0, 8.0, 1.0) + pulse(9.5, 10.0, -1.0)
    assert scored(navigated(stays)).recovered_after_s == pytest.approx(1.0)


def test_recovered_is_as_good_as_without_the_fault():
    usual = np.full(len(T_S), 0.15)
    assert scored(navigated(usual + pulse(5.0, 9.0, 0.09)), navigated(usual)).recovered_after_s == pytest.approx(0.0)
    assert scored(navigated(usual + pulse(5.0, 9.0, 0.11)), navigated(usual)).recovered_after_s == pytest.approx(2.0)


def test_recovered_is_within_3_sigma_unless_it_never_was():
    error = pulse(5.0, 9.0, 0.05)  # 5 of its sigmas, yet below 0.1 m
    assert scored(navigated(error, 0.01), navigated(sigma_m=0.01)).recovered_after_s == pytest.approx(2.0)
    overconfident = navigated(np.full(len(T_S), 0.04), 0.01)
    assert scored(navigated(error, 0.01), overconfident).recovered_after_s == pytest.approx(0.0)


# -- touchdown and silence -----------------------------------------------------------------------------------
def test_the_touchdown_error_is_horizontal_and_at_the_first_contact():
    error = np.zeros((len(T_S), 3))
    error[:, 0], error[:, 1], error[:, 2] = 0.3, 0.1 * (T_S - 11.0), 9.0
    assert scored(navigated(error)).touchdown_error_m == pytest.approx(0.5)


def test_the_touchdown_of_a_flight_that_starts_on_the_ground_is_the_second_time_it_stands_there():
    on_ground = ((T_S < 3.0) | (T_S >= 12.0)).astype(float)
    error = np.where(T_S < 10.0, 5.0, 0.25)
    assert scored(navigated(error), ground=on_ground).touchdown_error_m == pytest.approx(0.25)


def test_a_flight_without_a_contact_has_no_touchdown():
    assert scored(navigated(), ground=np.zeros(len(T_S))).touchdown_error_m is None
    early = T_S[:500]
    assert touchdown_error(course_of(navigated(t_s=early), truth()), truth()) is None


def test_the_longest_stretch_beyond_3_sigma_that_nothing_announces():
    error = pulse(1.0, 4.0, 1.0) + pulse(6.0, 7.0, 0.31) + pulse(8.0, 10.0, -0.5) + pulse(11.0, 15.0, 0.29)
    assert scored(navigated(error)).unflagged_above_3_sigma_s == pytest.approx(1.98)
    said = [Event(8.5, "flow", "reset")]
    assert scored(navigated(error, events=said)).unflagged_above_3_sigma_s == pytest.approx(0.98)


@pytest.mark.parametrize(
    ("flag", "expected"),
    [
        (Flag(7.5, 8.1, "filter", "dead_reckoning"), 0.0),  # stands as it begins
        (Flag(8.6, 99.0, "filter", "dead_reckoning"), 0.6),  # comes later
        (Flag(7.0, 8.0, "filter", "dead_reckoning"), 1.98),  # taken down before
        (Flag(12.0, np.inf, "filter", "dead_reckoning"), 1.98),
    ],
)
def test_a_flag_announces_while_it_stands(flag, expected):
    run = navigated(pulse(8.0, 10.0, 1.0), flags=[flag])
    assert unflagged(run, course_of(run, truth()), 5.0) == pytest.approx(expected)


# -- wrongly fused -------------------------------------------------------------------------------------------
def ranges(values: list[float], t_s=None) -> Stream:
    return Stream.of(Sensor.RANGE, np.arange(len(values)) * 0.1 if t_s is None else np.array(t_s), np.array(values))


def fused(stream: Stream, which: list[int], components: int = 1) -> Navigated:
    """A run that fuses some rows of a stream and rejects the others."""
    return navigated(
        rows=[
            (t_s + 1e-7, stream.sensor, c, k in which, "" if k in which else "innovation_gate")
            for k, t_s in enumerate(stream.t_s)
            for c in range(components)
        ]
    )


def test_only_altered_readings_count_and_only_where_they_were_fused():
    clean, faulty = ranges([1, 2, 3, 4]), ranges([1, 9, 9, 4])
    assert wrongly_fused(fused(faulty, [0, 1, 2, 3]), clean, faulty) == 2
    assert wrongly_fused(fused(faulty, [0, 2, 3]), clean, faulty) == 1
    assert wrongly_fused(fused(faulty, [0, 3]), clean, faulty) == 0
    assert wrongly_fused(fused(clean, [0, 1, 2, 3]), clean, clean) == 0


def test_another_sensors_readings_do_not_count():
    clean, faulty = ranges([1, 2]), ranges([1, 9])
    other = navigated(rows=[(0.1, Sensor.BARO, 0, True, "")])
    assert wrongly_fused(other, clean, faulty) == 0


def test_a_reading_of_three_components_is_one_reading():
    t_s = np.arange(3) * 0.2
    clean = Stream.of(Sensor.GPS_POSITION, t_s, np.zeros((3, 3)))
    faulty = Stream.of(Sensor.GPS_POSITION, t_s, np.array([[0.0] * 3, [20.0, 0.0, 0.0], [20.0, 0.0, 0.0]]))
    assert wrongly_fused(fused(faulty, [0, 1], components=3), clean, faulty) == 1


def test_a_duplicate_is_wrong_when_it_is_fused_besides_its_original():
    clean, faulty = ranges([1, 2]), ranges([1, 2, 2], [0.0, 0.1, 0.1])
    assert wrongly_fused(fused(faulty, [0, 1]), clean, faulty) == 0
    assert wrongly_fused(fused(faulty, [0, 1, 2]), clean, faulty) == 1


def test_readings_that_only_changed_places_are_right():
    clean, faulty = ranges([1, 2, 3]), ranges([3, 2, 1], [0.2, 0.1, 0.0])
    assert wrongly_fused(fused(faulty, [0, 1, 2]), clean, faulty) == 0


def test_a_reading_with_the_wrong_time_is_wrong_and_a_nan_is_the_same_nan():
    clean, faulty = ranges([1, np.nan, 3]), ranges([1, np.nan, 3], [0.0, 0.1, 1.2])
    assert wrongly_fused(fused(faulty, [0, 1, 2]), clean, faulty) == 1


def test_the_score_adds_up_the_struck_sensors_that_the_log_has():
    clean = {Sensor.RANGE: ranges([1, 2]), Sensor.BARO: Stream.of(Sensor.BARO, np.array([0.0]), np.array([1.0]))}
    faulty = {Sensor.RANGE: ranges([8, 9]), Sensor.BARO: Stream.of(Sensor.BARO, np.array([0.0]), np.array([5.0]))}
    run = navigated(
        rows=[(t, s, 0, True, "") for t, s in ((0.0, Sensor.RANGE), (0.1, Sensor.RANGE), (0.0, Sensor.BARO))]
    )
    usual = navigated()
    both = (Sensor.RANGE, Sensor.BARO, Sensor.YAW)
    assert score(run, usual, truth(), both, WINDOW, clean, faulty).wrongly_fused == 3
    assert score(run, usual, truth(), both[:1], WINDOW, clean, faulty).wrongly_fused == 2
