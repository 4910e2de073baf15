"""A reference that is not one path in one frame: strays and leaps are named with their times, and taken back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flownav.core.measurement import Sensor, Stream
from flownav.core.record import POSITION_NED
from flownav.logs import open_log as opening
from flownav.logs.heights_alike import upside_down
from flownav.logs.open_log import open_log
from flownav.logs.references import examined, of_one_origin
from replay_logs import log_of_flight

T_S = np.arange(0.0, 40.0, 0.1)
PATH = np.column_stack([10.0 * np.sin(0.3 * T_S), 4.0 * T_S, -1.0 - 0.1 * T_S])


def table(position, t_s=T_S):
    return {"t_s": t_s} | dict(zip(POSITION_NED, position.T, strict=True))


def path_of(truth):
    return np.column_stack([truth[name] for name in POSITION_NED])


def changed(rows, by):
    position = PATH.copy()
    position[rows] += by
    return position


def test_a_reference_that_is_whole_is_left_alone():
    truth = table(PATH)
    assert examined(truth, "x") == (truth, ())


@pytest.mark.parametrize("by", [3e38, np.nan, 5e4, -30.0])
@pytest.mark.parametrize("row", [0, 200, len(T_S) - 1])
def test_a_row_that_cannot_be_is_left_out_and_named_with_its_time(by, row):
    truth, notes = examined(table(changed(row, by)), "truth.csv")
    assert np.array_equal(path_of(truth), np.delete(PATH, row, axis=0))
    assert notes == (f"truth.csv: one row is far from the others and left out, at {T_S[row]:.2f} s",)


def test_some_rows_that_are_elsewhere_are_left_out_together():
    truth, notes = examined(table(changed(slice(100, 105), [25.0, 0.0, 0.0])), "the simulator")
    assert len(truth["t_s"]) == len(T_S) - 5
    assert notes[0].endswith("5 rows are far from the others and left out, at 10.00, 10.10, 10.20 s and later")


@pytest.mark.parametrize("rows", [2, 5, 8])
def test_a_leap_that_is_spread_over_rows_is_one_leap(rows):
    by = np.clip((np.arange(len(T_S)) - 199.0) / rows, 0.0, 1.0)[:, None] * [20.0, -10.0, 0.0]
    truth, notes = examined(table(PATH + by), "truth.csv")
    kept = np.isin(T_S, truth["t_s"])
    assert np.array_equal(np.flatnonzero(~kept), np.arange(200, 199 + rows))  # between its two places
    assert np.abs(path_of(truth) - PATH[kept]).max() < 0.1 * rows * 3.5  # of its way meanwhile, 4 m/s, some is known
    said, _, size_m = notes[-1].partition(" m at ")[0].rpartition(" ")
    assert said == "truth.csv leaps by"
    assert float(size_m) == pytest.approx(22.36, abs=0.2 * rows)


def test_a_vehicle_that_flies_fast_does_not_leap():
    fast = np.column_stack([np.cumsum(np.where((T_S > 5.0) & (T_S < 30.0), 3.0, 0.4)), 0.0 * T_S, -1.0 + 0.0 * T_S])
    assert examined(table(fast), "x")[1] == ()


def test_a_leap_is_named_and_what_follows_is_shifted_back():
    truth, notes = examined(table(changed(slice(200, None), [20.0, 10.0, 0.0])), "truth.csv")
    assert np.abs(path_of(truth) - PATH).max() < 0.15  # a tenth of a second at 4 m/s, of which the motion is known
    assert notes == (
        "truth.csv leaps by 22.4 m at 20.00 s; what follows is shifted back, and each piece is scored as it is",
    )


def test_two_leaps_and_a_stray():
    position = changed(slice(100, None), [5.0, 0.0, 0.0])
    position[300:] -= [0.0, 8.0, 0.0]
    position[50] = 1e9
    truth, notes = examined(table(position), "x")
    assert np.abs(path_of(truth) - np.delete(PATH, 50, axis=0)).max() < 0.3
    assert notes[0] == "x: one row is far from the others and left out, at 5.00 s"
    assert notes[1].startswith("x leaps by 4.99 m at 10.00 s, by 8 m at 30.00 s;")


def test_fast_flight_gaps_and_copies_are_no_leaps():
    """60 m/s; an occlusion of 5 s; a tracker of 10 Hz logged at 200 Hz."""
    fast = table(np.column_stack([60.0 * T_S, 0.0 * T_S, 0.0 * T_S]))
    assert not examined(fast, "x")[1]
    hidden = (T_S < 10.0) | (T_S > 15.0)
    assert not examined(table(PATH[hidden], T_S[hidden]), "x")[1]
    often = np.arange(0.0, 40.0, 0.005)
    held = PATH[np.minimum((often * 10.0 + 1e-9).astype(int), len(PATH) - 1)]
    assert not examined(table(held, often), "x")[1]


def test_one_that_leaps_about_is_left_as_it_is_and_said():
    truth = table(PATH + 50.0 * (np.arange(len(T_S)) % 4 < 2)[:, None])
    found, notes = examined(truth, "x")
    assert found is truth
    assert notes[0].startswith("x leaps about (")


@pytest.mark.parametrize("by", [1e9, 3e38, np.inf, np.nan])
def test_half_of_the_rows_that_can_be_no_place_are_left_out(by):
    """They were more than a fifth, so that all stayed and the score was 7e8 m rms."""
    truth, notes = examined(table(changed(slice(200, None), by)), "x")
    assert np.array_equal(path_of(truth), PATH[:200])
    assert notes == ("x: 200 rows are far from the others and left out, at 20.00, 20.10, 20.20 s and later",)
    position = changed(slice(200, None), by)
    position[:200] += 50.0 * (np.arange(200) % 4 < 2)[:, None]
    truth, notes = examined(table(position), "x")
    assert np.array_equal(path_of(truth), position[:200])
    assert notes[0].startswith("x leaps about (")


def test_a_reference_without_any_place_is_left_out(tmp_path):
    truth, notes = examined(table(changed(slice(None), 3e38)), "x")
    assert not len(truth["t_s"])
    assert notes[0].startswith("x: 400 rows are far from")
    made = log_of_flight(10.0)
    every = slice(None, None, 100)
    place = {name: column + 3e4 for name, column in zip(("x_m", "y_m", "z_m"), made.position[every].T, strict=True)}
    made.tables["truth"] = {"t_s": made.t_s[every]} | place
    log = replace(open_log(made.write(tmp_path / "log")), truth=table(changed(slice(None), 3e38)))
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(opening, "_read", lambda *_: log)
        found = open_log(tmp_path / "log")
    assert found.truth is None
    assert found.notes[-1] == ("truth.csv is left out: none of its rows is a place within 100 km; metres are needed")


def test_a_log_says_it_and_has_the_path(tmp_path):
    made = log_of_flight(10.0)
    every = slice(None, None, 100)
    position = made.position[every].copy()
    position[40:] += [20.0, 10.0, 0.0]
    made.tables["truth"] = {"t_s": made.t_s[every]} | dict(zip(("x_m", "y_m", "z_m"), position.T, strict=True))
    log = open_log(made.write(tmp_path / "log"))
    assert np.abs(path_of(log.truth) - made.position[every]).max() < 0.1
    assert any(note.startswith("truth.csv leaps by 22.4 m at ") for note in log.notes)


@pytest.mark.parametrize("left", ["baro", "range"])
def test_a_reference_whose_down_points_up_is_left_out(tmp_path, left):
    made = log_of_flight(20.0)
    every = slice(None, None, 100)
    place = dict(zip(("x_m", "y_m", "z_m"), made.position[every].T, strict=True))
    for name in {"baro", "range"} - {left}:
        del made.tables[name]
    made.tables["truth"] = {"t_s": made.t_s[every]} | place
    assert open_log(made.write(tmp_path / "right")).truth is not None
    made.tables["truth"]["z_m"] = -place["z_m"]
    log = open_log(made.write(tmp_path / "wrong"))
    assert log.truth is None
    shown = f"{left} and the accelerometer show" if left == "baro" else f"the accelerometer and {left} show"
    assert f"truth.csv is left out: its down points up, as {shown}; give it with z downwards" in log.notes


def test_without_a_climb_nothing_is_told_of_down():
    still = table(PATH * [1.0, 1.0, 0.0])
    streams = {Sensor.BARO: Stream.of(Sensor.BARO, T_S, 0.01 * np.random.default_rng(1).normal(size=(len(T_S), 1)))}
    assert upside_down(still, streams) == ""
    assert upside_down(table(PATH), {}) == ""


# -- what is no leap ---------------------------------------------------------------------------------------------
def straight_on(speed_m_s: float, hz: float, noise_m: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """A minute at a constant velocity north, 2 m up."""
    t_s = np.arange(0.0, 60.0, 1.0 / hz)
    path = np.column_stack([speed_m_s * t_s, 0.0 * t_s, 0.0 * t_s - 2.0])
    return t_s, path + np.random.default_rng(1).normal(0.0, 1.0, path.shape) * noise_m


def held_for_3_s() -> tuple[np.ndarray, np.ndarray]:
    """A tracker that loses its target tells the old place until it finds it again."""
    t_s, path = straight_on(2.0, 50.0)
    lost = (t_s > 20.0) & (t_s < 23.0)
    path[lost] = path[lost][0]
    return t_s, path


def one_stamp_is_late() -> tuple[np.ndarray, np.ndarray]:
    t_s, path = straight_on(6.0, 10.0)
    t_s[300] += 0.095
    return t_s, path


def stamps_jitter() -> tuple[np.ndarray, np.ndarray]:
    t_s, path = straight_on(20.0, 5.0)
    return np.sort(t_s + np.random.default_rng(2).normal(0.0, 0.03, len(t_s))), path


def a_spike_settles() -> tuple[np.ndarray, np.ndarray]:
    t_s, path = straight_on(1.0, 50.0)
    path[1000:1006, 0] += [1.0, 0.8, 0.6, 0.4, 0.2, 0.0]
    return t_s, path


@pytest.mark.parametrize("made", [
    held_for_3_s, one_stamp_is_late, stamps_jitter, a_spike_settles, lambda: straight_on(1.0, 100.0, 0.08),
    lambda: straight_on(1.0, 10.0, 0.5),
])  # fmt: skip
def test_a_truth_that_goes_on_where_it_was_going_is_never_shifted(made):
    """Such truths had been moved by 0.6 to 9 m for all that follows."""
    t_s, path = made()
    table, notes = examined({"t_s": t_s} | dict(zip(POSITION_NED, path.T, strict=True)), "truth.csv")
    rows = np.searchsorted(t_s, table["t_s"])
    assert np.abs(np.column_stack([table[name] for name in POSITION_NED]) - path[rows]).max() == 0.0
    assert not any("leaps by" in note for note in notes)


def test_a_barometer_that_saw_the_climb_decides_before_a_range_over_a_slope():
    t_s = np.arange(0.0, 60.0, 0.1)
    up = 0.2 * t_s
    truth = {"t_s": t_s, **dict(zip(POSITION_NED, (t_s, 0.0 * t_s, -up), strict=True))}
    heights = {Sensor.BARO: 100.0 + up, Sensor.RANGE: 8.0 - 0.1 * t_s}
    streams = {sensor: Stream.of(sensor, t_s, value[:, None]) for sensor, value in heights.items()}
    assert upside_down(truth, streams) == ""
    assert upside_down(truth, {Sensor.RANGE: streams[Sensor.RANGE]}) == "range"


@pytest.mark.parametrize("known_hz", [1.0, 5.0, 50.0])
@pytest.mark.parametrize("by_m", [8.0, 120.0])
def test_a_reset_of_the_estimate_is_no_move_of_its_origin_however_seldom_the_other_one_comes(known_hz, by_m):
    """Local rows at 50 Hz: between two global ones a reset looks as if the two had parted."""
    t_s, known_t_s = np.arange(0.0, 40.0, 0.02), np.arange(0.0, 40.0, 1.0 / known_hz)
    path = [np.column_stack([0.5 * at, 3.0 * np.sin(0.3 * at), np.full(len(at), -2.0)]) for at in (t_s, known_t_s)]
    leap = np.array([0.6 * by_m, -0.8 * by_m, 0.0])
    reset = [one + leap * (at >= 20.51)[:, None] for one, at in zip(path, (t_s, known_t_s), strict=True)]
    same, found = of_one_origin(t_s, reset[0], known_t_s, reset[1])
    assert not found
    assert np.array_equal(same, reset[0])
    moved, found = of_one_origin(t_s, reset[0], known_t_s, path[1])
    assert [one.t_s for one in found] == [pytest.approx(20.52)]
    assert found[0].by_ned_m == pytest.approx(leap, abs=0.2)
    assert np.abs(moved - path[0]).max() < 0.2


def test_an_origin_that_moves_twice_within_a_second_is_shifted_back_once_by_both():
    t_s = np.arange(0.0, 20.0, 0.1)
    path = np.column_stack([0.5 * t_s, np.zeros((len(t_s), 2))])
    twice = path + 10.0 * (t_s >= 9.95)[:, None] + 10.0 * (t_s >= 10.25)[:, None]
    moved, found = of_one_origin(t_s, twice, t_s, path)
    assert len(found) == 1
    settled = (t_s < 9.95) | (t_s >= 10.25)
    assert np.allclose(moved[settled], path[settled])
