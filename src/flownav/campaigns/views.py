"""Views of a cell's flights: how a figure settled as they flew, where in the wind they landed, which inputs matter."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flownav.campaigns.figures import figure_of
from flownav.scoring.percentiles import share_with_interval

Array = NDArray[np.float64]

SPEED, DIRECTION = "wind.speed_20ft_m_s", "wind.from_direction_deg"
SECTORS, RINGS = 8, 4
POINTS = 24  # of a convergence
LEAST = 8  # flights, before a figure is drawn
SHOWN = 12  # inputs


def convergence(figure: str, values: Array) -> list[dict[str, float | None]]:
    """The figure and its interval after the first 8, ... flights, spaced evenly by their logarithm."""
    if len(values) < LEAST:
        return []
    after = np.unique(np.geomspace(LEAST, len(values), POINTS).round().astype(int))
    return [{"flights": int(count)} | figure_of(figure, values[:count]).finite() for count in after]


def envelope(inputs: Mapping[str, Array], landed: NDArray[np.bool_]) -> list[dict[str, Any]]:
    """The share that landed by the wind that was drawn: rings of equal numbers of flights, sectors of 45 degrees.

    Empty where speed and direction are not both drawn, or always the same.
    """
    if SPEED not in inputs or DIRECTION not in inputs or len(landed) < LEAST * RINGS or np.ptp(inputs[SPEED]) == 0.0:
        return []
    speed, direction = inputs[SPEED], inputs[DIRECTION] % 360.0
    edges, width = np.quantile(speed, np.linspace(0.0, 1.0, RINGS + 1)), 360.0 / SECTORS
    edges[0] = 0.0
    ring = np.clip(np.searchsorted(edges, speed, side="right") - 1, 0, RINGS - 1)
    sector = np.floor((direction + 0.5 * width) / width).astype(int) % SECTORS
    found = []
    for k in range(RINGS):
        for s in range(SECTORS):
            own = landed[(ring == k) & (sector == s)]
            share = share_with_interval(int(own.sum()), len(own)) if len(own) else (None, None, None)
            found.append(
                {
                    "from_m_s": float(edges[k]),
                    "to_m_s": float(edges[k + 1]),
                    "direction_deg": s * width,
                    "flights": len(own),
                    **dict(zip(("landed", "low", "high"), share, strict=True)),
                }
            )
    return found


def sensitivity(inputs: Mapping[str, Array], values: Array) -> list[dict[str, Any]]:
    """Inputs by the rank correlation of what was drawn with the measure, the strongest first, with a 95 % interval.

    Spearman's coefficient, its interval by Fisher's transformation with Bonett and Wright's variance (Psychometrika 65,
    2000); infinite measures rank last. It sees what is monotonic only; `flownav certify` gives Sobol's indices.
    """
    if len(values) < LEAST or not inputs:
        return []
    from scipy.stats import rankdata  # not without need: it takes 40 MB

    ranks = rankdata(values)
    found: list[tuple[float, dict[str, Any]]] = []
    for name, drawn in inputs.items():
        if np.ptp(drawn) == 0.0 or np.ptp(ranks) == 0.0:
            continue
        rho = float(np.corrcoef(rankdata(drawn), ranks)[0, 1])
        reach = 1.96 * np.sqrt((1.0 + 0.5 * rho**2) / max(len(values) - 3, 1))
        middle = np.arctanh(np.clip(rho, -1.0 + 1e-12, 1.0 - 1e-12))
        low, high = (float(np.tanh(middle + side * reach)) for side in (-1.0, 1.0))
        found.append((abs(rho), {"input": name, "rank_correlation": rho, "low": low, "high": high}))
    return [one for _, one in sorted(found, key=lambda each: -each[0])][:SHOWN]
