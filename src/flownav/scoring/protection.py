"""Protection levels against errors: how large they are, and how often the error is larger and nothing says so."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Array
from flownav.scoring.drift import Drift


def protection_of(
    t_s: Array, levels_m: Array, flagged: NDArray[np.bool_], drift: Drift | None
) -> dict[str, Any] | None:
    """Levels of a flight, and the share of instants at which the horizontal error exceeds them unsaid.

    t_s (n,), levels_m (n, 2) horizontal and vertical, flagged (n,): whether a warning stands. The share is None
    without a truth; the whole is None where no level was computed.
    """
    known = np.isfinite(levels_m).all(axis=1)
    if not known.any():
        return None
    return {
        "horizontal_m": _summary(levels_m[known, 0]),
        "vertical_m": _summary(levels_m[known, 1]),
        "flagged_fraction": float(flagged[known].mean()),
        "exceeded_unsaid_fraction": None if drift is None else exceeded_unsaid(t_s, levels_m[:, 0], flagged, drift),
    }


def exceeded_unsaid(t_s: Array, level_m: Array, flagged: NDArray[np.bool_], drift: Drift) -> float:
    """The share of the truth's instants at which the error is above the newest level and no warning stands.

    A level that is no number protects from nothing.
    """
    newest = np.clip(np.searchsorted(t_s, drift.t_s, side="right") - 1, 0, len(t_s) - 1)
    return float(np.mean(~(drift.horizontal_m <= level_m[newest]) & ~flagged[newest]))


def _summary(level_m: Array) -> dict[str, float]:
    return {"median": float(np.median(level_m)), "p95": float(np.percentile(level_m, 95.0))}
