"""The envelope: every speed and direction flown in its own wind, its table, its page, its mistakes."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from typer.testing import CliRunner

from command import printed
from flownav.campaigns.local import directions_deg, fly_envelope, fly_many, in_wind
from flownav.cli import app
from flownav.core.errors import InputError
from flownav.report.campaign_figures import envelope_figure
from flownav.scoring.errors import touchdown_rows
from flownav.scoring.landings import succeeded
from flownav.simulation.scenario import load_scenario, with_filter


@pytest.fixture(scope="module")
def landing():
    return with_filter(load_scenario("landing"), "paper")


def test_directions_are_even_over_the_circle():
    assert directions_deg(8) == [0.0, 45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 315.0]


def test_a_cells_wind_is_its_own_and_is_not_dispersed(landing):
    setup = in_wind(landing, 6.0, 90.0)
    assert (setup.flight.wind.toward_n, setup.flight.wind.toward_e) == pytest.approx((0.0, -1.0), abs=1e-12)
    assert setup.flight.plan.draws.wind
    truths = setup.ensemble().truths(1, 0, 8)
    assert {truth.wind for truth in truths} == {setup.flight.wind}
    assert len({truth.vehicle.mass_kg for truth in truths}) == 8


def test_each_row_is_what_its_flights_did_and_a_storm_lands_fewer(landing):
    steps = []
    rows = fly_envelope(landing, [2.0, 16.0], [0.0, 180.0], 3, 16, dispersed=False, on_progress=steps.append)
    assert [(row["speed_20ft_m_s"], row["from_direction_deg"]) for row in rows] == [
        (2.0, 0.0),
        (2.0, 180.0),
        (16.0, 0.0),
        (16.0, 180.0),
    ]
    assert sum(steps) == 64
    flown = touchdown_rows(fly_many(in_wind(landing, 16.0, 180.0).flight, 3, 16))
    assert rows[3]["success"]["rate"] == np.mean(succeeded(flown))
    assert rows[0]["success"]["rate"] > rows[2]["success"]["rate"]


def test_the_figure_has_a_ring_a_speed_that_begins_where_the_last_one_ends(landing):
    rate = {"rate": 0.5, "low": 0.2, "high": 0.8}
    rows = [
        {"speed_20ft_m_s": speed, "from_direction_deg": direction, "success": rate, "crashed": 1,
         "contact": {"r95_m": None}, "rest": {"r95_m": 0.1}}
        for speed in (3.0, 8.0) for direction in (0.0, 90.0, 180.0, 270.0)
    ]  # fmt: skip
    inner, outer = envelope_figure("title", rows).data
    assert (inner["base"], inner["r"], inner["width"]) == ([0.0] * 4, [3.0] * 4, [90.0] * 4)
    assert (outer["base"], outer["r"]) == ([3.0] * 4, [5.0] * 4)
    assert "8 m/s from 270°<br>landed 50.0 % (95 % interval 20.0..80.0 %)" in outer["hovertext"][3]


def run(*arguments):
    return CliRunner().invoke(app, ["envelope", *map(str, arguments)])


def test_the_command_prints_its_table_or_json_and_writes_its_page(tmp_path):
    page = tmp_path / "map.html"
    done = run("landing", "--speeds", "4,8", "--directions", 2, "--flights", 4, "--out", page, "--json")
    assert done.exception is None, done.exception
    facts = json.loads(done.stdout)
    assert (facts["scenario"], facts["truth_model"], len(facts["cells"])) == ("landing", "ensemble", 4)
    assert set(facts["cells"][0]["success"]) == {"rate", "low", "high"}
    assert "barpolar" in page.read_text(encoding="utf-8")
    shown = run("landing", "--speeds", "4", "--directions", 2, "--flights", 2, "--matched", "--out", page).stdout
    assert shown.startswith("landing, matched, 2 flights a field")
    assert re.search(r"m/s\W+0°\W+180°", shown)


def test_the_command_flies_the_vehicle_that_it_is_told(tmp_path):
    page = tmp_path / "map.html"
    told = ("landing", "--speeds", "4", "--directions", 1, "--flights", 4, "--out", page, "--json", "--force")
    own, quad = (json.loads(run(*told, *more).stdout) for more in ((), ("--vehicle", "quad-450")))
    assert (own["vehicle"], quad["vehicle"]) == (None, "quad-450")
    assert own["cells"][0]["contact"] != quad["cells"][0]["contact"]
    assert "landing, quad-450, ensemble" in page.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("takeoff",), "takeoff: it never lands"),
        (("landing", "--speeds", "4,strong"), "--speeds strong: a number is needed"),
        (("landing", "--speeds", "40"), "--speeds 40.0: must be from 0.1 to 30.0"),
        (("landing", "--directions", 0), "--directions 0: must be from 1 to 360"),
        (("landing", "--vehicle", "kite.toml"), "kite.toml"),
        (("nowhere",), "nowhere: no such scenario"),
    ],
)
def test_a_mistake_is_an_input_error(arguments, message):
    done = run(*arguments)
    assert isinstance(done.exception, InputError)
    assert message in printed(done.exception)
