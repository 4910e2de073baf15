"""The judge of made flights (tools/made): its arithmetic on cases made by hand, its table, its command."""

import json
from pathlib import Path

import numpy as np
import pytest

import made_flights
from flownav.core.errors import InputError
from flownav.core.measurement import Sensor, Stream
from flownav.logs.open_log import open_flight
from flownav.scoring.reference import Motion
from made.classes import make
from made.flight import GRAVITY_M_S2, Truth, into_body, write
from made.gps_free import Row
from made.gps_free import markdown as as_markdown
from made.gps_free import row_of as row_of_log
from made.judging import NEVER, Line, Verdict, judge, line_of, truth_of, window_of
from made.likeness import _bands, _rough, compared
from made.reckoning import reckoned, rest_of
from made.table import failings, markdown, row_of, rows_of, three
from places import PROJECT


# -- dead reckoning -----------------------------------------------------------------------------------------------
def tables(turn_rad_s=0.0, bias_rad_s=0.0, rest_s=0.0, forward_m_s=0.5, right_m_s=0.0, height_m=2.0, end_s=10.0):
    """A vehicle that stands, motors off, then flies at a constant velocity of its own, turning."""
    t_s = np.arange(0.0, end_s, 0.01)
    flies = t_s >= rest_s
    shaken = np.where(flies, 0.5 * np.sin(300.0 * t_s), 0.0)
    imu = {"t_s": t_s, "gyro_z_rad_s": np.where(flies, turn_rad_s, 0.0) + bias_rad_s}
    imu |= {f"gyro_{axis}_rad_s": np.full(len(t_s), bias_rad_s) for axis in "xy"}
    imu |= {"accel_x_m_s2": shaken, "accel_y_m_s2": 0.0 * shaken, "accel_z_m_s2": shaken - GRAVITY_M_S2}
    at_s = np.arange(0.05, end_s - 0.05, 0.05)
    moves = at_s > rest_s
    flow = {
        "t_s": at_s, "quality": np.full(len(at_s), 200.0),
        "flow_x_rad_s": np.where(moves, -right_m_s / height_m, 0.0),
        "flow_y_rad_s": np.where(moves, forward_m_s / height_m, 0.0),
    }  # fmt: skip
    ranges = {"t_s": at_s, "range_m": np.full(len(at_s), height_m), "valid": np.ones(len(at_s))}
    return {"imu": imu, "flow": flow, "range": ranges}


def test_straight_on_it_is_velocity_times_time():
    path = reckoned(tables(forward_m_s=0.5, right_m_s=0.2))
    moved = path.position[-1] - path.position[0]
    assert moved[:2] == pytest.approx(np.array([0.5, 0.2]) * (path.t_s[-1] - path.t_s[0]), rel=1e-6)
    assert path.position[-1, 2] == pytest.approx(-2.0)


def test_turning_it_flies_a_circle_of_speed_over_rate():
    path = reckoned(tables(turn_rad_s=0.25, forward_m_s=0.5))
    spent_s = path.t_s[-1] - path.t_s[0]
    chord = 2.0 * (0.5 / 0.25) * np.sin(0.5 * 0.25 * spent_s)
    assert np.hypot(*(path.position[-1] - path.position[0])[:2]) == pytest.approx(chord, rel=1e-3)


def test_a_rest_of_a_second_tells_the_gyros_bias_and_half_a_second_does_not():
    assert reckoned(tables(bias_rad_s=0.02, rest_s=2.0)).heading_rad[-1] == pytest.approx(0.0, abs=1e-3)
    assert reckoned(tables(bias_rad_s=0.02, rest_s=0.5)).heading_rad[-1] == pytest.approx(0.02 * 9.99, rel=1e-6)


def test_what_turns_is_no_rest():
    t_s = np.arange(0.0, 3.0, 0.01)
    turning = np.column_stack([0.05 * np.sin(20.0 * t_s), 0.0 * t_s, 0.0 * t_s])
    assert rest_of(t_s, turning, np.zeros((len(t_s), 3))) == 0
    assert rest_of(t_s, 0.0 * turning, np.zeros((len(t_s), 3))) == 300


def test_a_velocity_is_held_over_a_short_silence_and_not_over_a_long_one():
    short, long = tables(), tables()
    short["flow"]["quality"][40:50] = 0.0  # half a second
    long["flow"]["quality"][40:100] = 0.0  # three seconds
    whole, held, lost = (reckoned(each).position[-1, 0] for each in (tables(), short, long))
    assert held == pytest.approx(whole)
    assert lost == pytest.approx(whole - 0.5 * 3.0, abs=0.03)


