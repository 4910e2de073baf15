"""How far off the position may be if a sensor fails unseen: protection levels, and the error where it is known."""

from __future__ import annotations

import numpy as np

from flownav.core.record import POSITION_NED, PROTECTION_LEVELS, Record
from flownav.report.chart import Stack
from flownav.report.panels import Panel
from flownav.report.series import difference, moments, outages, start_end_s, track


def protection(record: Record) -> list[Panel]:
    """Protection levels over time, horizontal and vertical; no panel where none were recorded."""
    levels = track(record, "estimate", PROTECTION_LEVELS)
    if levels is None or not np.isfinite(levels.value).any():
        return []
    truth, estimate = track(record, "truth", POSITION_NED), track(record, "estimate", POSITION_NED)
    stack = Stack(("horizontal (m)", "vertical (m)"), row_height_px=190)
    for row in (1, 2):
        stack.line(row, "command", "protection level", levels.t_s, levels.value[:, row - 1])
    if truth is not None and estimate is not None:
        apart = difference(estimate, truth)
        stack.line(1, "estimate", "error", apart.t_s, np.hypot(*apart.value[:, :2].T))
        stack.line(2, "estimate", "error", apart.t_s, np.abs(apart.value[:, 2]))
    stack.from_zero()
    middle = np.nanmedian(levels.value, axis=0)
    title = "Protection levels"
    caption = (
        "How far off the position may be although nothing is noticed: the filter's own error, or what a flow of wrong "
        "sign, axes, scale or age, a range, GPS or heading that is off, or an accelerometer that lies may have done so "
        f"far. In the median {middle[0]:.2f} m horizontally, {middle[1]:.2f} m vertically."
    )
    figure = stack.chart(start_end_s(record), moments(record), outages(record))
    return [Panel("protection", title, caption, f"{title} over time. {caption}", figure, wide=True)]
