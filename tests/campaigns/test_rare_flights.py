"""Rare events of real flights: branches to the bit, threads, the flight to look at again, mistakes."""

from __future__ import annotations

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from command import printed
from flownav.campaigns.local import rows_of
from flownav.campaigns.measures import event_of, measured
from flownav.campaigns.plan import changed
from flownav.campaigns.rare import estimate
from flownav.campaigns.rare.branches import START_ROWS, Space, read_branch, replayed, write_branch
from flownav.campaigns.rare.estimate import estimate_rare
from flownav.campaigns.rare.likely import figures, responses_to
from flownav.cli import app
from flownav.core.compile import LANES, ONE_LANE
from flownav.core.errors import InputError
from flownav.scoring.errors import SCORE_COLUMNS
from flownav.scoring.touchdown import Limits
from flownav.simulation import layout
from flownav.simulation.assemble import assemble
from flownav.simulation.block import KEYED_EPOCHS, Noise
from flownav.simulation.engine import Branches, Instead, buffers_of, fly_into
from flownav.simulation.ensemble import believed
from flownav.simulation.history import columns
from flownav.simulation.noise import normal_pair
from flownav.simulation.plan import START_STEP
from flownav.simulation.scenario import load_scenario, with_filter
from flownav.simulation.sources import starts_of
from flownav.vehicle.parameters import TouchdownLimits

SEED = 5
EVENT = "touchdown.horizontal_m > 0.07"


def landing(**more):
    """The paper's landing, cut off two seconds after it has come to rest."""
    return changed(with_filter(load_scenario("landing"), "paper"), {"flight.duration_s": 24.0} | more)


@pytest.fixture(scope="module")
def setup():
    return assemble(landing())


