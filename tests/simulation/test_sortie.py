"""The whole mission, from standing on the pad to rest on it: what the navigator finds by itself, and where it lands."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.campaigns.local import fly_recorded, touchdown_history
from flownav.core.record import POSITION_NED, QUATERNION
from flownav.navigation.windows import MOVES
from flownav.scoring.landings import REST_DISTANCE, succeeded
from flownav.simulation.assemble import assemble
from flownav.simulation.engine import fly_blocks
from flownav.simulation.history import column, columns
from flownav.simulation.scenario import load_scenario
from flownav.simulation.sensing import EPOCH_S

FLIGHTS = 32
HOVERED_S, AT_REST_S = 25.0, 105.0  # ten seconds of hover are over; every landing is
FIRST_CIRCUIT_S, LAST_CIRCUIT_S = 31.0, 51.0


@pytest.fixture(scope="module")
def setup():
    return assemble(load_scenario("sortie"))


@pytest.fixture(scope="module")
def flown(setup):
    """Touchdowns, tilt errors in hover [rad], heights stated and true at rest, of an ensemble."""

    def judge(history):
        said, true = (history[:, columns(table, QUATERNION)] for table in ("estimate", "truth"))
        w, x, y = said[:, 0], said[:, 1], said[:, 2]
        down_off = 2.0 * np.abs(
            np.stack([w * y - x * said[:, 3], w * x + y * said[:, 3]])
            - np.stack(
                [true[:, 0] * true[:, 2] - true[:, 1] * true[:, 3], true[:, 0] * true[:, 1] + true[:, 2] * true[:, 3]]
            )
        )
        hover, rest = round(HOVERED_S / EPOCH_S), round(AT_REST_S / EPOCH_S)
        height = history[rest][columns("estimate", POSITION_NED)] - history[rest][columns("truth", POSITION_NED)]
        travelled = np.abs(history[:, column("truth", "pos_n_m")]).max(axis=0)
        return touchdown_history(setup.flight, history), down_off[:, hover].T, height.T, travelled

    blocks = [block for _, block in fly_blocks(setup.flight, 1, 0, FLIGHTS, judge, None, setup.ensemble())]
    return [np.concatenate(each) for each in zip(*blocks, strict=True)]


def test_every_flight_of_an_ensemble_comes_back_onto_its_pad(flown):
    touchdowns, _, _, travelled = flown
    assert succeeded(touchdowns).all()
    assert np.quantile(touchdowns[:, REST_DISTANCE], 0.95) < 0.12
    assert (travelled > 8.0).all()


def test_the_tilt_is_known_to_half_a_degree_after_ten_seconds_of_hover(flown):
    rms_deg = np.degrees(np.sqrt(np.mean(flown[1] ** 2, axis=0)))
    assert (rms_deg < 0.5).all()


def test_what_is_flown_on_stays_right_at_rest(flown):
    """No new pad is taken where it lands, and no stray echo moves the ground that it stands on."""
    off = flown[2]
    assert np.quantile(np.hypot(off[:, 0], off[:, 1]), 0.9) < 0.1
    assert np.quantile(np.abs(off[:, 2]), 0.9) < 0.25


def test_the_navigator_finds_by_itself_that_it_stands_and_that_it_leaves(setup):
    record = fly_recorded(setup, 1)
    table = record.tables["events"]
    stands = [(t, v) for t, k, v in zip(table["t_s"], table["kind"], table["value"], strict=True) if k == "standing"]
    before = [value for t_s, value in stands if t_s < 8.0]
    assert before
    assert before[-1] > MOVES
    assert any(value == MOVES for t_s, value in stands if 8.0 < t_s < 10.0)
