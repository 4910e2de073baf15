"""Take-offs: how far they pass the commanded height, how long they see no flow; of one, of many, as fly prints them."""

from __future__ import annotations

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from flownav.campaigns.local import takeoff_history
from flownav.cli import app
from flownav.cli.fly_output import takeoff_lines
from flownav.scoring.landings import takeoff_of_flight, takeoff_of_flights, takeoffs
from flownav.simulation.assemble import assemble
from flownav.simulation.engine import fly_one
from flownav.simulation.scenario import load_scenario

COMMANDED_M = np.array([[0.0], [0.0], [1.5], [3.0], [3.0], [3.0]])


def test_a_takeoff_is_over_by_its_peak_and_blind_where_it_is_up():
    height = np.array([[-0.01], [0.0], [1.4], [2.9], [3.5], [3.1]])
    sees = np.array([[0.0], [0.0], [0.0], [1.0], [0.0], [0.0]])
    (row,) = takeoffs(height, COMMANDED_M, sees, 0.02)
    assert takeoff_of_flight(row) == {"over_commanded_m": pytest.approx(0.5), "without_flow_s": pytest.approx(0.04)}
    (low,) = takeoffs(0.5 * height, COMMANDED_M, sees, 0.02)
    assert low == pytest.approx([-1.25, 0.04])


def test_many_takeoffs_are_a_median_and_a_worst():
    facts = takeoff_of_flights(np.array([[0.1, 0.0], [0.3, 0.5], [0.2, 0.0]]))
    assert facts["over_commanded_m"]["median"] == pytest.approx(0.2)
    assert facts["over_commanded_m"]["worst"] == 0.3
    assert (facts["without_flow_s"]["worst"], facts["lost_flow"]) == (0.5, 1)
    assert takeoff_lines(facts, 3) == [
        "take-off  0.200 (0.110..0.290) m over the commanded height, worst 0.300 m",
        "no flow in the upper half of the climb  0.00 (0.00..0.45) s, worst 0.50 s, in 1 of 3 flights",
    ]


def test_only_a_flight_from_the_ground_takes_off():
    flight = assemble(load_scenario("landing")).flight
    short = flight._replace(plan=flight.plan._replace(epochs=5))
    assert takeoff_history(short, fly_one(short, 1)) is None


@pytest.mark.parametrize("filter_name", ["landing", "paper"])
def test_the_command_says_it_of_one_and_of_many(tmp_path, filter_name):
    def facts(*more):
        done = CliRunner().invoke(
            app, ["fly", "takeoff", "--filter", filter_name, "--out", str(tmp_path / "t.fnr"), "--no-report", *more]
        )
        assert done.exception is None, done.exception
        return done.stdout

    one = json.loads(facts("--json"))["takeoff"]
    many = json.loads(facts("--json", "--flights", "8", "--matched"))["takeoff"]
    assert -0.2 < one["over_commanded_m"] <= many["over_commanded_m"]["worst"] < 0.5
    assert many["over_commanded_m"]["p05"] <= one["over_commanded_m"]
    assert one["without_flow_s"] < 5.0  # it is up for 37 s, and sees
    assert "m over the commanded height" in facts()