def test_the_vehicles_turning_is_taken_off_by_its_gyro():
    pitching = tables(forward_m_s=0.0)
    pitching["imu"]["gyro_y_rad_s"] = np.full(len(pitching["imu"]["t_s"]), 0.3)
    pitching["flow"]["flow_y_rad_s"] = np.full(len(pitching["flow"]["t_s"]), 0.3)
    path = reckoned(pitching)
    assert path.position[-1, :2] == pytest.approx([0.0, 0.0], abs=0.05)


# -- one flight ---------------------------------------------------------------------------------------------------
def straight(turn_rad=0.0):
    """The truth of a flight north at 1 m/s and 1 m up, from 2 to 8 s, that turns a little."""
    t_s = np.arange(0.0, 10.0, 0.001)
    flying = np.clip(t_s - 2.0, 0.0, 6.0)
    height = np.clip(10.0 * (t_s - 2.0), 0.0, 1.0)
    place = np.column_stack([flying, 0.0 * t_s, -height])
    yaw = turn_rad * flying / 6.0
    quaternion = np.column_stack([np.cos(0.5 * yaw), 0.0 * yaw, 0.0 * yaw, np.sin(0.5 * yaw)])
    velocity = np.gradient(place, 0.001, axis=0)
    return Truth(t_s, place, velocity, quaternion, np.zeros((len(t_s) - 1, 3)), np.zeros((len(t_s) - 1, 3)), 2.0, 8.0)


def seen(truth, scale=1.0, turned_rad=0.0, drift_rad=0.0):
    """An estimate of it: longer, in a frame that is turned, with a heading that drifts."""
    motion = truth_of(truth)
    cos, sin = np.cos(turned_rad), np.sin(turned_rad)
    north = scale * motion.position[:, 0]
    place = np.column_stack([cos * north, sin * north, motion.position[:, 2]])
    heading = motion.heading_rad + turned_rad + drift_rad * np.clip(motion.t_s - 2.0, 0.0, 6.0) / 6.0
    return Motion(motion.t_s, place, motion.t_s, heading)


def test_a_path_a_tenth_too_long_ends_a_tenth_off_whatever_its_north():
    truth = straight()
    for turned in (0.0, 2.0):
        line = line_of(seen(truth, 1.1, turned), truth_of(truth), window_of(truth))
        assert line.end_m == pytest.approx(0.6, abs=2e-3)
        assert line.worst_m == pytest.approx(0.6, abs=2e-3)
        assert line.heading_deg == pytest.approx(0.0, abs=1e-6)


def test_the_headings_error_is_what_it_drifts_by_in_flight():
    truth = straight(turn_rad=1.0)
    line = line_of(seen(truth, drift_rad=np.deg2rad(7.0), turned_rad=3.0), truth_of(truth), window_of(truth))
    assert line.heading_deg == pytest.approx(7.0, abs=0.01)


def test_an_estimate_that_ends_in_flight_never_arrives():
    truth = straight()
    whole = seen(truth)
    cut = Motion(whole.t_s[:500], whole.position[:500], whole.heading_t_s[:500], whole.heading_rad[:500])
    assert line_of(cut, truth_of(truth), window_of(truth)).end_m == NEVER


def test_vectors_of_the_earth_in_the_axes_of_a_body_that_faces_east():
    east = np.array([[np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]])
    assert into_body(east, np.array([[0.0, 2.0, 1.0]]))[0] == pytest.approx([2.0, 0.0, 1.0])


def test_a_made_flight_is_judged_whole():
    verdict = judge(make("a-clean", 0))
    assert 0.0 < verdict.ours.end_m < 3.0
    assert 0.0 < verdict.line.end_m < 1.5
    assert verdict.line.heading_deg < 5.0
    assert verdict.level_m > 0.0
    assert verdict.nis_flow > 0.0
    assert all(square > 0.0 for square in verdict.squares)
    assert not verdict.why


def test_a_flight_that_cannot_be_replayed_counts_as_lost_and_says_why():
    made = make("a-clean", 0)
    blind = made.tables["flow"] | {"quality": 0.0 * made.tables["flow"]["quality"]}
    verdict = judge(made._replace(tables=made.tables | {"flow": blind}))
    assert verdict.ours.end_m == NEVER
    assert "the filter never started" in verdict.why
    assert row_of("a", [verdict]).diverged == 1


# -- the table ----------------------------------------------------------------------------------------------------
def verdict(name, number, ours, line, **changes):
    known = Verdict(
        name,
        number,
        20.0,
        Line(ours, ours + 0.1, 2.0),
        Line(line, line, 1.5),
        1.5,
        0.0,
        0.25,
        1.0,
        0.8,
        (1.0, 4.0, 0.25),
        (),
    )
    return known._replace(**changes)


