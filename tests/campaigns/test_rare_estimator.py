"""Subset simulation on a stand-in whose probabilities are known: no bias, honest intervals, ties, no levels."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.campaigns.rare import estimate
from flownav.campaigns.rare.estimate import find, together_with
from flownav.campaigns.rare.likely import moments, nats, rank_inputs
from flownav.campaigns.rare.walk import FIRST_STREAM, WALK_STATES, ancestors, climb, fly_islands, next_level
from rare_stand_in import INPUTS, SPANS, limit_of, walker_of

REPEATS = 120


@pytest.fixture
def smaller(monkeypatch):
    """A quarter of the flights: what is asked of the estimator does not depend on how many they are."""
    monkeypatch.setattr(estimate, "PILOT_FLIGHTS", 128)
    monkeypatch.setattr(estimate, "ISLAND_FLIGHTS", 128)


@pytest.fixture(scope="module")
def repeats():
    """Many estimates of 1e-4, each of its own seed."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(estimate, "PILOT_FLIGHTS", 128)
        patch.setattr(estimate, "ISLAND_FLIGHTS", 128)
        return [find(walker_of(seed), limit_of(1e-4), 20_000) for seed in range(REPEATS)]


def test_estimates_are_right_in_the_mean(repeats):
    ratio = np.array([found.probability for found in repeats]) / 1e-4
    assert abs(ratio.mean() - 1.0) < 3.0 * ratio.std(ddof=1) / np.sqrt(REPEATS)
    assert abs(ratio.mean() - 1.0) < 0.1


def test_the_coefficient_of_variation_is_what_repeats_show(repeats):
    shown = np.std([found.probability for found in repeats], ddof=1) / 1e-4
    assert np.mean([found.cv for found in repeats]) == pytest.approx(shown, rel=0.35)
    assert np.mean([found.cv for found in repeats]) < 0.35


def test_intervals_hold_the_truth_as_often_as_they_say(repeats):
    """Of 120 at 95 % fewer than 108 hold it once in a hundred."""
    held = [found.low <= 1e-4 <= found.high for found in repeats]
    assert np.mean(held) >= 0.90
    assert np.median([found.high / found.low for found in repeats]) < 8.0


def test_an_interval_is_wider_the_more_levels_were_climbed():
    narrow, wide = (estimate.interval_of(1e-4, 0.3, 7, levels) for levels in (1, 7))
    assert wide[0] < narrow[0] < 1e-4 < narrow[1] < wide[1]
    assert narrow[1] / 1e-4 == pytest.approx(1e-4 / narrow[0])


def test_fixed_levels_have_no_bias_however_few_flights():
    ladder = climb(walker_of(1), limit_of(1e-3), 512, 10_000)
    found = np.concatenate([fly_islands(walker_of(seed), ladder, 64, 64).estimates for seed in range(2, 12)]) / 1e-3
    assert abs(found.mean() - 1.0) < 3.5 * found.std(ddof=1) / np.sqrt(len(found))


def test_one_in_a_million_within_what_two_cores_fly_in_three_minutes():
    walker = walker_of(3)
    found = find(walker, limit_of(1e-6), 100_000)
    assert found.cv <= 0.3
    assert found.low < 1e-6 < found.high
    assert walker.flown < 100_000
    assert found.weights.sum() == pytest.approx(found.probability)


def test_flights_of_infinite_response_are_beyond_every_level(smaller):
    walker = walker_of(4, lambda total: np.where(total > limit_of(1e-3), np.inf, total))
    found = find(walker, 1e9, 40_000)
    assert found.low < 1e-3 < found.high
    assert found.cv <= 0.35


def test_a_response_of_yes_and_no_is_flown_at_random(smaller):
    walker = walker_of(5, lambda total: (total > limit_of(0.01)).astype(float))
    found = find(walker, 0.5, 8000)
    assert found.low < 0.01 < found.high
    assert found.cv == pytest.approx(1.0 / np.sqrt(80.0), rel=0.3)
    assert walker.flown == 8000


def test_what_never_happens_has_an_upper_end(smaller):
    found = find(walker_of(6, np.zeros_like), 0.5, 5000)
    assert (found.probability, found.low, found.cv) == (0.0, 0.0, np.inf)
    assert 3.0 / 5000 < found.high < 5.0 / 5000


def test_next_to_nothing_beside_the_other_part_is_left_at_that(smaller):
    walker = walker_of(7)
    found = find(walker, limit_of(1e-8), 40_000, beside=1e-2)
    assert found.probability == 0.0
    assert 1e-5 < found.high < 1e-2
    assert walker.flown < 1500


