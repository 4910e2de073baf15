"""Statistics on a campaign's pages: the wind's sectors and rings, rank correlations, convergence."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from flownav.campaigns.summary import (
    CONVERGENCE_POINTS,
    DIRECTION,
    LEAST,
    RINGS,
    SECTORS,
    SPEED,
    convergence,
    envelope,
    ranked,
    sensitivity,
)
from flownav.scoring.percentiles import share_with_interval


# -- the wind's rose ----------------------------------------------------------------------------------------------
def sector_of(direction_deg: float) -> float:
    """The direction under which a page shows the only flights that did not land, in degrees."""
    speed, direction = np.tile(np.linspace(1.0, 9.0, 40), 2), np.full(80, direction_deg + 180.0)
    direction[:40] = direction_deg
    landed = np.ones(80, bool)
    landed[:40] = False
    found = {row["direction_deg"] for row in envelope({SPEED: speed, DIRECTION: direction}, landed)
             if row["flights"] and row["landed"] == 0.0}  # fmt: skip
    assert len(found) == 1
    return found.pop()


@pytest.mark.parametrize("middle_deg", [0.0, 45.0, 90.0, 135.0, 270.0, 315.0])
def test_a_sector_reaches_half_its_width_to_either_side_of_its_direction(middle_deg):
    for off_deg in (-22.4, -10.0, 0.0, 10.0, 22.4, 360.0, -360.0):
        assert sector_of(middle_deg + off_deg) == middle_deg
    assert sector_of(middle_deg + 22.6) == (middle_deg + 45.0) % 360.0
    assert sector_of(middle_deg - 22.6) == (middle_deg - 45.0) % 360.0


def test_rings_hold_equal_numbers_of_flights_and_every_flight_is_in_one_sector():
    rng = np.random.default_rng(3)
    speed, direction = rng.uniform(2.0, 12.0, 400), rng.uniform(0.0, 360.0, 400)
    landed = speed < 10.0
    rows = envelope({SPEED: speed, DIRECTION: direction}, landed)
    assert len(rows) == RINGS * SECTORS
    for ring, (first, last) in enumerate(zip(range(0, 400, 100), range(100, 401, 100), strict=True)):
        own = rows[ring * SECTORS : (ring + 1) * SECTORS]
        assert sum(row["flights"] for row in own) == 100
        landings = sum(round(row["landed"] * row["flights"]) for row in own if row["flights"])
        assert landings == np.count_nonzero(np.sort(speed)[first:last] < 10.0)
        assert len({(row["from_m_s"], row["to_m_s"]) for row in own}) == 1
    assert rows[0]["from_m_s"] == 0.0
    assert rows[-1]["to_m_s"] == speed.max()
    for row in rows:
        expected = share_with_interval(round(row["landed"] * row["flights"]), row["flights"])
        assert (row["landed"], row["low"], row["high"]) == expected


# -- what matters -------------------------------------------------------------------------------------------------
def correlated(flights: int, weight: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    drawn = rng.normal(size=flights)
    return drawn, weight * drawn + rng.normal(size=flights)


@pytest.mark.parametrize(("flights", "weight"), [(12, 0.5), (40, -2.0), (300, 0.1)])
def test_the_interval_of_a_rank_correlation_is_bonett_and_wrights(flights, weight):
    """tanh(artanh r -+ 1.96 sqrt((1 + r^2 / 2) / (n - 3))), Psychometrika 65 (2000), equation 3; r as SciPy has it."""
    drawn, value = correlated(flights, weight)
    (row,) = sensitivity({"x": drawn}, value)
    rho = stats.spearmanr(drawn, value).statistic
    reach = stats.norm.ppf(0.975) * np.sqrt((1.0 + rho * rho / 2.0) / (flights - 3))
    assert row["rank_correlation"] == pytest.approx(rho)
    assert row["low"] == pytest.approx(np.tanh(np.arctanh(rho) - reach), abs=1e-4)
    assert row["high"] == pytest.approx(np.tanh(np.arctanh(rho) + reach), abs=1e-4)


def test_the_interval_holds_a_strong_rank_correlation_in_nineteen_of_twenty():
    """Of normal variables Spearman's coefficient is 6 / pi asin(r / 2): the interval holds it about as often as asked.

    Fisher's plain variance is too narrow for that (89 of 100 here), and the term with its sign turned more so (83).
    """
    weight, trials = 2.0, 600
    true = 6.0 / np.pi * np.arcsin(0.5 * weight / np.hypot(1.0, weight))
    inside = 0
    for seed in range(trials):
        (row,) = sensitivity({"x": (pair := correlated(40, weight, seed))[0]}, pair[1])
        inside += row["low"] <= true <= row["high"]
    assert 0.93 <= inside / trials <= 0.98


def test_inputs_are_named_by_the_size_of_their_correlation_and_a_constant_is_left_out():
    drawn, value = correlated(60, -3.0)
    weak, _ = correlated(60, 0.0, seed=9)
    rows = sensitivity({"weak": weak, "same": np.ones(60), "strong": drawn}, value)
    assert [row["input"] for row in rows] == ["strong", "weak"]
    assert rows[0]["rank_correlation"] < 0.0
    assert sensitivity({"x": drawn[: LEAST - 1]}, value[: LEAST - 1]) == []


def test_ranks_are_scipys_with_equal_numbers_and_infinite_ones():
    for values in ([3.0, 1.0, 1.0, 2.0, 1.0, 9.0], [np.inf, 0.0, np.inf, -1.0], [5.0], [2.0] * 4):
        np.testing.assert_array_equal(ranked(np.array(values)), stats.rankdata(values))
    assert np.isnan(ranked(np.array([1.0, np.nan]))).all()


def test_a_convergence_is_of_the_first_flights_and_ends_with_all():
    values = np.concatenate([np.ones(50), np.zeros(150)])  # the first did not land
    rows = convergence("landed", values)
    counts = [row["flights"] for row in rows]
    assert (counts[0], counts[-1]) == (LEAST, 200)
    assert len(counts) <= CONVERGENCE_POINTS
    assert counts == sorted(set(counts))
    for row in rows:
        count = int(row["flights"])
        assert row["value"] == pytest.approx(max(0.0, count - 50) / count)
    reach = [row["high"] - row["low"] for row in rows if row["flights"] > 100]
    assert reach == sorted(reach, reverse=True)
