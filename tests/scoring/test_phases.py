"""Phases of made records: from contact and motion, with a truth and without one."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from flownav.core.record import Record
from flownav.scoring.phases import NAMES, Phase, phase_at, phases_of
from flownav.scoring.recorded import rejected_mostly_in, scores_by_phase

# from, to [s]; north at the end, height at the end: ground, climb, hover, transit, hover, approach, ground
LEGS = (
    (0, 5, 0, 0),
    (5, 15, 0, 10),
    (15, 25, 0, 10),
    (25, 45, 60, 10),
    (45, 55, 60, 10),
    (55, 75, 60, 0),
    (75, 85, 60, 0),
)
NAMED = ("ground", "climb", "hover", "transit", "hover", "approach", "touchdown", "landed")
STARTS = (0, 5, 15, 25, 45, 55, 75, 76)


def path() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Instants, north and height of LEGS at 50 Hz."""
    t_s = np.arange(0.0, 85.0, 0.02)
    times = [0.0, *(leg[1] for leg in LEGS)]
    return (
        t_s,
        np.interp(t_s, times, [0, *(leg[2] for leg in LEGS)]),
        np.interp(t_s, times, [0, *(leg[3] for leg in LEGS)]),
    )


def flown(table: str = "truth", **columns: np.ndarray) -> Record:
    t_s, north, height = path()
    record = Record()
    record.add(table, {"t_s": t_s, "pos_n_m": north, "pos_e_m": 0 * t_s, "pos_d_m": -height, **columns})
    return record


def on_ground() -> np.ndarray:
    t_s, _, _ = path()
    return (t_s <= 5.0) | (t_s >= 75.0)


def check(phases: list[Phase], within_s: float) -> None:
    assert tuple(phase.name for phase in phases) == NAMED
    assert [phase.t0 for phase in phases] == pytest.approx(STARTS, abs=within_s)
    assert all(one.t1 == after.t0 for one, after in pairwise(phases))  # no gaps
    assert phases[-1].t1 == pytest.approx(85.0, abs=0.2)


def test_a_flight_from_take_off_to_landing_by_its_truth() -> None:
    check(phases_of(flown(on_ground=on_ground())), 1.0)


def test_a_replay_is_divided_alike_by_the_landed_signal_and_its_estimate() -> None:
    record = flown("estimate")
    t_s, _, _ = path()
    record.add("landed", {"t_s": t_s[::50], "landed": on_ground()[::50].astype(float)})
    check(phases_of(record), 1.1)


def test_without_a_landed_signal_the_range_or_events_tell_contact() -> None:
    t_s, _, height = path()
    ranged = flown("estimate")
    ranged.add("range", {"t_s": t_s, "range_m": 0.1 + height})
    check(phases_of(ranged), 1.1)
    told = flown("estimate")
    told.add("events", {"t_s": [5.0, 75.0], "source": ["vehicle"] * 2, "kind": ["lift-off", "touchdown"]})
    check(phases_of(told), 1.1)


def test_where_nothing_tells_contact_no_phase_is_on_the_ground() -> None:
    names = {phase.name for phase in phases_of(flown("estimate"))}
    assert names == {"hover", "climb", "transit", "descent"}


def test_the_scored_rest_ends_the_touchdown() -> None:
    record = flown(on_ground=on_ground())
    record.manifest["scores"] = {"touchdown": {"rest": {"t_s": 78.5}}}
    touchdown = next(phase for phase in phases_of(record) if phase.name == "touchdown")
    assert touchdown.t1 == 78.5


def test_a_bounce_and_a_gust_make_no_phases_of_their_own() -> None:
    t_s, _, height = path()
    contact = on_ground()
    contact[(t_s > 76.0) & (t_s < 76.3)] = False  # skids flutter
    gusty = height + np.where((t_s > 50.0) & (t_s < 50.8), 0.3, 0.0)
    assert tuple(phase.name for phase in phases_of(flown(on_ground=contact, pos_d_m=-gusty))) == NAMED


def test_a_last_descent_that_is_slow_is_an_approach_all_the_same() -> None:
    t_s = np.arange(0.0, 40.0, 0.02)
    height = np.interp(t_s, [0, 20, 30, 40], [0.5, 0.5, 0.0, 0.0])  # 0.05 m/s
    record = Record()
    record.add(
        "truth", {"t_s": t_s, "pos_n_m": 0 * t_s, "pos_e_m": 0 * t_s, "pos_d_m": -height, "on_ground": t_s >= 30}
    )
    phases = phases_of(record)
    assert [phase.name for phase in phases] == ["hover", "approach", "touchdown", "landed"]
    assert phases[1].t0 == pytest.approx(27.0, abs=0.2)  # 0.15 m above its contact


def test_a_record_without_a_path_has_no_phases() -> None:
    assert phases_of(Record()) == []
    short = Record()
    short.add("truth", {"t_s": [0.0], "pos_n_m": [0.0], "pos_e_m": [0.0], "pos_d_m": [0.0]})
    assert phases_of(short) == []


def test_every_name_is_in_the_vocabulary_and_an_instant_has_one() -> None:
    phases = phases_of(flown(on_ground=on_ground()))
    assert {phase.name for phase in phases} <= set(NAMES)
    assert [phase_at(phases, t_s) for t_s in (-1.0, 2.0, 30.0, 99.0)] == ["", "ground", "transit", ""]


def test_errors_and_rejections_belong_to_the_phase_they_happened_in() -> None:
    record = flown(on_ground=on_ground())
    t_s, north, height = path()
    off = np.where((t_s > 25.0) & (t_s < 45.0), 2.0, 0.5)
    record.add("estimate", {"t_s": t_s, "pos_n_m": north + off, "pos_e_m": 0 * t_s, "pos_d_m": -height})
    when = np.array([10.0, 30.0, 31.0, 60.0])
    record.add("innovation", {"t_s": when, "sensor": ["flow_rate"] * 4, "fused": [True, False, False, False],
                              "reason": ["fused"] + ["innovation_gate"] * 3})  # fmt: skip
    phases = phases_of(record)
    rows = {row.phase: row for row in scores_by_phase(record, phases)}
    transit = next(phase for phase in phases if phase.name == "transit")
    assert rows[transit].horizontal_rms_m == pytest.approx(2.0, abs=0.1)
    assert rows[phases[0]].horizontal_rms_m == pytest.approx(0.5)
    assert (rows[transit].offered, rows[transit].rejected) == (2, 2)
    assert sum(row.offered for row in rows.values()) == 4
    assert rejected_mostly_in(record, phases) == {("flow_rate", "innovation_gate"): "transit"}


def test_without_a_truth_errors_are_those_against_gps_at_the_instants_that_it_describes() -> None:
    record = flown("estimate")
    t_s, north, height = path()
    record.add("gps_position", {"t_s": t_s + 0.2, "pos_n_m": north, "pos_e_m": 0 * t_s + 1.0, "pos_d_m": -height})
    record.manifest["delays_s"] = {"gps_position": 0.2}
    for row in scores_by_phase(record, phases_of(record)):
        assert row.horizontal_rms_m == pytest.approx(1.0, abs=1e-6)
        assert np.isnan(row.velocity_rms_m_s)
