"""Cells of a requirement: heights, faults, flights of their own, and what cannot be flown."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.campaigns.certification.cells import MOST_CELLS, from_height, plan_of, require_planned, words_of
from flownav.campaigns.certification.written import assumed
from flownav.campaigns.engines import Local, Part
from flownav.campaigns.faults.catalogue import FAULTS
from flownav.campaigns.faults.flown import law_of_flight
from flownav.campaigns.local import rows_of
from flownav.campaigns.requirement import load_requirement
from flownav.campaigns.store import Store
from flownav.core.compile import LANES
from flownav.core.errors import InputError
from flownav.simulation.engine import fly_written
from flownav.simulation.scenario import load_scenario
from flownav.simulation.sensing import EPOCH_S
from requirements import ASKED, HEAD, WINDY, write

FLOWN = 'schema_version = 1\nname = "small"\nscenario = "landing"\n'


def planned(tmp_path, text, flights=None, vehicle=None):
    return plan_of(load_requirement(write(tmp_path, text)), flights, vehicle)


# -- what is set, and what is asked ------------------------------------------------------------------------
def test_what_is_set_is_fixed_and_what_is_ranged_is_drawn(tmp_path):
    text = HEAD + "[set.wind]\nspeed_20ft_m_s = 3.0\n[conditions]\nwind.from_direction_deg = [0, 90]\n" + ASKED
    plan = planned(tmp_path, text, 40)
    drawn = plan.ready(0).ensemble.values(1, 0, 40)
    assert "wind.speed_20ft_m_s" not in drawn
    assert 0.0 <= min(drawn["wind.from_direction_deg"]) <= max(drawn["wind.from_direction_deg"]) <= 90.0
    assert plan.cells[0].scenario.wind.speed_20ft_m_s == 3.0


def test_flights_are_judged_by_what_they_were_flown_for(tmp_path):
    folder = tmp_path / "certificate"
    with Store(folder).opened(planned(tmp_path, HEAD + WINDY + ASKED, 40)):
        pass
    require_planned(planned(tmp_path, HEAD + WINDY + ASKED, 40), folder)
    softer = planned(tmp_path, HEAD + WINDY + ASKED.replace("0.5", "2.0"), 40)
    with pytest.raises(InputError, match="judge its flights by something else"):
        require_planned(softer, folder)


def test_a_plan_of_more_flights_or_of_something_softer_shares_no_flight(tmp_path):
    """In another folder, with the same seed: who adds flights to those that were seen draws all of them anew."""
    drawn = [
        set(plan.ready(0).ensemble.values(plan.seed, 0, 40)["wind.speed_20ft_m_s"])
        for plan in (
            planned(tmp_path, HEAD + WINDY + ASKED, 40),
            planned(tmp_path, HEAD + WINDY + ASKED, 41),
            planned(tmp_path, HEAD + WINDY + ASKED.replace("0.5", "2.0"), 40),
            planned(tmp_path, "seed = 2\n" + HEAD + WINDY + ASKED, 40),
        )
    ]
    assert all(not one & other for k, one in enumerate(drawn) for other in drawn[:k])
    again = planned(tmp_path, HEAD + WINDY + ASKED, 40)
    assert drawn[0] == set(again.ready(0).ensemble.values(again.seed, 0, 40)["wind.speed_20ft_m_s"])


def test_a_range_that_cannot_be_is_refused_before_anything_is_flown(tmp_path):
    with pytest.raises(InputError, match="speed_20ft_m_s"):
        planned(tmp_path, HEAD + "[conditions]\nwind.speed_20ft_m_s = [-5, 5]\n" + ASKED)


# -- heights ----------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("name", "height_m", "knots", "duration_s", "lands_s"),
    [
        ("landing", 6.0, [(0.0, 6.0), (10.0, 6.0), (60.0, -9.0)], 60.0, 10.0),
        ("landing", 1.5, [(0.0, 1.5), (10.0, 1.5), (45.0, -9.0)], 45.0, 10.0),
        ("approach", 7.0, [(0.0, 7.0), (5.0, 7.0), (11.0, 2.5), (21.0, 2.5), (51.0, -6.5)], 106.0, 16.0),
        ("pad_return", 6.0, [(0, 0), (5, 0), (11.0, 6.0), (28.0, 6.0), (68.0, -6.0)], 63.0, 28.0),
        ("takeoff", 5.0, [(0.0, 0.0), (10.0, 0.0), (15.0, 5.0), (52.0, 5.0)], 52.0, None),
    ],
)
def test_from_another_height_every_speed_is_the_same(name, height_m, knots, duration_s, lands_s):
    scenario = load_scenario(name)
    flight = from_height(scenario, height_m).flight
    np.testing.assert_allclose([(knot.t_s, knot.height_m) for knot in flight.path], knots)
    assert flight.duration_s == pytest.approx(duration_s)
    assert flight.may_land_after_s == (None if lands_s is None else pytest.approx(lands_s))
    assert from_height(scenario, max(knot.height_m for knot in scenario.flight.path)).flight == scenario.flight


def test_what_happens_on_the_way_moves_along():
    scenario = load_scenario("approach").model_dump(exclude_unset=True) | {
        "event": [{"at_s": 30.0, "kind": "engine cut"}]
    }
    moved = from_height(type(load_scenario("approach"))(**scenario), 13.0)
    assert moved.event[0].at_s == pytest.approx(34.0)


def test_a_height_below_the_next_one_is_refused():
    with pytest.raises(InputError, match=r"approach: height_m 2\.5: must lie above the path's next height, 2\.5 m"):
        from_height(load_scenario("approach"), 2.5)


# -- cells ------------------------------------------------------------------------------------------------
def test_every_combination_is_a_cell_with_flights_of_its_own(tmp_path):
    text = HEAD + WINDY + 'height_m = [2, 4]\nsensor = ["scenario"]\nvehicle = ["maxi-joker-3"]\n' + ASKED
    plan = planned(tmp_path, text)
    assert [words_of(cell) for cell in plan.cells] == [f"maxi-joker-3, from {h:g} m, scenario" for h in (2, 3, 4)]
    assert (plan.flights, [cell.first for cell in plan.cells]) == (18, [0, 18, 36])  # 52 are needed
    assert planned(tmp_path, text, 10).flights == 4
    assert [cell.setup.flight.plan.epochs for cell in plan.cells] == [
        round(t / EPOCH_S) + 1 for t in (46.0 + 2 / 3, 50.0, 53.0 + 1 / 3)
    ]
    (one,) = planned(tmp_path, HEAD + WINDY + ASKED).cells
    assert words_of(one) == "all flights"
    assert one.setup.dispersion["wind.speed_20ft_m_s"].scale == 8.0


def test_faults_strike_when_the_conditions_say(tmp_path):
    words = []
    for more in ("", "fault_begins_s = 12\nfault_lasts_s = 3\n"):
        text = FLOWN + f'[conditions]\nfault = ["none", "gps_loss", "range_stuck_descent", "silence"]\n{more}' + ASKED
        plan = planned(tmp_path, text)
        words.append([cell.failure and cell.failure.words.split(" s: ")[0] for cell in plan.cells])
    assert words[0] == [None, "gps_loss from 5 to 25", "range_stuck_descent from 10 to 30", "silence from 5 to 10"]
    assert words[1] == [None, "gps_loss from 12 to 15", "range_stuck_descent from 12 to 15", "silence from 12 to 17"]
    assert plan.cells[1].failure.words == "gps_loss from 12 to 15 s: GPS falls silent."
    assert [cell["failure"] for cell in plan.as_json["cells"]] == [
        cell.failure and cell.failure.words for cell in plan.cells
    ]
    assert assumed(plan)["failure"]["gps_loss"] == "gps_loss from 12 to 15 s: GPS falls silent."


def test_a_cell_with_a_fault_flies_as_flownav_faults_does(tmp_path):
    plan = planned(tmp_path, FLOWN + '[conditions]\nfault = ["gps_jump"]\n' + ASKED, 16)
    ready = plan.ready(0)
    ((_, rows),) = Local().fly(ready, 1, [Part(0, 16, 16)])
    laws = [law_of_flight(FAULTS["gps_jump"], (5.0, 25.0), 1, number, EPOCH_S) for number in range(16, 32)]
    flown = fly_written(ready.setup.flight._replace(fails=True), 1, 16, LANES, ready.ensemble, laws)
    np.testing.assert_array_equal(rows, rows_of(ready.flight, flown.history))
    sound = Local().fly(planned(tmp_path, FLOWN + ASKED, 16).ready(0), 1, [Part(0, 16, 16)])
    assert not np.array_equal(rows, next(iter(sound))[1], equal_nan=True)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            FLOWN + '[conditions]\nfault = ["luck"]\n' + ASKED,
            "small: conditions: fault luck: no such fault; there are none,",
        ),
        (
            FLOWN + '[conditions]\nfault = ["duplicates"]\n' + ASKED,
            "fault duplicates: it is not flown in the closed loop",
        ),
        (HEAD + '[conditions]\nfault = ["gps_loss"]\n' + ASKED, "the paper's filter has no sensors that fail"),
        (
            FLOWN + '[conditions]\nfault = ["gps_loss"]\nfault_begins_s = 60\n' + ASKED,
            "it begins after 60 s, and the flight",
        ),
        (
            FLOWN.replace("landing", "takeoff") + ASKED,
            "small: touchdown.horizontal_m: the scenario takeoff never lands",
        ),
        (FLOWN + '[set]\noptics = "pixels"\n' + ASKED, 'has optics = "pixels"; certify flies "model"'),
        (FLOWN + "[conditions]\nwind.sped = [0, 1]\n" + ASKED, "landing: dispersion.wind.sped: no such number"),
        (FLOWN + "[conditions]\nheight_m = 0\n" + ASKED, "landing: height_m 0: must lie above"),
        (FLOWN + '[conditions]\nsensor = ["none.toml"]\n' + ASKED, "none.toml"),
    ],
)
def test_what_cannot_be_flown_is_one_line(tmp_path, text, said):
    with pytest.raises(InputError) as error:
        planned(tmp_path, text)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_vehicles_are_named_in_one_place_and_cells_are_not_endless(tmp_path):
    text = FLOWN + '[conditions]\nvehicle = ["quad-450"]\n' + ASKED
    with pytest.raises(InputError, match="vehicle hexa-550: small names vehicles in its conditions"):
        planned(tmp_path, text, vehicle="hexa-550")
    many = ", ".join(f'"{k}.toml"' for k in range(MOST_CELLS + 1))
    with pytest.raises(InputError, match=rf"conditions: {MOST_CELLS + 1} cells; at most {MOST_CELLS} are flown"):
        planned(tmp_path, FLOWN + f"[conditions]\nsensor = [{many}]\n" + ASKED)


def test_what_is_assumed_is_said_of_every_vehicle(tmp_path):
    plan = planned(
        tmp_path, FLOWN + '[conditions]\nvehicle = ["maxi-joker-3", "quad-450"]\nheight_m = [2, 3]\n' + ASKED
    )
    said = assumed(plan)
    helicopter, quad = said["variants"]
    assert (helicopter["cell"], quad["cell"]) == ("maxi-joker-3, from 2 m", "quad-450, from 2 m")
    masses = [
        {row["input"]: row["believed"] for row in variant["dispersed"]}["vehicle.body.mass_kg"]
        for variant in said["variants"]
    ]
    assert masses[0] > 2.0 * masses[1]
    assert any("tail rotor" in words for words in said["not_modelled"])
    assert any("propellers" in words for words in said["not_modelled"])
    assert said["known_exactly"] == "its position in hover for the first 5 s (true state used)"
