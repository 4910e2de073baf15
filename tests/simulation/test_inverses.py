"""The usual distributions and ranks are SciPy's to the last bit, and do not import its statistics."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from scipy import stats

from flownav.campaigns.summary import ranked
from flownav.simulation.dispersion import Distribution
from flownav.simulation.inverses import FAMILIES, Inverse

KNOWN = [
    ("norm", {}),
    ("uniform", {}),
    ("lognorm", {"s": 0.3}),
    ("lognorm", {"s": 2.0}),
    ("loguniform", {"a": 0.1, "b": 7.0}),
    ("beta", {"a": 0.203, "b": 2.981}),
    ("beta", {"a": 4.0, "b": 2.0}),
    ("truncnorm", {"a": -2.0, "b": 3.0}),
    ("truncnorm", {"a": -0.001, "b": 5.0}),
    ("truncnorm", {"a": -30.0, "b": 0.2}),
]


@pytest.mark.parametrize(("loc", "scale"), [(0.0, 1.0), (3.0, 0.5), (-1000.0, 1e-4)])
@pytest.mark.parametrize(("name", "shapes"), KNOWN)
def test_numbers_are_scipys(name, shapes, loc, scale):
    ours = Distribution(distribution=name, loc=loc, scale=scale, **shapes).frozen()
    scipys = getattr(stats, name)(**shapes, loc=loc, scale=scale)
    assert isinstance(ours, Inverse)
    assert ours.support() == scipys.support()
    rng = np.random.default_rng(3)
    for count in (1, 2, 7, 64, 1000):
        shares = rng.uniform(size=count)
        np.testing.assert_array_equal(ours.ppf(shares), scipys.ppf(shares))
    edges = np.array([0.0, 1e-300, 2.0**-53, 0.5, 1.0 - 2.0**-53, 1.0, -0.1, 1.1, np.nan])
    np.testing.assert_array_equal(ours.ppf(edges), scipys.ppf(edges))
    assert ours.ppf(0.3) == scipys.ppf(0.3)


@pytest.mark.parametrize(
    ("name", "shapes", "said"),
    [
        ("lognorm", {"s": -1.0}, "cannot be with"),
        ("lognorm", {}, "has the shape parameters s"),
        ("norm", {"s": 1.0}, "has the shape parameters none"),
        ("loguniform", {"a": 2.0, "b": 1.0}, "cannot be with"),
        ("truncnorm", {"a": 1.0, "b": 1.0}, "cannot be with"),
    ],
)
def test_what_cannot_be_is_refused_in_scipys_words(name, shapes, said):
    with pytest.raises(ValueError, match=said):
        Distribution(distribution=name, **shapes).frozen()


@pytest.mark.parametrize(("name", "shapes"), [("gamma", {"a": 2.0}), ("truncnorm", {"a": 0.5, "b": 2.0})])
def test_others_are_scipys_own(name, shapes):
    found = Distribution(distribution=name, **shapes).frozen()
    assert not isinstance(found, Inverse)
    assert found.ppf(0.3) == getattr(stats, name)(**shapes).ppf(0.3)


def test_ranks_are_scipys():
    rng = np.random.default_rng(5)
    some = np.array([np.inf, 1.0, np.inf, -np.inf, 0.0, -0.0])
    for values in (rng.normal(size=100), rng.integers(0, 9, 50).astype(float), some, np.array([2.0])):
        np.testing.assert_array_equal(ranked(values), stats.rankdata(values))
    np.testing.assert_array_equal(ranked(np.array([1.0, np.nan])), stats.rankdata([1.0, np.nan]))


def test_a_shipped_ensemble_needs_no_statistics_of_scipy():
    script = (
        "import sys\n"
        "from flownav.simulation.dispersion import DispersionSection\n"
        "kinds = {entry.distribution for entry in DispersionSection().entries().values() if entry.frozen()}\n"
        "assert 'scipy.stats' not in sys.modules\n"
        "print(*sorted(kinds))"
    )
    done = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True)
    assert set(done.stdout.split()) <= set(FAMILIES)
