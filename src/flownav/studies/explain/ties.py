"""The flow's velocity laid over GPS's: the turn, the gain and the likeness between the two."""

from typing import NamedTuple

import numpy as np

from flownav.core.measurement import Array
from flownav.studies.explain.aloft import Aloft
from flownav.studies.explain.signals import (
    gap_near,
)

TIE_SMOOTH_S, TIE_LAGS_S, MOVING_M_S, LEAST_MOVING_S = 0.8, np.arange(-0.2, 1.2, 0.04), 0.5, 8.0


class Tie(NamedTuple):
    """The flow's velocity over GPS's: turn [rad] about down, gain with standard error, likeness, and how sure.

    heading_too: a turn of the flow and one of the heading look the same here.
    """

    turn_rad: float
    mirrored: bool
    gain: float
    gain_sigma: float
    likeness: float
    significance: float
    against_gps: bool = True


def tie_of(case: Aloft, t_s: Array, body: Array) -> Tie | None:
    """Flow (n, 2) forward and right against GPS velocity, as complex numbers, at the best lag; None without motion."""
    assert case.gps_velocity is not None
    gps_s, gps = case.gps_velocity
    level = case.rotation(t_s)
    found = []
    mine = gap_near(t_s, gps_s) < 0.5
    rows = max(1, round(TIE_SMOOTH_S / max(float(np.median(np.diff(t_s))), 1e-3)))
    for mirror in (1.0, -1.0):
        u, v = body[:, 0], mirror * body[:, 1]
        earth = (level[0] * u + level[1] * v) + 1j * (level[3] * u + level[4] * v)
        smooth = np.convolve(earth, np.ones(rows) / rows, "same")
        limit = 2.5 * max(float(np.quantile(np.abs(gps[:, 0] + 1j * gps[:, 1]), 0.98)), 0.5)
        smooth = np.where(np.abs(smooth) > limit, limit * smooth / np.maximum(np.abs(smooth), 1e-9), smooth)
        for lag in TIE_LAGS_S:
            flow = np.interp(gps_s - lag, t_s, smooth)
            reference = gps[:, 0] + 1j * gps[:, 1]
            kept = mine & ((np.abs(reference) > MOVING_M_S) | (np.abs(flow) > MOVING_M_S))
            kept &= (gps_s >= case.flight_s[0] + 1.0) & (gps_s <= case.flight_s[1] - 1.0)
            if kept.sum() < 20:
                return None
            f, g = flow[kept], reference[kept]
            power = float(np.sqrt(np.sum(np.abs(f) ** 2) * np.sum(np.abs(g) ** 2)))
            cross = complex(np.sum(f * np.conj(g)))
            ratio = float(np.sqrt(np.sum(np.abs(f) ** 2) / np.sum(np.abs(g) ** 2)))
            found.append((abs(cross) / max(power, 1e-9), cross, ratio, mirror, int(kept.sum())))
    likeness, cross, ratio, mirror, count = max(found, key=lambda one: one[0])
    period = float(np.median(np.diff(gps_s)))
    seconds = count * period
    if seconds < LEAST_MOVING_S:
        return None
    independent = max(seconds / 2.0, 3.0)
    error = float(np.sqrt(max(1.0 - likeness**2, 1e-4) / independent) / max(likeness, 0.05))
    return Tie(
        float(np.angle(cross)), mirror < 0.0, ratio * likeness**0.5, ratio * (error + 0.04), likeness, 1.0 / error
    )
