"""The parts of a campaign: measures and events, designs, figures, stops, sweeps, and blocks taken in order."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scipy import stats

from flownav.campaigns.measures import (
    FIGURES,
    MEASURES,
    ROW_COLUMNS,
    Event,
    confidence_of_a_look,
    enough,
    event_of,
    figure_of,
    happened,
    looks,
    measured,
    stop_of,
)
from flownav.campaigns.plan import LOT_FLIGHTS, Spread, changed, design_of, planned
from flownav.campaigns.summary import Flight, worst_first
from flownav.core.errors import InputError
from flownav.simulation.dispersion import uniforms
from flownav.simulation.engine import in_order
from flownav.simulation.scenario import load_scenario


def row(**values):
    """A flight that landed without an error, but for what is named."""
    found = np.zeros(len(ROW_COLUMNS))
    found[ROW_COLUMNS.index("touchdown.expected")] = 1.0
    for name, value in values.items():
        found[ROW_COLUMNS.index(name.replace("__", "."))] = value
    return found


CRASHED = row(touchdown__contact__distance_m=0.1, touchdown__broken=2.0)
LANDED = row(touchdown__contact__distance_m=0.3, touchdown__rest__distance_m=0.4)
ALOFT = row(
    touchdown__contact__distance_m=np.nan, touchdown__rest__distance_m=np.nan, touchdown__aloft=1.0,
    max_position_error_m=0.7,
)  # fmt: skip
ROWS = np.array([CRASHED, LANDED, ALOFT])


def test_a_touchdown_that_did_not_happen_is_infinitely_bad():
    assert measured("touchdown.horizontal_m", ROWS).tolist() == [np.inf, 0.3, np.inf]
    assert measured("touchdown.rest_m", ROWS).tolist() == [np.inf, 0.4, np.inf]
    assert measured("estimate.axis_m", ROWS).tolist() == [0.0, 0.0, 0.7]
    assert measured("crash", ROWS).tolist() == [1.0, 0.0, 0.0]
    assert measured("not_landed", ROWS).tolist() == [1.0, 0.0, 1.0]


@pytest.mark.parametrize("name", MEASURES)
def test_every_measure_is_of_a_column_that_a_flight_has(name):
    assert measured(name, ROWS).shape == (3,)
    assert MEASURES[name].words


def test_events_in_words():
    assert event_of("touchdown.horizontal_m > 1") == Event("touchdown.horizontal_m", True, 1.0)
    assert event_of("crash") == Event("crash", True, 0.5)
    assert happened(event_of("touchdown.horizontal_m>0.25"), ROWS).tolist() == [True, True, True]
    assert happened(event_of("touchdown.rest_m > 0.5"), ROWS).tolist() == [True, False, True]
    assert happened(event_of("not_landed"), ROWS).tolist() == [True, False, True]
    assert str(event_of("touchdown.rest_m < .5")) == "touchdown.rest_m < 0.5"


@pytest.mark.parametrize(
    "text", ["", "touchdown.rest_m", "touchdown.rest_m > one", "touchdown.rest_m > inf", "nothing > 1", "a b", "> 1"]
)
def test_what_is_no_event_is_told_in_one_line(text):
    with pytest.raises(InputError, match=r"an event is a measure and a limit|no such measure"):
        event_of(text)


# -- designs ----------------------------------------------------------------------------------------------------------
def test_a_plain_design_is_the_noise_counter():
    assert design_of("plain", ["a"], 100) is None
    assert design_of("latin", [], 100) is None


@pytest.mark.parametrize("kind", ["latin", "sobol"])
def test_each_lot_of_a_design_has_one_flight_in_each_stratum(kind):
    design = Spread(kind, ["wind", "mass"], 2 * LOT_FLIGHTS)
    for name in ("wind", "mass"):
        for lot in range(2):
            flights = range(lot * LOT_FLIGHTS, (lot + 1) * LOT_FLIGHTS)
            strata = np.floor(design.uniforms(1, flights, name) * LOT_FLIGHTS).astype(int)
            assert sorted(strata) == list(range(LOT_FLIGHTS))


@pytest.mark.parametrize("kind", ["latin", "sobol"])
def test_a_flights_inputs_do_not_depend_on_who_asks(kind):
    every = Spread(kind, ["wind", "mass"], 1500).uniforms(3, range(1500), "mass")
    alone = Spread(kind, ["wind", "mass"], 1500)
    assert [alone.uniforms(3, [k], "mass")[0] for k in (1499, 0, 1024, 700)] == every[[1499, 0, 1024, 700]].tolist()
    assert not np.array_equal(every, Spread(kind, ["wind", "mass"], 1500).uniforms(4, range(1500), "mass"))
    assert ((every > 0.0) & (every < 1.0)).all()


def test_flights_beyond_a_design_are_plain():
    beyond = Spread("latin", ["mass"], 10).uniforms(1, [9, 10, 11], "mass")
    assert beyond[1:].tolist() == uniforms(1, [10, 11], "mass").tolist()


@pytest.mark.parametrize("kind", ["latin", "sobol"])
def test_a_mean_over_a_design_is_nearer_than_one_over_plain_flights(kind):
    flights = range(LOT_FLIGHTS)
    plain = [np.mean(uniforms(seed, flights, "mass")) for seed in range(20)]
    spread = [np.mean(Spread(kind, ["mass"], LOT_FLIGHTS).uniforms(seed, flights, "mass")) for seed in range(20)]
    assert np.std(spread) < 0.1 * np.std(plain)


# -- figures and stops ------------------------------------------------------------------------------------------------
def test_figures_of_known_values():
    values = np.arange(1.0, 1001.0)
    assert figure_of("r95_m", values).value == 950.0
    assert figure_of("landed", np.array([0.0] * 9 + [1.0])).value == 0.9
    assert figure_of("r997_m", values[:10]).width == np.inf
    assert figure_of("r997_m", values[:10]).finite()["high"] is None
    assert figure_of("r50_m", values[:3]).finite() == {"value": 2.0, "low": None, "high": None}


def test_looks_are_whole_files_and_end_with_the_last_flight():
    assert looks(100) == [100]
    assert looks(5000) == [512, 768, 1024, 1536, 2560, 3840, 5000]
    assert confidence_of_a_look(5000) == pytest.approx(1.0 - 0.05 / 7)


def test_the_interval_at_which_a_campaign_stops_holds_as_often_as_it_says():
    """A Rayleigh spread of touchdowns, whose R95 is known; the stop looks until its interval is narrow."""
    most, truth, stop = 20_000, stats.rayleigh.ppf(0.95), stop_of("r95_m width <= 0.12")
    held, flown = 0, []
    for repeat in range(300):
        values = stats.rayleigh.rvs(size=most, random_state=repeat)
        for look in looks(most):
            interval = enough(stop, values[:look], most)
            if interval is not None:
                break
        else:
            interval = figure_of("r95_m", values, confidence_of_a_look(most))
        held += interval.low <= truth <= interval.high
        flown.append(look)
    assert held >= 0.95 * 300
    assert 512 < np.median(flown) < most


def test_stops_in_words():
    assert stop_of("r95_m width <= 0.005") == ("r95_m", 0.005)
    for text in ("r95_m", "r95_m width <= 0", "r95_m width <= x", "r95_m width <= nan", "r9_m width <= 1", ""):
        with pytest.raises(InputError, match="until"):
            stop_of(text)
    assert all(figure.words for figure in FIGURES.values())


# -- plans ------------------------------------------------------------------------------------------------------------
def test_a_sweep_flies_every_combination_and_what_is_set_is_not_drawn():
    plan = planned(
        [load_scenario("landing")], {"wind.speed_20ft_m_s": [0.0, 4.0], "gps.model": ["white", "midg"]},
        truth_models=["ensemble"], seed=1, flights=4, changes={"filter.name": "paper"},
    )  # fmt: skip
    assert [cell.values for cell in plan.cells] == [
        {"wind.speed_20ft_m_s": wind, "gps.model": gps} for wind in (0.0, 4.0) for gps in ("white", "midg")
    ]
    ready = plan.ready(2)
    assert ready.setup.scenario.wind.speed_20ft_m_s == 4.0
    assert ready.setup.scenario.filter.name == "paper"
    assert ready.ensemble is not None
    assert "wind.speed_20ft_m_s" not in ready.ensemble.entries
    assert "wind.from_direction_deg" in ready.ensemble.entries


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"wind.sped": 1.0}, "unknown key"),
        ({"name.x": 1.0}, "no table"),
        ({"wind.speed_20ft_m_s": 400.0}, "speed_20ft_m_s"),
    ],
)
def test_what_cannot_be_set_is_told(changes, word):
    with pytest.raises(InputError, match=word):
        changed(load_scenario("approach"), changes)


def test_the_worst_flights_are_those_without_a_finite_figure_first():
    flights = [Flight(0, 1, 0.2, "landed", ""), Flight(0, 2, None, "crashed", ""), Flight(1, 0, 0.9, "landed", "")]
    assert [flight.flight for flight in worst_first(flights)] == [2, 0, 1]


def test_blocks_are_taken_in_order_and_not_all_asked_for_at_once():
    asked, most, lock = 0, 0, threading.Lock()
    taken = 0

    def do(one):
        nonlocal asked, most
        with lock:
            asked += 1
            most = max(most, asked - taken)
        return one * one

    with ThreadPoolExecutor(2) as pool:
        for result in in_order(pool, do, range(200), ahead=8):
            assert result == taken * taken
            with lock:
                taken += 1
    assert taken == 200
    assert most <= 8