@pytest.fixture(scope="module")
def fewer():
    """So few flights that an estimate takes seconds."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(estimate, "PILOT_FLIGHTS", 64)
        patch.setattr(estimate, "ISLAND_FLIGHTS", 16)
        patch.setattr(estimate, "LARGEST_CV", 10.0)
        patch.setattr(estimate, "USUAL_FLIGHTS", 16)
        yield


@pytest.fixture(scope="module")
def found(setup, fewer):
    return estimate_rare(setup, event_of(EVENT), seed=SEED, flights=2000, dispersed=True, threads=2)


def flown(flight, branches=None, lanes=LANES):
    buffers = buffers_of(flight, lanes, flight.plan.epochs, written=False)
    fly_into(flight, SEED, 0, lanes, buffers, instead=Instead(branches))
    return buffers.history


def of(flight, streams, start=None):
    streams = np.asarray(streams, np.uint64)
    rows = np.zeros((0, streams.shape[1])) if start is None else start
    return Branches([believed(flight)] * streams.shape[1], Noise(streams, rows))


def flight_spans(setup):
    return Space(setup, SEED, dispersed=False).spans


# -- the engine ------------------------------------------------------------------------------------------------------
def test_a_lane_may_meet_the_noise_of_any_flight(setup):
    plain = flown(setup.flight)
    order = np.array([3, 3, 15, 0, *range(12)])
    np.testing.assert_array_equal(flown(setup.flight, of(setup.flight, order[None, :])), plain[:, :, order])
    alone = flown(setup.flight, of(setup.flight, [[7]]), ONE_LANE)
    np.testing.assert_array_equal(alone[:, :, 0], plain[:, :, 7])


def test_other_noise_from_one_instant_on_changes_nothing_before_it(setup):
    spans, turn = flight_spans(setup), 375
    streams = np.tile(np.arange(16), (spans, 1))
    streams[turn:, 8:] = 1 << 40
    plain, turned = flown(setup.flight), flown(setup.flight, of(setup.flight, streams))
    same = turn * KEYED_EPOCHS
    np.testing.assert_array_equal(turned[:same], plain[:same])
    np.testing.assert_array_equal(turned[:, :, :8], plain[:, :, :8])
    place = columns("truth", ("pos_n_m", "pos_e_m"))
    assert (np.abs(turned[same + 50, place, 8:] - plain[same + 50, place, 8:]) > 0.0).all()


def test_given_start_normals_stand_in_for_those_that_are_drawn():
    flight = assemble(landing(**{"gps.model": "midg"})).flight
    plain = flown(flight)
    rows = np.zeros((START_ROWS, 16))
    for one in starts_of(flight):
        for lane in range(16):
            with np.errstate(over="ignore"):
                pair = normal_pair(SEED, lane, START_STEP, one.row // 2)
            rows[one.row, lane] = pair[one.row % 2]
    assert len(starts_of(flight)) == 18
    own = np.arange(16)[None, :]
    np.testing.assert_array_equal(flown(flight, of(flight, own, rows)), plain)
    rows[layout.GPS_NORMALS - layout.START_NORMALS, 4] += 1.0  # the slow error north
    other = flown(flight, of(flight, own, rows))
    assert (np.abs(other - plain).max(axis=(0, 1)) > 0.0).tolist() == [lane == 4 for lane in range(16)]


# -- flights of a walk ----------------------------------------------------------------------------------------
def test_a_flight_is_the_same_at_any_place_of_any_batch_on_any_number_of_threads(setup):
    space = Space(setup, SEED, dispersed=True)
    rng = np.random.default_rng(1)
    inputs, streams = rng.standard_normal((40, len(space.names))), rng.integers(0, 9, (40, space.spans))
    rows = space.fly(inputs, streams, threads=2)
    np.testing.assert_array_equal(space.fly(inputs, streams, threads=1), rows)
    chosen = np.array([39, 17, 0])
    np.testing.assert_array_equal(space.fly(inputs[chosen], streams[chosen]), rows[chosen])
    assert len(np.unique(rows[:, 0])) == 40


def test_dispersed_numbers_follow_their_normals(setup):
    space = Space(setup, SEED, dispersed=True)
    inputs = np.zeros((3, len(space.names)))
    inputs[:, 0] = (-1.0, 0.0, 50.0)
    values = space.values(inputs)[space.dispersed[0]]
    assert values[0] < values[1] < values[2] < np.inf
    assert values[1] == space.ensemble.values_of({n: np.array([0.5]) for n in space.dispersed})[space.dispersed[0]][0]


def test_an_estimate_says_what_it_found(found):
    said = json.loads(json.dumps(found.as_json()))
    assert {"probability", "low", "high", "cv", "flights"} <= set(said)
    assert said["low"] < said["probability"] < said["high"]
    assert said["probability"] == pytest.approx(sum(part["probability"] for part in said["parts"]))
    assert [part["part"] for part in said["parts"]] == [EVENT, "no touchdown"]
    assert said["flights"] <= 2000
    assert 0.002 < said["probability"] < 0.4  # 0.05 of 2000 flights


def test_the_estimate_does_not_depend_on_threads(setup, found, fewer):
    again = estimate_rare(setup, event_of(EVENT), seed=SEED, flights=2000, dispersed=True, threads=1)
    assert again.as_json() == found.as_json()
    assert again.branch == found.branch


def test_the_most_likely_flight_flies_again_to_the_bit(setup, found, tmp_path):
    path = tmp_path / "rare_flight.json"
    write_branch(path, setup, found.branch, found.event, found.branch_response)
    branch = read_branch(path, setup)
    assert branch == found.branch
    record = replayed(setup, branch)
    assert record.manifest["scores"]["touchdown"]["contact"]["distance_m"] == found.branch_response
    assert found.branch_response > 0.07
    assert record.manifest["parameters"]["drawn"] == found.branch.drawn
    record.save(tmp_path / "flight.fnr")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"schema_version": 9}, "schema_version 9"),
        ({"scenario": "takeoff"}, "of the scenario takeoff"),
        ({"streams": [[1, 3]]}, "another length"),
        ({"streams": [[-1, 601]]}, "another length"),
        ({"drawn": {"vehicle.body.mass_kg": 5.0}}, "other numbers are drawn"),
        ({"streams": 5}, "no flight of a rare event"),
        ({"streams": [[1, 10**15]]}, "no flight of a rare event"),
        ({"parameters_sha256": "0"}, "flown with other settings"),
    ],
)
def test_a_file_of_another_flight_is_refused(setup, found, tmp_path, change, said):
    path = tmp_path / "rare_flight.json"
    write_branch(path, setup, found.branch, found.event, found.branch_response)
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(InputError, match=said):
        read_branch(path, setup)


def test_a_missing_file_is_refused(setup, tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        read_branch(tmp_path / "nothing.json", setup)


# -- responses ----------------------------------------------------------------------------------------
LIMITS = Limits(*TouchdownLimits(2.0, 0.5, 10.0, 40.0, 0.4, np.inf))


def rows_with(**touchdown):
    """A row of a landing that came to rest 0.2 m off, but for these columns of the touchdown."""
    row = dict.fromkeys(SCORE_COLUMNS, 0.1)
    row |= {"touchdown.expected": 1.0, "touchdown.broken": 0.0, "touchdown.go_arounds": 0.0, "touchdown.aloft": 0.0}
    row |= {"touchdown.beside": 0.0, "touchdown.contact.distance_m": 0.2, "touchdown.contact.tilt_deg": 5.0}
    row |= {f"touchdown.{name}": value for name, value in touchdown.items()}
    return np.array([[row[name] for name in SCORE_COLUMNS]])


def test_a_crash_is_graded_by_the_touchdowns_hardest_figure():
    (crash,) = responses_to(event_of("crash"), LIMITS, rows_with())
    assert crash.limit == 1.0
    # sink 0.1 of 2 m/s is usual: 1.05 m/s is half of the way from there to the limit
    assert crash.of(rows_with(**{"contact.sink_rate_m_s": 1.05}))[0] == pytest.approx(0.5)
    assert crash.of(rows_with(**{"contact.tilt_deg": 7.5}))[0] == pytest.approx(0.5)
    assert crash.of(rows_with(**{"contact.tilt_deg": 11.0, "broken": 8.0}))[0] == pytest.approx(1.2)
    assert crash.of(rows_with(broken=64.0))[0] == np.inf
    assert crash.of(rows_with(**{"rest.slide_m": np.nan}))[0] == 0.0
    assert figures(rows_with(), LIMITS).shape == (1, 5)


def test_a_miss_has_two_parts_that_exclude_each_other():
    near, none = responses_to(event_of("touchdown.horizontal_m > 1"), LIMITS, rows_with())
    missed, crashed = rows_with(**{"contact.distance_m": 1.5}), rows_with(broken=32.0)
    assert (near.of(missed)[0] > near.limit, none.of(missed)[0] > none.limit) == (True, False)
    assert (near.of(crashed)[0] > near.limit, none.of(crashed)[0] > none.limit) == (False, True)
    below, _ = responses_to(event_of("touchdown.north_m < -0.5"), LIMITS, rows_with())
    assert below.of(rows_with(**{"contact.north_m": -0.6}))[0] > below.limit
    assert len(responses_to(event_of("estimate.axis_m > 1"), LIMITS, rows_with())) == 1


def test_the_severity_of_real_flights_is_above_one_exactly_where_they_crash():
    # engine off at the end of the descent: some touch down too hard
    scenario = landing(event=[{"at_s": 18.6, "kind": "engine cut"}])
    flight = assemble(scenario).flight
    rows = rows_of(flight, flown(flight))
    limits = Limits(**flight.limits._asdict())
    (crash,) = responses_to(event_of("crash"), limits, rows)
    np.testing.assert_array_equal(crash.of(rows) > 1.0, measured("crash", rows) > 0.0)


# -- the command ----------------------------------------------------------------------------------------
def run(*arguments):
    return CliRunner().invoke(app, ["campaign", *arguments])


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["landing", "--rare", "touchdown.horizontal_m over 1"], "an event is a measure and a limit"),
        (["landing", "--rare", "crash", "--flights", "100"], "a rare event needs 2000 or more"),
        (["landing", "takeoff", "--rare", "crash"], "needs one scenario"),
        (["landing", "--rare", "crash", "--sampling", "sobol"], "leave out --sampling"),
    ],
)
def test_mistakes_of_the_command_are_said(tmp_path, arguments, said):
    result = run(*arguments, "--out", str(tmp_path / "out"))
    assert result.exit_code != 0
    assert said in f"{result.output}{printed(result.exception)}"


def test_the_command_writes_the_flight_and_flies_it_again(tmp_path, fewer):
    told = ["landing", "--set", "filter.name=paper", "--set", "flight.duration_s=24", "--truth-model", "matched"]
    result = run(*told, "--rare", EVENT, "--flights", "2000", "--seed", str(SEED), "--out", str(tmp_path), "--json")
    assert result.exit_code == 0, result.output
    facts = json.loads(result.stdout)
    assert {"probability", "low", "high", "cv", "flights", "likely"} <= set(facts)
    before = (tmp_path / "rare_flight.fnr").read_bytes()
    assert (tmp_path / "rare_flight.html").exists()
    again = run(*told, "--flight", str(tmp_path / "rare_flight.json"), "--json")
    assert again.exit_code == 0, again.output
    assert json.loads(again.stdout)["touchdown"]["contact"]["distance_m"] == facts["likely"]["response"]
    assert len(before) > 1000
