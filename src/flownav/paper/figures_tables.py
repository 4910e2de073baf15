"""Tables 1 and 2 as pictures: fit and error against height, gain against delay, fit against order."""

from __future__ import annotations

from typing import Any

import numpy as np

from flownav.paper import plots, published
from flownav.paper.laboratory import Laboratory, delay_s
from flownav.paper.plots import HERE, PAPER
from flownav.paper.published import HEIGHTS_M, ErrorRow
from flownav.report.panels import Panel

APART_M = 0.008  # the paper's dots to the left, ours to the right
RING: dict[str, Any] = {"size": 8, "symbol": "circle-open", "line": {"width": 1.6}}
LAW = "2px,3px"
ORDER_NAMES = ("gain, delay", "1", "2", "3", "4")


def fit_by_height(laboratory: Laboratory) -> Panel:
    """Fits of the paper and of the rig, the other configurations, and the paper's law."""
    fine = np.linspace(0.52, 1.58, 60)
    table, runs = published.table_1(), laboratory.runs
    traces = [
        plots.line("0.90 √(0.6/h)", "muted", fine, [published.accuracy_law(h) for h in fine], dash=LAW),
        *(
            plots.line(other.name, colour, list(fits), list(fits.values()), dash="7px,4px", width=1.2)
            for (other, fits), colour in zip(laboratory.others, ("flow", "pad", "autopilot"), strict=False)
        ),
        plots.dots("paper", PAPER, [m.height_m - APART_M for m in table], [m.fit_percent for m in table], **RING),
        plots.dots("here", HERE, [r.height_m + APART_M for r in runs], [r.fits[2].fit_percent for r in runs]),
    ]
    caption = "28 models each. Dashed: other configurations of the rig, one run a height; dotted: the paper's own rule."
    figure = plots.figure(traces, "height (m)", "fit (%)", xaxis=plots.heights_axis())
    return Panel("fit-height", "Fit against height", caption, caption, figure)


def gain_and_delay(laboratory: Laboratory) -> Panel:
    """a/c against b/c of every model, published and reproduced."""
    traces = []
    for height in HEIGHTS_M:
        rows = [model for model in published.table_1() if model.height_m == height]
        symbol = plots.HEIGHT_SYMBOLS[height]
        traces.append(
            plots.dots(
                f"paper, {height:.1f} m",
                PAPER,
                [1e3 * m.delay_s for m in rows],
                [m.gain for m in rows],
                symbol=f"{symbol}-open",
                size=9,
                line={"width": 1.6},
            )
        )
    for height in HEIGHTS_M:
        runs, symbol = laboratory.at(height), plots.HEIGHT_SYMBOLS[height]
        traces.append(
            plots.dots(
                f"here, {height:.1f} m",
                HERE,
                [1e3 * delay_s(r) for r in runs],
                [r.fits[2].point.gain for r in runs],
                symbol=symbol,
                size=8,
            )
        )
    caption = "What a slow velocity meets: gain a/c and delay b/c, the two numbers that a swing can tell."
    figure = plots.figure(traces, "delay b/c (ms)", "gain a/c", 400)
    return Panel("gain-delay", "Gain and delay of every model", caption, caption, figure)


def orders(laboratory: Laboratory) -> list[Panel]:
    """Fit against order, for the paper's swing and for a chirp."""
    panels = []
    for kind, words in (
        ("swing", "Seven runs a height, mean. A swing is one tone: every order fits it alike."),
        ("chirp", "One run a height, 0.3 to 4 Hz: here orders differ."),
    ):
        tests = [test for test in laboratory.orders if test.kind == kind]
        traces = [
            plots.line(
                f"{t.height_m:.1f} m",
                plots.HEIGHT_COLOURS[t.height_m],
                list(t.fits),
                list(t.fits.values()),
                markers=True,
            )
            for t in tests
        ]
        axes: dict[str, dict[str, Any]] = {
            "xaxis": {"tickvals": list(range(5)), "ticktext": list(ORDER_NAMES), "range": [-0.3, 4.3]},
            "yaxis": {"range": [50, 95]},
        }
        title = f"Fit against order: {kind}"
        panels.append(
            Panel(
                f"orders-{kind}",
                title,
                words,
                f"{title}. {words}",
                plots.figure(traces, "order of the model", "fit (%)", 340, **axes),
            )
        )
    return panels


def error_by_height(ours: list[ErrorRow]) -> Panel:
    """Standard deviation of the validation error against height (Table 2)."""
    fine = np.linspace(0.55, 1.55, 40)
    table = published.table_2()
    traces = [
        plots.line("0.035 (h/0.6)^2.06", "muted", fine, 0.0350 * (fine / 0.6) ** 2.06, dash=LAW),
        plots.dots("paper", PAPER, [r.height_m - APART_M for r in table], [r.std_error for r in table], **RING),
        plots.dots("here", HERE, [r.height_m + APART_M for r in ours], [r.std_error for r in ours]),
    ]
    caption = "Table 2. Dotted: the power law through the paper's means, which the shipped sensor file uses."
    figure = plots.figure(
        traces,
        "height (m)",
        "standard deviation (m/s)",
        xaxis=plots.heights_axis(),
        yaxis={"type": "log", "tickvals": [0.02, 0.03, 0.05, 0.1, 0.2, 0.3]},
    )
    return Panel("error-height", "Validation error against height", caption, caption, figure)
