"""The estimate's error where the record holds a truth: what plots of other tools show, as a table of its own."""

from __future__ import annotations

import numpy as np

from flownav.core.record import POSITION_NED, Record, Table
from flownav.export.trajectory import Trajectory

SIGMAS = 3.0
ERROR = ("error_n_m", "error_e_m", "error_d_m")
BOUND = ("three_sigma_n_m", "three_sigma_e_m", "three_sigma_d_m")


def error_table(record: Record, paths: list[Trajectory]) -> Table | None:
    """Estimate less truth [m] at the estimate's instants inside the truth's time, and three standard deviations.

    Columns t_s, ERROR, and BOUND where the record states them. None without an estimate, a truth, or an instant that
    both have.
    """
    named = {path.name: path for path in paths}
    if not {"estimate", "truth"} <= named.keys():
        return None
    estimate, truth = named["estimate"], named["truth"]
    inside = (estimate.t_s >= truth.t_s[0]) & (estimate.t_s <= truth.t_s[-1])
    if not inside.any():
        return None
    t_s = estimate.t_s[inside]
    table: Table = {"t_s": t_s}
    for k, name in enumerate(ERROR):
        table[name] = estimate.position_m[inside, k] - np.interp(t_s, truth.t_s, truth.position_m[:, k])
    columns = tuple(f"std_{name}" for name in POSITION_NED)
    if set(columns) <= record.tables["estimate"].keys():
        spread = record.matrix("estimate", columns)[estimate.row][inside]
        table |= {name: SIGMAS * spread[:, k] for k, name in enumerate(BOUND)}
    return table