def test_median_95th_percentile_and_worst():
    assert three([4.0, 1.0, 2.0, 3.0]) == pytest.approx((2.5, 3.85, 4.0))
    assert three(list(range(101))) == pytest.approx((50.0, 95.0, 100.0))
    assert three([1.0, NEVER]).worst == NEVER


def test_a_row_by_hand():
    flights = [verdict("a-x", k, ours, line) for k, (ours, line) in enumerate([(0.2, 0.4), (0.4, 0.4), (0.9, 0.3)])]
    row = row_of("a-x", flights)
    assert row.ours_m.median == 0.4
    assert row.line_m.median == 0.4
    assert row.closer == pytest.approx(2.0 / 3.0)
    assert row.percent == pytest.approx((2.0, 2.0))
    assert row.over == pytest.approx((1.0, 2.0, 0.5))
    assert row.nis == pytest.approx((1.0, 0.8))
    assert (row.diverged, row.beyond) == (0, 0)
    assert failings(row) == ["p95"]  # 0.85 m against 0.4: more than half as much again


def test_what_falls_short_is_named():
    lost = verdict("b-x", 0, 4.0, 0.3, unwarned=0.1, nis_flow=4.0, nis_range=0.02)._replace(ours=Line(4.0, 5.0, 20.0))
    row = row_of("b-x", [lost])
    names = ["median", "p95", "heading", "heading p95", "diverges", "unwarned", "NIS flow", "NIS range"]
    assert failings(row) == names
    assert failings(row_of("b-x", [verdict("b-x", 0, 0.3, 0.3)])) == []


def test_rows_are_of_classes_generators_and_all():
    flights = [verdict("a-x", 0, 0.2, 0.3), verdict("b-y", 0, 0.2, 0.3), verdict("a-x", 1, 0.1, 0.3)]
    rows = rows_of(flights)
    assert [(row.name, row.flights) for row in rows] == [
        ("a-x", 2), ("b-y", 1), ("generator A", 2), ("generator B", 1), ("all", 3),
    ]  # fmt: skip
    assert "| a-x | 2 | 20 | 0.15 | 0.20 | 0.20 | 0.30 |" in markdown(rows)


# -- how flights look ----------------------------------------------------------------------------------------------
def test_bands_and_roughness_of_known_signals():
    t_s = np.arange(0.0, 20.0, 0.004)
    tone = np.column_stack([2.0 * np.sin(2.0 * np.pi * 2.0 * t_s), np.sin(2.0 * np.pi * 8.0 * t_s)])
    bands = _bands(tone, 250.0)
    assert bands[0] == pytest.approx([np.sqrt(2.0), 0.0], abs=0.02)
    assert bands[1] == pytest.approx([0.0, np.sqrt(0.5)], abs=0.02)
    noise = np.random.default_rng(3).normal(0.0, 0.05, (len(t_s), 2)) + 0.1 * t_s[:, None]
    stream = Stream.of(Sensor.FLOW_VELOCITY, t_s, np.column_stack([noise, np.full(len(t_s), np.nan)]))
    assert _rough(stream, (1.0, 19.0)) == pytest.approx(0.05, rel=0.05)


def test_made_flights_are_as_rough_as_real_ones(tmp_path):
    text = compared(tmp_path, ["a-clean", "b-clean"], range(1))
    lines = [line.strip("| ").split(" | ") for line in text.splitlines()[2:]]
    assert [line[0] for line in lines] == ["a-clean", "b-clean"]
    for line in lines:
        wobble, rough, slide = float(line[4]), float(line[11]), float(line[18])
        assert 40.0 < wobble < 400.0  # mrad/s: 275 in flight of a real one
        assert 20.0 < rough < 200.0  # mrad/s: 75 of a real one
        assert 0.02 < slide < 1.0  # m/s: 0.15 and 0.27 of real ones


# -- the command ---------------------------------------------------------------------------------------------------
def test_the_command_judges_prints_and_writes(tmp_path, capsys):
    page = tmp_path / "page.md"
    page.write_text("before\n{}\nold\n{}\nafter\n".format(*made_flights.marks(made_flights.JUDGED)))
    told = tmp_path / "told.json"
    made_flights.main(
        [
            "judge",
            "--classes",
            "a-clean",
            "--seeds",
            "1",
            "--jobs",
            "1",
            "--signs",
            "--page",
            str(page),
            "--json",
            str(told),
        ]
    )
    text = page.read_text()
    assert text.startswith("before\n")
    assert text.endswith("after\n")
    assert "old" not in text
    assert "| a-clean | 1 |" in text
    assert "| a-clean | 1 |" in capsys.readouterr().out
    assert json.loads(told.read_text())[0]["name"] == "a-clean"


