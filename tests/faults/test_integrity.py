"""Protection levels on trial: what is counted, on flights made by hand, and a small run of the real thing."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

import integrity
from flownav.campaigns.faults.catalogue import FAULTS, faults_named
from flownav.campaigns.faults.navigator import Flag, Navigated, Offers, navigator_of
from flownav.campaigns.faults.table import BASE, DURATIONS_S, HEIGHTS_M, flight_at, runs
from flownav.core.errors import InputError
from flownav.estimation.states import HYPOTHESES, MOST_HYPOTHESES
from flownav.simulation.assemble import assemble
from flownav.simulation.scenario import load_scenario
from integrity import (
    BEGIN,
    END,
    SUSPECTS,
    TOGETHER,
    WHEN_BEGIN,
    WHEN_END,
    Judged,
    alarms,
    cost,
    fly,
    judged,
    placed,
    row_of,
    rows_of,
    section,
    table,
    when_table,
    whens_of,
)

PROJECT = Path(__file__).parents[2]
T_S = np.arange(0.0, 10.0, 0.5)
STILL = {"t_s": T_S, **{name: np.zeros(len(T_S)) for name in ("pos_n_m", "pos_e_m", "pos_d_m")}}
NO_OFFERS = Offers(*(np.zeros(0, kind) for kind in (float, int, int, bool, str)))


def run_of(error_ned_m, levels_m, flags=()) -> Navigated:
    """An estimate of a vehicle that stands at the origin."""
    position = np.broadcast_to(np.array(error_ned_m, float), (len(T_S), 3))
    levels = None if levels_m is None else np.broadcast_to(np.array(levels_m, float), (len(T_S), 2))
    return Navigated(T_S, position, np.ones((len(T_S), 3)), NO_OFFERS, (), tuple(flags), levels)


def steps(error_m, level_m, said=False, raised=(), fault="late", count=4) -> Judged:
    """A flight whose every step is the same."""
    return Judged(
        fault, np.tile(np.array(error_m, np.float32), (count, 1)), np.tile(np.array(level_m, np.float32), (count, 1)),
        np.full(count, said), frozenset(raised),
    )  # fmt: skip


# -- what is counted ---------------------------------------------------------------------------------------------
def test_horizontal_is_the_way_along_both_axes_and_vertical_has_no_sign():
    found = judged("late", run_of([3.0, 4.0, -2.0], [6.0, 3.0]), STILL, 4.0, 4.0)
    assert found.error_m.shape == (12, 2)  # from 4 s on
    np.testing.assert_allclose(found.error_m, [[5.0, 2.0]] * 12)
    np.testing.assert_allclose(found.level_m, [[6.0, 3.0]] * 12)


def test_a_warning_stands_from_when_it_is_raised_and_counts_from_the_fault_on():
    before, after = Flag(2.0, 4.5, "flow", "doubted"), Flag(6.0, np.inf, *SUSPECTS.split())
    run = run_of([0.0, 0.0, 0.0], [1.0, 1.0], [before, after])
    found = judged("late", run, STILL, 4.0, 4.0)
    assert found.warned.tolist() == [True, False, False, False, *[True] * 8]
    assert found.raised == {SUSPECTS}
    assert judged("none", run, STILL, 4.0, -np.inf).raised == {SUSPECTS, "flow doubted"}


def test_an_error_above_the_level_counts_where_nothing_is_said():
    row = row_of("late", [steps([5.0, 1.0], [4.0, 2.0]), steps([5.0, 1.0], [6.0, 2.0]),
                          steps([9.0, 9.0], [4.0, 2.0], True, [SUSPECTS])])  # fmt: skip
    assert (row.flights, row.steps) == (3, 12)
    assert row.unwarned == pytest.approx((1.0 / 3.0, 0.0))
    assert row.beyond_m == pytest.approx((1.0, 0.0))
    assert row.ratio == pytest.approx((0.8, 2.0))
    assert row.level_m == pytest.approx((4.0, 2.0))
    assert row.warned == pytest.approx(1.0 / 3.0)
    assert row.raised == {SUSPECTS: pytest.approx(1.0 / 3.0)}


@pytest.mark.parametrize(("error_m", "level_m"), [(1.0, np.nan), (np.inf, 5.0), (np.inf, np.nan)])
def test_what_is_no_number_protects_from_nothing(error_m, level_m):
    assert row_of("late", [steps([error_m, 0.0], [level_m, 1.0])]).unwarned == (1.0, 0.0)


def test_a_navigator_without_levels_cannot_be_judged():
    with pytest.raises(ValueError, match="without protection levels"):
        judged("late", run_of([0.0, 0.0, 0.0], None), STILL, 0.0, 0.0)


def test_all_faults_together_leave_the_flights_without_one_out():
    rows = rows_of([steps([1, 1], [2, 2], fault="none"), steps([3, 1], [2, 2]), steps([1, 1], [2, 2], fault="lost")])
    assert [row.fault for row in rows] == ["late", "lost", TOGETHER, "none"]
    assert [row.unwarned[0] for row in rows] == [1.0, 0.0, 0.5, 0.0]
    assert rows_of([]) == []


def test_when_the_error_is_above_is_counted_by_spell_and_duration():
    """A fault of 5 s, a step a second: at 3 and 4 s, 8 s and 20 s the error is above, horizontally."""
    error = np.ones((30, 2), np.float32)
    error[[3, 4, 8, 20], 0] = 9.0
    late = Judged("late", error, np.full((30, 2), 2.0, np.float32), np.zeros(30, bool), frozenset(),
                  np.arange(30, dtype=np.float32), 5.0)  # fmt: skip
    sound = steps([1.0, 1.0], [2.0, 2.0], fault="lost")._replace(since_s=np.arange(4, dtype=np.float32))
    (found,) = whens_of([late, sound, late])
    assert found[:4] == ("late", 5.0, 2, (2, 0))
    assert found.unwarned == pytest.approx((4.0 / 30.0, 0.0))
    assert found.shares == ((0.5, 0.0), (0.25, 0.0), (0.25, 0.0))
    lines = when_table([found]).splitlines()
    assert lines[2] == "| `late` | 5 | 2 | 2 | 0 | 133.33 | 0.00 | 50 / 25 / 25 | - |"
    assert len({line.count("|") for line in lines}) == 1


# -- the page ----------------------------------------------------------------------------------------------------
def test_the_table_has_shares_and_metres():
    rows = rows_of([steps([3.0, 1.0], [2.0, 4.0]), steps([1, 1], [2, 4], raised=["flow doubted"], fault="none")])
    lines = table(rows).splitlines()
    assert lines[2] == "| `late` | 1 | 0.0 | 0.0 | 1000.00 | 0.00 | 1.00 | 0.00 | 0.67 | 4.00 | 2.00 | 4.00 |"
    assert lines[3].startswith("| **all faults** | 1 |")
    assert len({line.count("|") for line in lines}) == 1
    assert alarms(rows[-1]) == (
        "Warnings in the 1 flights in which nothing fails: `filter suspects` in 0; `flow doubted` in 1."
    )
    text = section(rows, rows, (7, 9), 1.254)
    assert "seeds 7 to 9, 8 steps" in text
    assert "1.25 times" in text
    assert text.count("| `late` |") == 2


def test_a_text_takes_the_place_between_its_marks():
    page = f"before\n{BEGIN}\nold\n{END}\nafter\n"
    once = placed(page, "new\n", "page.md")
    assert once == f"before\n{BEGIN}\n\nnew\n\n{END}\nafter\n"
    assert placed(once, "new\n", "page.md") == once
    for lacking in ("", BEGIN, END, f"{END}{BEGIN}"):
        with pytest.raises(InputError, match=r"^page.md: lacks the lines .* put them where the table belongs$"):
            placed(lacking, "new", "page.md")


# -- the real thing ----------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def setup():
    return assemble(load_scenario(BASE))


def test_flights_with_and_without_faults_are_judged(setup):
    named = faults_named(["gps_jump", "range_stuck_descent"])
    found = list(fly(navigator_of(setup), [3], [3, 4], named, (0.5,), (1.0, 2.0)))
    assert [flight.fault for flight in found] == [
        "none", "gps_jump", "gps_jump", "range_stuck_descent", "range_stuck_descent", "none"
    ]  # fmt: skip
    for flight in found:
        assert np.isfinite(flight.error_m).all()
        assert np.isfinite(flight.level_m).all()
        assert len(flight.error_m) == len(flight.level_m) == len(flight.warned) > 100
        assert (flight.level_m > 0.0).all()
    assert len(found[3].error_m) < len(found[1].error_m)  # begins with the descent
    total = rows_of(found)[-2]
    assert total.unwarned[0] < 0.01
    assert total.level_m[0] < 5.0


def test_the_cost_is_the_time_with_faults_followed_by_that_without(setup, monkeypatch):
    followed = []
    monkeypatch.setattr(integrity, "run", lambda queue, on: followed.append(int(on.work[HYPOTHESES])))
    ticks = iter(np.cumsum([0.0, 3.0, 0.0, 2.0] * 3))  # 3 s with, 2 s without
    monkeypatch.setattr(integrity.time, "perf_counter", lambda: next(ticks))
    assert cost(setup.fitted.given, flight_at(0.5, 1.0, 3).streams, repeats=3) == pytest.approx(1.5)
    assert followed == [MOST_HYPOTHESES, 0] * 3


def test_the_tool_writes_its_table_into_the_page(tmp_path, monkeypatch, capsys):
    spec = importlib.util.spec_from_file_location("integrity_tool", PROJECT / "tools" / "integrity.py")
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    flown = []

    def flying(navigate, faulty, clean, faults=None, durations_s=(2.0, 5.0)):
        flown.append((len(faulty), len(clean), durations_s) if faults is None else durations_s)
        return iter([steps([1.0, 1.0], [2.0, 2.0]), *([steps([1, 1], [2, 2], fault="none")] if clean else [])])

    monkeypatch.setattr(tool, "fly", flying)
    monkeypatch.setattr(tool, "cost", lambda told, streams: 1.3)
    page = tmp_path / "page.md"
    page.write_text(f"words\n{BEGIN}\n{END}\n{WHEN_BEGIN}\n{WHEN_END}\n")
    tool.main(page)
    assert page.read_text().startswith(f"words\n{BEGIN}\n\nPrinted by `make integrity`")
    assert all(line in page.read_text() for line in capsys.readouterr().out.splitlines())
    assert flown == [(10, 0, (60.0,)), (75, 334, (2.0, 5.0)), (10, 0, (5.0,)), (5.0,), (60.0,)]
    flown.clear()
    tool.main(page, 4)
    assert flown == [(4, 0, (60.0,)), (4, 0, (5.0,)), (5.0,), (60.0,)]
    assert page.read_text().startswith(f"words\n{BEGIN}\n\nPrinted by `make integrity`")
    assert f"{WHEN_BEGIN}\n\nPrinted by `make integrity`, seeds 1000 to 1003." in page.read_text()
    faulty = runs(tuple(FAULTS.values()), HEIGHTS_M, DURATIONS_S) - len(HEIGHTS_M)
    assert 75 * faulty >= 10_000
    assert 334 * len(HEIGHTS_M) >= 1000
    assert 75 * runs(tuple(FAULTS.values()), HEIGHTS_M, DURATIONS_S) - 75 * len(HEIGHTS_M) >= 10_000
    assert 334 * len(HEIGHTS_M) >= 1000


@pytest.mark.parametrize("marks", [(BEGIN, END), (WHEN_BEGIN, WHEN_END)])
def test_the_page_that_is_shipped_has_its_places(marks):
    placed((PROJECT / "docs" / "explanation" / "integrity.md").read_text(), "", "docs/explanation/integrity.md", *marks)