@pytest.mark.parametrize(
    ("response", "limit", "level"),
    [
        (np.arange(80.0), 1000.0, 69.0),  # ten of eighty are beyond
        (np.arange(80.0), 60.0, 60.0),  # more than one in eight are beyond the event
        (np.repeat([0.0, 1.0, 2.0], [58, 13, 9]), 9.0, 1.0),  # ties: 9 of 80 are nearer to one in eight than 22
        (np.repeat([0.0, np.inf], [75, 5]), 9.0, 0.0),
        (np.repeat([0.0, np.inf], [60, 20]), 9.0, 9.0),
        (np.repeat([-np.inf, 3.0], [70, 10]), 9.0, -np.inf),
        (np.zeros(80), 9.0, None),
    ],
)
def test_levels_among_ties(response, limit, level):
    assert next_level(response, limit) == level


def test_the_same_seed_is_the_same_estimate(smaller):
    once, again = (find(walker_of(8), limit_of(1e-3), 20_000) for _ in range(2))
    assert once.probability == again.probability
    np.testing.assert_array_equal(once.beyond.streams, again.beyond.streams)
    np.testing.assert_array_equal(once.beyond.inputs, again.beyond.inputs)


def test_every_flight_draws_from_streams_of_its_own():
    walker = walker_of(9)
    first = walker.fresh(10)
    after, taken = walker.step(first, -np.inf, np.full(10, 0.5))
    assert taken.all()
    new = after.streams != first.streams
    assert 0.2 < new.mean() < 0.8
    assert first.streams.min() == FIRST_STREAM
    assert after.streams[new].min() > first.streams.max()
    assert (after.inputs != first.inputs).all()


def test_a_step_that_ends_below_the_level_is_not_taken():
    walker = walker_of(10)
    states = walker.fresh(400)
    beyond = states.at(np.flatnonzero(states.response > 0.5))
    after, taken = walker.step(beyond, 0.5, np.full(len(beyond.response), 0.8))
    assert 0 < taken.sum() < len(taken)
    np.testing.assert_array_equal(after.streams[~taken], beyond.streams[~taken])
    assert (after.response > 0.5).all()


def test_walks_leave_all_flights_as_probable_as_they_are():
    walker = walker_of(11)
    states = walker.fresh(4000)
    for _ in range(4):
        states, _ = walker.step(states, -np.inf, np.full(4000, 0.3))
    assert np.abs(states.inputs.mean(axis=0)).max() < 4.0 / np.sqrt(4000)
    assert states.response.std() == pytest.approx(1.0, abs=0.05)


def test_ancestors_are_chosen_evenly():
    rng = np.random.default_rng(1)
    chosen = ancestors(rng, np.array([5, 6, 7]), WALK_STATES)
    assert sorted(np.bincount(chosen, minlength=8)[5:].tolist()) == [2, 3, 3]
    assert len(set(ancestors(rng, np.arange(40), 16).tolist())) == 16


def test_parts_add_up_and_an_unseen_one_raises_the_upper_end_alone(smaller):
    one, two = (find(walker_of(seed), limit_of(1e-3), 20_000) for seed in (12, 13))
    probability, low, high, cv = together_with([one, two])
    assert probability == one.probability + two.probability
    assert cv < max(one.cv, two.cv)
    assert low < 2e-3 < high
    unseen = find(walker_of(14, np.zeros_like), 0.5, 5000)
    assert together_with([one, unseen]) == (one.probability, one.low, one.high + unseen.high, one.cv)
    assert together_with([unseen]) == (0.0, 0.0, unseen.high, np.inf)


def test_inputs_are_ranked_by_what_they_do(smaller):
    found = find(walker_of(15), limit_of(1e-4), 20_000)
    rows = rank_inputs([f"input {k}" for k in range(INPUTS)], found.beyond.inputs, found.weights, 100.0)
    assert [row["input"] for row in rows][:2] == ["input 0", "input 1"]
    # of a sum beyond 3.96 (a = 3.96 + 1 / 3.96 in the mean) an input of weight w has the mean w a
    assert rows[0]["mean_sigma"] == pytest.approx(4.19 * 2.0 / np.sqrt(4.0 + 1.0 + 0.25 + _squares()), rel=0.25)


def _squares():
    return float((np.linspace(0.2, 1.0, SPANS) ** 2).sum())


def test_nats_of_a_shift_and_of_a_spread():
    assert nats(np.array(2.0), np.array(1.0)) == pytest.approx(2.0)
    assert nats(np.array(0.0), np.array(2.0)) == pytest.approx(0.5 * (4.0 - 1.0 - np.log(4.0)))
    mean, spread = moments(np.array([[0.0], [4.0]]), np.array([3.0, 1.0]))
    assert (mean[0], spread[0]) == pytest.approx((1.0, np.sqrt(3.0)))