def test_the_command_writes_folders_that_can_be_replayed(tmp_path):
    made_flights.main(["write", str(tmp_path), "--classes", "a-clean", "--seeds", "1", "--first", "3"])
    assert sorted(path.name for path in (tmp_path / "a-clean-03").iterdir()) == [
        "flow.csv", "heading_truth.csv", "imu.csv", "range.csv", "truth.csv",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["judge", "--classes", "a-nonsense"], "--classes a-nonsense: no such class"),
        (["judge", "--seeds", "0"], "--seeds 0: a class has one flight at least"),
        (["compare"], "compare: give the folder of logs"),
        (["write"], "write: give the folder to write into"),
    ],
)
def test_what_it_cannot_do_is_one_line(arguments, said):
    with pytest.raises(InputError, match=said) as caught:
        made_flights.main(arguments)
    assert "\n" not in str(caught.value)


def test_a_page_without_its_marks_is_left_alone(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("nothing")
    with pytest.raises(InputError, match="lacks the lines"):
        made_flights.main(["judge", "--classes", "a-clean", "--seeds", "1", "--page", str(page)])
    assert page.read_text() == "nothing"


def test_the_page_has_the_marks():
    page = Path(PROJECT / "docs" / "explanation" / "made-flights.md").read_text(encoding="utf-8")
    for what in (made_flights.JUDGED, made_flights.COMPARED):
        assert all(mark in page for mark in made_flights.marks(what))


# -- recorded flights without GPS -----------------------------------------------------------------------------------
@pytest.mark.parametrize("name", ["a-clean", "b-yaw"])
def test_a_recorded_flight_has_the_row_that_its_judge_knows_from_the_exact_truth(tmp_path, name):
    """Read back from its files, without what made it; the judge has the truth itself and the instants of flight."""
    made = make(name, 3)
    write(made, tmp_path / name)
    known, found = judge(made), row_of_log(name, open_flight(tmp_path / name))
    assert found is not None
    for ours, theirs in ((found.ours, known.ours), (found.line, known.line)):
        assert ours.end_m == pytest.approx(theirs.end_m, abs=0.05)
        assert ours.worst_m == pytest.approx(theirs.worst_m, abs=0.05)
        assert ours.heading_deg == pytest.approx(theirs.heading_deg, abs=0.3)
    assert found.level_m == pytest.approx(known.level_m, rel=0.1)
    assert found.unwarned == pytest.approx(known.unwarned, abs=0.01)


def test_errors_of_a_line_are_those_of_a_path_that_bends_away_whole_turns_aside():
    t_s = np.linspace(0.0, 10.0, 101)
    truth = Motion(t_s, np.column_stack([t_s, 0.0 * t_s, 0.0 * t_s]), t_s, 0.0 * t_s)
    bent = Motion(t_s, np.column_stack([t_s, 0.02 * t_s**2, 0.0 * t_s]), t_s, 2.0 * np.pi + 0.01 * (t_s - 2.0))
    found = line_of(bent, truth, (2.0, 8.0))
    assert found.end_m == pytest.approx(0.02 * (64.0 - 4.0), rel=1e-6)
    assert found.worst_m == found.end_m
    assert found.heading_deg == pytest.approx(np.rad2deg(0.06), rel=1e-6)
    seam = truth._replace(heading_rad=np.arctan2(np.sin(3.1 + 0.1 * t_s), np.cos(3.1 + 0.1 * t_s)))
    assert line_of(bent._replace(heading_rad=3.1 + 0.1 * t_s), seam, (2.0, 8.0)).heading_deg == pytest.approx(0.0)


def test_the_table_has_a_row_a_flight_their_median_and_their_worst():
    row = Row("one", Line(0.1, 0.5, 2.0), Line(0.2, 0.6, 4.0), 3.0, 0.0)
    lines = as_markdown([row, row._replace(name="two", ours=Line(0.3, 0.7, 1.0), unwarned=0.25)]).splitlines()
    assert len(lines) == 6
    assert lines[2] == "| one | 0.10 | 0.50 | 2.0 | 0.20 | 0.60 | 4.0 | 3.0 | 0.0 |"
    assert lines[4] == "| **median** | 0.20 | 0.60 | 1.5 | 0.20 | 0.60 | 4.0 | 3.0 | 12.5 |"
    assert lines[5] == "| **worst** | 0.30 | 0.70 | 2.0 | 0.20 | 0.60 | 4.0 | 3.0 | 25.0 |"
