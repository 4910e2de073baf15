"""Invariances of scores: a shift, a turn and other flights next to it change none."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flownav.core.frames import quaternion_from_euler, rotation_from_quaternion, turned_about_down, within_half_turn
from flownav.core.measurement import Sensor, Stream
from flownav.report.series import Track, difference
from flownav.scoring.errors import ErrorSums, error_statistics, statistics_of, with_error
from flownav.scoring.path import Path, References, autopilot_errors, path_scores
from flownav.scoring.percentiles import percentile_with_interval, share_with_interval
from flownav.scoring.recorded import at_instants
from flownav.scoring.reference import Motion, align, difference_at, drift_of, outage_error, velocity_of

T_S = np.arange(0.0, 60.0, 0.25)


def walk(seed: int, size: float = 1.0) -> np.ndarray:
    return size * np.cumsum(np.random.default_rng(seed).normal(size=(len(T_S), 3)), axis=0)


def turned(vectors: np.ndarray, angle: float) -> np.ndarray:
    c, s = math.cos(angle), math.sin(angle)
    return vectors @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def table(t_s: np.ndarray, position: np.ndarray) -> dict[str, np.ndarray]:
    return {"t_s": t_s, **dict(zip(("pos_n_m", "pos_e_m", "pos_d_m"), position.T, strict=True))}


@pytest.mark.parametrize("shift_s", [0.0, 1024.0, -65536.0])
def test_scores_do_not_hang_on_the_zero_of_time(shift_s):
    truth, estimate = walk(1), walk(1) + walk(2, 0.1)
    fixes = truth + np.random.default_rng(3).normal(size=truth.shape)

    def scored(shift_s: float):
        t_s = T_S + shift_s
        known = References(
            fixes=(t_s + 0.125, fixes), speeds=(t_s, np.gradient(truth, 0.25, axis=0)), gps_delay_s=0.125,
            outages_s=((20.0 + shift_s, 40.0 + shift_s),), truth=table(t_s, truth), truth_name="mocap",
        )  # fmt: skip
        found = path_scores({"vel_n_m_s": estimate[:, 0], "vel_e_m_s": estimate[:, 1], **table(t_s, estimate)}, known)
        (outage,) = found.pop("outages")
        truth_row = found.pop("truth")
        numbers = [value for value in (*truth_row.values(), *found.values()) if isinstance(value, float)]
        drift = drift_of(Motion(t_s, estimate, t_s[:0], t_s[:0]), Motion(t_s, truth, t_s[:0], t_s[:0]))
        return [
            *numbers,
            outage["horizontal_rms_m"],
            outage["horizontal_max_m"],
            *drift.horizontal_m,
            *drift.vertical_m,
        ]

    assert scored(shift_s) == pytest.approx(scored(0.0), rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("angle", [0.5 * math.pi, -2.4])
def test_a_path_and_its_truth_turned_alike_are_as_far_apart(angle):
    truth, estimate, none = walk(1), walk(1) + walk(2, 0.1), T_S[:0]
    heading = np.unwrap(0.05 * T_S)

    def found(turn: float):
        ours, theirs = turned(estimate, turn), turned(truth, turn)
        outage = outage_error(T_S, ours[:, :2], T_S, theirs[:, :2], 0.0, 20.0, 40.0)
        drift = drift_of(Motion(T_S, ours, T_S, heading + turn), Motion(T_S, theirs, T_S, heading + turn))
        bare = drift_of(Motion(T_S, ours, none, none), Motion(T_S, theirs, none, none))
        return [outage.horizontal_rms_m, outage.horizontal_max_m, *drift.horizontal_m, *bare.horizontal_m]

    assert found(angle) == pytest.approx(found(0.0), rel=1e-6, abs=1e-6)
    alone = drift_of(Motion(T_S, turned(estimate, angle), none, none), Motion(T_S, truth, none, none))
    both = drift_of(Motion(T_S, estimate, none, none), Motion(T_S, truth, none, none))
    assert alone.horizontal_m == pytest.approx(both.horizontal_m, rel=1e-6, abs=1e-6)  # the truth is laid on it
    assert align(turned(truth, angle) + 5.0, truth).yaw_rad == pytest.approx(angle)


def test_in_other_units_errors_are_the_same_errors():
    truth, estimate = walk(1), walk(1) + walk(2, 0.1)
    metres, feet = (
        outage_error(T_S, k * estimate[:, :2], T_S, k * truth[:, :2], 0.0, 20.0, 40.0).horizontal_rms_m
        for k in (1.0, 3.28)
    )
    assert feet == pytest.approx(3.28 * metres)


def test_a_flight_scores_the_same_alone_and_among_others_to_the_bit():
    rng = np.random.default_rng(5)
    estimate, truth = rng.normal(size=(2, 80, 6, 9))
    counted = (rng.random((80, 9)) < 0.7).astype(float)
    counted[:, 3] = 0.0  # one of which nothing counts
    together = error_statistics(estimate, truth, counted)
    for lane in range(9):
        pick = slice(lane, lane + 1)
        alone = error_statistics(estimate[:, :, pick].copy(), truth[:, :, pick].copy(), counted[:, pick].copy())
        np.testing.assert_array_equal(alone[0], together[lane])
    assert np.isnan(together[3]).all()


def test_sums_of_errors_have_the_moments_of_the_errors_in_any_order():
    errors = np.random.default_rng(6).normal(3.0, 0.5, 200)
    for order in (errors, errors[::-1], np.sort(errors)):
        sums = ErrorSums(0.0, 0.0, 0.0, 0.0, 0.0)
        for count, error in enumerate(order, 1):
            sums = with_error(sums, float(error), float(count))
        expected = (errors.mean(), errors.std(), math.sqrt(np.mean(errors**2)), abs(errors).max())
        assert statistics_of(sums, 200.0) == pytest.approx(expected)


def test_the_order_of_flights_and_a_mirror_change_no_percentile():
    values = np.random.default_rng(7).normal(size=101)
    for share in (0.05, 0.5, 0.9):
        found = percentile_with_interval(values, share)
        assert percentile_with_interval(values[::-1], share) == found
        assert found[1] <= found[0] <= found[2]
        assert percentile_with_interval(10.0 * values + 3.0, share)[0] == pytest.approx(10.0 * found[0] + 3.0)
    for count in (0, 3, 50, 100):
        share, low, high = share_with_interval(count, 100)
        other, other_low, other_high = share_with_interval(100 - count, 100)
        assert (other, other_low, other_high) == pytest.approx((1.0 - share, 1.0 - high, 1.0 - low), abs=1e-12)


def test_beyond_its_time_an_estimate_says_nothing_and_a_path_s_end_has_its_slope():
    reference = np.array([[0.0], [1.0], [2.0], [3.0]])
    found = difference_at(np.array([1.0, 2.0]), np.array([[5.0], [5.0]]), np.arange(4.0), reference)
    assert found[:, 0].tolist() == [4.0, 3.0]
    t_s = np.sort(np.random.default_rng(1).uniform(0.0, 5.0, 60))
    straight = np.outer(t_s, [1.0, -2.0, 0.5]) + 7.0
    assert velocity_of(t_s, straight) == pytest.approx(np.tile([1.0, -2.0, 0.5], (60, 1)))


def test_nothing_is_wrong_with_a_path_that_is_the_truth():
    truth = walk(1)
    known = References(fixes=(T_S, truth), outages_s=((20.0, 40.0),), truth=table(T_S, truth))
    found = path_scores(table(T_S, truth), known)
    assert found["outages"][0]["horizontal_max_m"] == pytest.approx(0.0, abs=1e-9)
    assert found["truth"]["horizontal_max_m"] == pytest.approx(0.0, abs=1e-9)
    assert found["truth"]["vertical_rms_m"] == pytest.approx(0.0, abs=1e-9)
    assert isinstance(Path(T_S, truth, truth[:, :2]), Path)


def test_an_estimate_is_not_held_beyond_its_own_time():
    """Neither where a flight is scored again nor where a report draws the difference: there it says nothing."""
    table_ = {"t_s": np.array([2.0, 4.0]), "pos_n_m": np.array([1.0, 3.0]), "pos_e_m": np.array([0.0, -1.0])}
    found = at_instants(table_, ("pos_n_m", "pos_e_m", "pos_d_m"), np.array([1.9, 2.0, 3.0, 4.0, 4.1]))
    assert np.isnan(found[[0, 4]]).all()
    assert np.isnan(found[:, 2]).all()  # it has no height
    assert found[1:4, :2].tolist() == [[1.0, 0.0], [2.0, -0.5], [3.0, -1.0]]
    same = at_instants(table_, ("pos_n_m",), np.array([2.0, 4.0]))
    assert same[:, 0].tolist() == [1.0, 3.0]
    apart = difference(Track(np.array([1.0, 3.0, 5.0]), np.ones((3, 1))), Track(np.array([2.0, 4.0]), np.zeros((2, 1))))
    assert apart.t_s.tolist() == [3.0]


@pytest.mark.parametrize(("angle", "shift_s"), [(0.0, 1024.0), (0.5 * math.pi, 0.0), (-2.4, 65536.0)])
def test_an_autopilot_errs_as_much_in_its_own_frame_and_at_any_time(angle, shift_s):
    """Its truth is turned and shifted onto it, whichever way its north is; of GPS the mean difference is taken out."""
    truth, said = walk(1), walk(1) + walk(2, 0.1)
    q = np.array([quaternion_from_euler(0.0, 0.0, 0.02 * k) for k in range(len(T_S))])
    velocity = np.array([np.reshape(rotation_from_quaternion(*each), (3, 3)).T @ v
                         for each, v in zip(q, np.gradient(said, 0.25, axis=0), strict=True)])  # fmt: skip

    def errs(angle: float, shift_s: float):
        turn = np.array([turned_about_down(tuple(each), angle) for each in q])
        named = dict(zip(("qw", "qx", "qy", "qz"), turn.T, strict=True))
        named |= dict(zip(("vel_u_m_s", "vel_v_m_s", "vel_w_m_s"), velocity.T, strict=True))
        own = table(T_S + shift_s, turned(said, angle) + np.array([9.0, -4.0, 2.0])) | named
        by_truth = autopilot_errors(own, table(T_S + shift_s, truth), {})
        fixes = Stream.of(Sensor.GPS_POSITION, T_S + shift_s + 0.25, turned(truth, angle), delay_s=0.25)
        by_gps = autopilot_errors(own, None, {Sensor.GPS_POSITION: fixes})
        numbers = ("horizontal_rms_m", "horizontal_max_m", "vertical_rms_m", "velocity_rms_m_s")
        return [by_truth[name] for name in numbers] + [by_gps[name] for name in numbers[:3]], by_truth["yaw_rad"]

    (before, yaw), (after, turned_yaw) = errs(0.0, 0.0), errs(angle, shift_s)
    assert after == pytest.approx(before, rel=1e-6)
    assert within_half_turn(turned_yaw - yaw - angle) == pytest.approx(0.0, abs=1e-6)


def test_a_heading_at_the_seam_of_its_turn_is_a_heading():
    """Headings as they are written, within half a turn, seldom, and about south at take-off."""
    truth, estimate, seldom = walk(1), walk(1) + walk(2, 0.1), T_S[::8] + 0.0625
    heading = math.pi - 0.3 + 0.15 * seldom  # past half a turn within the first seconds
    wrapped = (heading + math.pi) % (2.0 * math.pi) - math.pi
    flight = (1.1, 55.0)  # between the readings on either side of the seam
    found = [
        drift_of(Motion(T_S, estimate, seldom, ours), Motion(T_S, truth, seldom, heading), flight).horizontal_m
        for ours in (heading, wrapped)
    ]
    assert found[1] == pytest.approx(found[0], rel=1e-6, abs=1e-6)
