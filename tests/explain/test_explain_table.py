"""The table of how often an explanation is right: the definition of right, and that wrong ones are printed."""

from __future__ import annotations

from pathlib import Path

import pytest

import explain as table  # tools/explain.py
import explain_flown as flown  # tools/explain_flown.py
from flownav.live.sitl.tables import faults_of
from flownav.logs.open_log import open_log
from flownav.studies.explain.judge import explain
from flownav.studies.explain.table import BY_NAME
from places import PROJECT
from planted.planted import LISTS, Planted, listed
from planted.results import Flown, Recorded, Result, page, without_flown

FAULT, PAIR, SOUND = (Planted(name, causes, "yard", "px4") for name, causes in (
    ("one", ("flow_axes",)), ("two", ("flow_axes", "gps_lag")), ("none", ())))  # fmt: skip
HURT = Flown((2.0, 0.5), (0.3, 0.5), (0.3, 0.5))


def result(fault: Planted, *named: str, flown: Flown | None = None) -> Result:
    return Result(fault, named, 0.5, flown)


@pytest.mark.parametrize(
    ("found", "right", "all_named", "besides"),
    [
        (result(FAULT, "flow_axes"), True, True, False),
        (result(FAULT, "flow_axes", "gps_lag"), True, True, True),
        (result(FAULT, "gps_lag", "flow_axes"), False, True, True),
        (result(FAULT), False, False, False),
        (result(PAIR, "gps_lag"), True, False, False),
        (result(SOUND), True, True, False),
        (result(SOUND, "gps_lag"), False, True, True),
    ],
)
def test_the_first_cause_is_what_counts(found, right, all_named, besides):
    assert (found.right, found.all_named, found.besides) == (right, all_named, besides)


def test_a_cure_holds_where_the_flight_is_as_good_as_a_sound_one():
    assert HURT.harmed
    assert HURT.holds
    assert not Flown((2.0, 0.5), (0.6, 0.5), (0.3, 0.5)).holds
    assert not Flown((0.3, 0.5), (0.3, 0.5), (0.3, 0.5)).harmed


def test_the_page_says_what_was_wrong():
    by_list = {name: [result(FAULT, "flow_axes", flown=HURT), result(FAULT, "gps_lag")] for name in LISTS}
    again = {name: [result(FAULT, "flow_axes"), result(FAULT, "flow_axes", "gps_lag")] for name in (*LISTS, "clean")}
    again["clean"] = [result(SOUND), result(SOUND, "baro_wash")]
    text = page(by_list, again, [result(SOUND)], [Recorded("a.bin", "nothing wrong", (), 849.0, 0.8)], "judged")
    assert "| forum | 2 | 26 of 27 | 1 (50 %) | 1 | 0 | 2 (100 %) | 2 | 0.5 s |" in text
    assert "something is named: 0 of 1 (at the first look 1 of 30), and 1 of 2 of other seeds." in text
    assert "| own | one | flow_axes | gps_lag (**wrong**) | flow_axes, gps_lag |" in text
    assert "| clean | none | nothing | baro_wash (**wrong**) | - |" in text
    assert "| a.bin | nothing wrong | nothing | 849 s | 0.8 s |" in text
    assert "of 3 flights in which the fault did harm 3 are as good as without it" in text
    assert "| `flow_axes` | 12 | 9 | 0 |" in text


def test_forty_faults_and_more_are_planted_and_half_of_them_blind():
    single = {name: listed(name) for name in ("forum", "unseen", "own")}
    assert sum(map(len, single.values())) >= 80
    assert len(single["forum"]) + len(single["unseen"]) >= sum(map(len, single.values())) / 2
    assert all(fault.source for name in ("forum", "unseen") for fault in single[name])
    assert all(len(fault.causes) == 2 for fault in listed("pairs"))


@pytest.mark.parametrize("name", [name for name, known in table.RECORDED if known == table.NOTHING])
def test_nothing_is_named_of_recorded_logs_that_are_clean(name: str, data_folder: Path):
    assert [one.name for one in explain(open_log(data_folder / name)).findings] == []


def test_the_flown_table_counts_first_causes_and_what_is_to_stay_unnamed(tmp_path):
    wanted = flown.Flight("a", fault="flow-late@0", causes=("flow_delay",))
    none = flown.Flight("b", without="no such cause")
    text = flown.section(
        [(wanted, ("flow_delay", "baro_wash")), (wanted, ("baro_wash", "flow_delay")), (none, ()), (none, ("gps_lag",))]
    )
    assert "ArduPilot: first cause right: 1 of 2 (50 %); nothing named where nothing is to be: 1 of 2." in text
    assert "| b | none | nothing: no such cause | gps_lag | **no** |" in text
    assert without_flown("# Page\n\n" + text) == without_flown("# Page\n") == "# Page\n\n"


def test_every_flown_fault_is_one_that_the_simulator_has_and_its_cause_one_that_is_known():
    for flight in flown.flights():
        assert set(flight.causes) <= set(BY_NAME)
        if flight.fault:
            assert flight.fault.partition("@")[0] in faults_of(flight.autopilot)
        assert flight.command(Path("out")).count("--vehicle") == 1


def test_every_cause_has_its_page_in_the_navigation_under_its_title():
    navigation = (PROJECT / "mkdocs.yml").read_text(encoding="utf-8")
    for name, row in BY_NAME.items():
        assert f'- "{row.words["title"]}": explanation/causes/{name}.md' in navigation
    assert navigation.count("explanation/causes/") == len(BY_NAME)
