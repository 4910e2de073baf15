"""The sceptic's list: each assumption alters the truth and nothing that the vehicle knows."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from flownav.scoring.landings import REST_DISTANCE
from flownav.scoring.touchdown import TOUCHDOWN_COLUMNS
from flownav.simulation.assemble import assemble
from flownav.simulation.scenario import load_scenario

TOOL = Path(__file__).parents[2] / "tools" / "sceptic.py"


@pytest.fixture(scope="module")
def sceptic():
    spec = importlib.util.spec_from_file_location("sceptic", TOOL)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_each_assumption_moves_the_truth_and_not_what_is_known(sceptic):
    scenario = load_scenario("approach")
    as_it_is = assemble(scenario)
    before = as_it_is.ensemble().truths(3, 0, 1)[0]
    for each in sceptic.ASSUMPTIONS:
        setup = assemble(sceptic.worsened(scenario, each.drawn))
        after = setup.ensemble().truths(3, 0, 1)[0]
        assert after != before, each.words
        assert repr(setup.flight.gains) == repr(as_it_is.flight.gains), each.words
        assert repr(setup.flight.vehicle) == repr(as_it_is.flight.vehicle), each.words


def test_a_row_has_the_radius_its_change_and_those_that_landed(sceptic):
    landings = np.zeros((100, len(TOUCHDOWN_COLUMNS)))
    landings[:, TOUCHDOWN_COLUMNS.index("expected")] = 1.0
    landings[:, REST_DISTANCE] = 0.04
    landings[0, TOUCHDOWN_COLUMNS.index("broken")] = 1.0
    text, r95_m = sceptic.row("worse", landings, 0.02)
    assert r95_m == pytest.approx(0.04)
    assert text.startswith("| worse | 0.040 (0.040-")
    assert text.endswith("| +100 % | 99.0 | 1 |")
