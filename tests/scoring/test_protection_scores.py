"""Protection levels against errors."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.scoring.reference import Drift, protection_of, unwarned_share

T_S = np.arange(0.0, 10.0, 1.0)
LEVELS_M = np.column_stack([np.full(10, 2.0), np.full(10, 1.0)])
QUIET = np.zeros(10, bool)


def drift(*horizontal_m: float) -> Drift:
    error = np.array(horizontal_m)
    return Drift(np.arange(len(error)) + 0.5, error, 0.0 * error)


def test_the_share_is_of_instants_that_are_beyond_and_not_flagged():
    off = drift(0.0, 3.0, 1.9, 2.1)
    assert unwarned_share(T_S, LEVELS_M[:, 0], QUIET, off) == 0.5
    said = QUIET.copy()
    said[1] = True
    assert unwarned_share(T_S, LEVELS_M[:, 0], said, off) == 0.25


def test_a_level_that_is_no_number_protects_from_nothing():
    assert unwarned_share(T_S, np.full(10, np.nan), QUIET, drift(0.0, 0.1)) == 1.0


def test_the_newest_level_counts():
    rising = np.arange(10.0)
    assert unwarned_share(T_S, rising, QUIET, drift(0.5, 0.5, 1.5)) == pytest.approx(1.0 / 3.0)


def test_median_95_percent_and_the_flagged_share():
    levels = LEVELS_M * np.linspace(1.0, 2.0, 10)[:, None]
    flagged = QUIET.copy()
    flagged[:3] = True
    found = protection_of(T_S, levels, flagged, None)
    assert found is not None
    assert found["horizontal_m"] == {
        "median": pytest.approx(3.0), "p95": pytest.approx(np.percentile(levels[:, 0], 95.0))
    }  # fmt: skip
    assert found["vertical_m"]["median"] == pytest.approx(1.5)
    assert found["flagged_fraction"] == pytest.approx(0.3)
    assert found["exceeded_unsaid_fraction"] is None


def test_without_levels_there_is_nothing_to_say():
    assert protection_of(T_S, LEVELS_M * np.nan, QUIET, None) is None
