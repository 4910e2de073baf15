"""Sobol indices: Ishigami's function to 0.02, SciPy's own estimate, groups, ranks, and intervals that hold."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import sobol_indices

from flownav.campaigns.ranking import NOISE, bounded, flights_of, indices_of, points_of, rank
from flownav.core.parameter_files import load, shipped
from flownav.simulation.dispersion import SHIPPED_FILE, DispersionFile, Distribution, uniforms

EVEN = {"distribution": "uniform", "loc": -np.pi, "scale": 2.0 * np.pi}
ENTRIES = {
    "x1": Distribution(**EVEN, known="build"),
    "x2": Distribution(**EVEN, known="day"),
    "x3": Distribution(**EVEN),
}
# analytic: a = 7, b = 0.1 (Saltelli and others, Global Sensitivity Analysis, 2008, section 4.9)
VARIANCE = 49.0 / 8.0 + 0.1 * np.pi**4 / 5.0 + 0.01 * np.pi**8 / 18.0 + 0.5
FIRST = np.array([0.5 * (1.0 + 0.1 * np.pi**4 / 5.0) ** 2, 49.0 / 8.0, 0.0]) / VARIANCE
THIRD_WITH_FIRST = 0.01 * np.pi**8 * (1.0 / 18.0 - 1.0 / 50.0) / VARIANCE
TOTAL = FIRST + np.array([THIRD_WITH_FIRST, 0.0, THIRD_WITH_FIRST])


def ishigami(x):
    return np.sin(x[0]) + 7.0 * np.sin(x[1]) ** 2 + 0.1 * x[2] ** 4 * np.sin(x[0])


def flown(design, first, n, function=ishigami, entries=ENTRIES):
    flights = range(first, first + n)
    return function([entry.frozen().ppf(design.uniforms(1, flights, name)) for name, entry in entries.items()])


def by_name(indices):
    return {index.input: index for index in indices}


@pytest.fixture(scope="module")
def ranking():
    return rank(ENTRIES, 1, 8192, flown)


def test_ishigamis_indices_are_the_analytic_ones(ranking):
    found = by_name(ranking.inputs)
    for k, name in enumerate(ENTRIES):
        assert found[name].first == pytest.approx(FIRST[k], abs=0.02)
        assert found[name].total == pytest.approx(TOTAL[k], abs=0.02)
        assert found[name].first_interval[0] <= FIRST[k] <= found[name].first_interval[1]
        assert found[name].total_interval[0] <= TOTAL[k] <= found[name].total_interval[1]
    assert [index.input for index in ranking.inputs] == ["x1", "x2", "x3", NOISE]
    assert found[NOISE].total == 0.0
    assert ranking.of == "values"
    assert ranking.flights == flights_of(3, 8192) == 8192 * 9


def test_they_agree_with_scipys(ranking):
    scipys = sobol_indices(func=ishigami, n=8192, dists=[entry.frozen() for entry in ENTRIES.values()], rng=1)
    found = by_name(ranking.inputs)
    np.testing.assert_allclose([found[name].first for name in ENTRIES], scipys.first_order, atol=0.02)
    np.testing.assert_allclose([found[name].total for name in ENTRIES], scipys.total_order, atol=0.02)


def test_the_classes_are_groups_of_inputs(ranking):
    build, day, never = ranking.classes
    assert (build.input, day.input, never.input) == ("build", "day", "never")
    assert build.first == pytest.approx(FIRST[0], abs=0.02)
    assert day.total == pytest.approx(TOTAL[1], abs=0.02)
    together = {"x1": ENTRIES["x1"], "x2": ENTRIES["x2"], "x3": Distribution(**EVEN, known="build")}
    build, day, _ = rank(together, 1, 4096, flown).classes
    assert build.first == pytest.approx(FIRST[0] + THIRD_WITH_FIRST, abs=0.03)  # closed: with what they do together
    assert build.first + day.first == pytest.approx(1.0, abs=0.03)


def test_the_flights_own_noise_is_one_more_input_by_the_flights_numbers():
    def noisy(design, first, n):
        noise = uniforms(3, range(first, first + n), "noise of these flights") - 0.5
        return flown(design, first, n, lambda x: np.sin(x[0]) + 2.0 * noise)

    found = by_name(rank(ENTRIES, 1, 4096, noisy).inputs)
    share = (4.0 / 12.0) / (4.0 / 12.0 + 0.5)
    assert found[NOISE].first == pytest.approx(share, abs=0.03)
    assert found[NOISE].total == pytest.approx(share, abs=0.03)
    assert found["x1"].first == pytest.approx(1.0 - share, abs=0.03)
    assert found["x2"].total == pytest.approx(0.0, abs=1e-12)


def test_intervals_hold_the_truth_about_as_often_as_they_say():
    inside = []
    for seed in range(20):
        points = np.random.default_rng(seed).random((2, 256, 3))
        x = -np.pi + 2.0 * np.pi * points
        swapped = [np.where(np.arange(3) == k, x[1], x[0]) for k in range(3)]
        a, b, *ab = (ishigami(sample.T) for sample in (x[0], x[1], *swapped))
        for k, index in enumerate(indices_of(a, b, np.array(ab), tuple(ENTRIES), seed)):
            inside.append(index.total_interval[0] <= TOTAL[k] <= index.total_interval[1])
    assert np.mean(inside) >= 0.8


def test_infinite_and_far_off_outcomes_are_ranked_and_alike_ones_are_nothing():
    a, b, c = np.array([1.0, 2.0, np.inf]), np.array([0.0, np.inf, 3.0]), np.array([np.inf, -1.0, 2.0])
    (one, two, three), of = bounded([a, b, c])
    assert of == "ranks"
    np.testing.assert_allclose(one, np.array([1.5, 2.5, 5.0]) / 6.0)
    np.testing.assert_allclose(two, np.array([0.5, 5.0, 3.5]) / 6.0)
    np.testing.assert_allclose(three, np.array([5.0, 0.0, 2.5]) / 6.0)
    far = np.r_[np.linspace(0.0, 1.0, 99), 1e3]
    assert bounded([far, far[::-1]])[1] == "ranks"
    same, of = bounded([np.ones(4), np.ones(4), np.ones(4)])
    assert of == "nothing"
    assert not np.any(same)
    nothing = rank(ENTRIES, 1, 16, lambda design, first, n: np.full(n, np.inf))
    assert nothing.of == "nothing"
    assert all(index.total == index.first == 0.0 for index in (*nothing.inputs, *nothing.classes))


def test_samples_are_a_scrambled_sequence_of_their_own_and_rows_a_power_of_two():
    points = points_of(1, 64, 5)
    assert points.shape == (2, 64, 5)
    assert ((points > 0.0) & (points < 1.0)).all()
    assert sorted((points[0, :, 0] * 64).astype(int)) == list(range(64))  # one in every sixty-fourth
    assert not np.array_equal(points, points_of(2, 64, 5))
    for rows in (0, 8, 48):
        with pytest.raises(ValueError, match="a power of 2"):
            rank(ENTRIES, 1, rows, flown)


def test_every_shipped_entry_says_who_could_know_it():
    file = load(shipped(SHIPPED_FILE), DispersionFile)
    assert all("known" in entry.model_fields_set for entry in file.dispersion.parameters.values())
    classes = {entry.known for entry in file.dispersion.parameters.values()}
    assert classes == {"build", "day", "never"}
    assert file.dispersion.parameters["wind.speed_20ft_m_s"].known == "day"
    assert Distribution(distribution="norm").known == "never"
