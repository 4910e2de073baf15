"""Rows of Tables 1 to 3 and of the tables about the rig, as text for the page and the terminal."""

import re
from typing import Any, NamedTuple

import numpy as np

from flownav.lab.optics.firmware import EARLY_GYRO_SCALE
from flownav.lab.rig.pendulum import DAMPING_1_S, largest_speed
from flownav.paper import published
from flownav.paper.findings import FIT_TOLERANCE
from flownav.paper.laboratory import Identified, Laboratory, Run, delay_s, identified
from flownav.paper.published import HEIGHTS_M, RELATION_FITS
from flownav.paper.reproduction import Reproduction
from flownav.report.panels import listed, number
from flownav.sensors.datasheet import Dynamics

NUMBER_AND_UNIT = re.compile(r"(\d) (m/s|ms|rad/s|points|cm|m|s|%)(?![A-Za-z])")
MINUS_SIGN = re.compile(r"(?<![\w)])-(?=\d)")


class Pair(NamedTuple):
    """The paper's figure and ours, as text."""

    paper: str
    here: str


class TableRow(NamedTuple):
    """A row of a table: its head, then its cells."""

    head: str
    cells: list[Any]


class Group(NamedTuple):
    """Rows of one height, and their mean."""

    title: str
    rows: list[TableRow]


# -- Table 1 --------------------------------------------------------------------------------------------------
def model_groups(of: Reproduction) -> list[Group]:
    """Table 1 by height: fit, gain, delay, natural frequency and damping, paper and here."""
    if of.laboratory is None or 1 not in of.tables:
        return []
    groups = []
    for height in HEIGHTS_M:
        models = [model for model in published.table_1() if model.height_m == height]
        runs = of.laboratory.at(height)
        rows = [
            TableRow(str(model.model), _model_cells(model.fit_percent, model, run))
            for model, run in zip(models, runs, strict=True)
        ]
        mean = [
            Pair(_mean(m.fit_percent for m in models), _mean(r.fits[2].fit_percent for r in runs)),
            Pair(_mean((m.gain for m in models), 3), _mean((r.dynamics.gain for r in runs), 3)),
            Pair(_mean((1e3 * m.delay_s for m in models), 0), _mean((1e3 * delay_s(r) for r in runs), 0)),
        ]
        groups.append(Group(f"{height:.1f} m", [*rows, TableRow("mean", [*mean, Pair("", ""), Pair("", "")])]))
    return groups


def _model_cells(fit: float, model: Dynamics, run: Run) -> list[Pair]:
    ours = run.dynamics
    return [
        Pair(number(fit, 1), number(run.fits[2].fit_percent, 1)),
        Pair(number(model.gain, 3), number(ours.gain, 3)),
        Pair(number(1e3 * model.delay_s, 0), number(1e3 * delay_s(run), 0)),
        Pair(number(model.natural_frequency_rad_s, 1), number(ours.natural_frequency_rad_s, 1)),
        Pair(number(model.damping_ratio, 2), number(ours.damping_ratio, 2)),
    ]


def _mean(values: Any, digits: int = 1) -> str:
    return number(float(np.mean(list(values))), digits)


def configurations(of: Reproduction) -> list[tuple[str, str, list[tuple[str, bool]]]]:
    """Fits of the fixed configuration and of the others: name, words, (fit, whether within tolerance) by height."""
    laboratory = of.laboratory
    if laboratory is None or not laboratory.others:
        return []
    fixed = {height: laboratory.mean_fit(height) for height in HEIGHTS_M}
    every = [(laboratory.fixed, fixed), *laboratory.others]
    return [
        (c.name, c.words, [(number(fits[h], 1), abs(fits[h] - RELATION_FITS[h]) <= FIT_TOLERANCE) for h in HEIGHTS_M])
        for c, fits in every
    ]


def instrument_rows(of: Reproduction) -> list[tuple[str, str, list[str]]]:
    """Effect of gyro and sonar errors on the identification: name, words, gain, delay and fit by height.

    The first is the fixed configuration's first run of each height.
    """
    laboratory = of.laboratory
    if laboratory is None or not laboratory.instruments:
        return []
    as_is = {height: identified(laboratory.at(height)[0]) for height in HEIGHTS_M}
    every = [(laboratory.fixed.name, "as it is", as_is)]
    every += [(other.name, other.words, found) for other, found in laboratory.instruments]
    return [(name, words, [_identified_cell(found[height]) for height in HEIGHTS_M]) for name, words, found in every]


def _identified_cell(found: Identified) -> str:
    return f"{number(found.gain, 2)}, {number(1e3 * found.delay_s, 0)} ms, {number(found.fit_percent, 0)} %"


def set_up(of: Reproduction) -> list[tuple[str, str, str]]:
    """The fixed configuration: what, its value, why (docs/how-to/rig.md)."""
    if of.laboratory is None:
        return []
    s = of.laboratory.fixed.settings
    speed = largest_speed(s.start_angle_rad, s.pivot_height_m, HEIGHTS_M[0])
    build = "The paper says 250 Hz, which is before July 2014; its gains above 1 need the gyro compensation that this "
    build += "build has on, with its scale 12.8 % low."
    swing = "Not published. The amplitude sets the level of all fits (see the wider swing). It comes from a prototype "
    swing += "where it was free and the fits were compared with the paper's: the level is tuned, the fall with height "
    swing += "is not."
    lens = "\u201cWe make sure that the pattern is being seen clearly by adjusting the lens thread.\u201d"
    chain = "Microcontroller, serial port and board, not published: the paper's 71 to 120 ms less the sensor's 13 ms."
    length = (
        "Not published; chosen between 15 and 30 s after looking at the fits. A longer run fits worse, since the swing "
    )
    length += "dies away and the noise stays."
    moved = f"{s.start_angle_rad:g} rad, {speed:.2f} m/s at {HEIGHTS_M[0]:.1f} m; damping {DAMPING_1_S:g} 1/s"
    pad = "7 mm between lines is a pitch of 14 mm: a pitch of 7 mm aliases from 0.8 m up."
    return [
        ("Firmware", s.firmware, build),
        ("Pivot", f"{s.pivot_height_m:g} m above the pad", "Not published."),
        ("Swing", moved, swing),
        ("Lens", "focused at each height" if s.refocus == 1.0 else f"refocused by {s.refocus:g}", lens),
        ("Pad and light", f"{s.pad} of 7 mm gaps, {s.light} light", pad),
        ("Chain delay", f"{1e3 * s.chain_delay_s:.0f} ms", chain),
        ("Length of a run", f"{s.duration_s:g} s", length),
    ]


def order_rows(of: Reproduction) -> list[TableRow]:
    """Fit by order, one row a height and kind of run; a second row for runs the model has not seen."""
    rows = []
    for test in of.laboratory.orders if of.laboratory else ():
        name = f"{test.kind}, {test.height_m:.1f} m"
        for head, fits in ((name, test.fits), (f"{name}, the next run", test.unseen)):
            rows += [TableRow(head, [number(fit, 1) for fit in fits.values()])] if fits else []
    return rows


def identifiable(laboratory: Laboratory) -> str:
    """How many parameters the swings show, in words."""
    counts = [run.excitation.identifiable for run in laboratory.runs]
    few = [
        f"{counts.count(n)} show{'s' if counts.count(n) == 1 else ''} {n}" for n in sorted(set(counts), reverse=True)
    ]
    return f"of {len(counts)} runs {listed(few)} of 3 parameters"


# -- Table 2 -----------------------------------------------------------------------------------------------------
def error_groups(of: Reproduction) -> list[Group]:
    """Table 2 by height: mean and standard deviation, paper, here, and the paper's model on our run."""
    groups = []
    rows = list(zip(published.table_2(), of.table_2, of.table_2_published_models, strict=True)) if of.table_2 else []
    for height in HEIGHTS_M if rows else ():
        mine = [row for row in rows if row[0].height_m == height]
        shown = [
            TableRow(str(p.model), [number(p.mean_error, 5), number(h.mean_error, 5), number(o.mean_error, 5),
                                    number(p.std_error), number(h.std_error), number(o.std_error)])
            for p, h, o in mine
        ]  # fmt: skip
        means = [float(np.mean([abs(row[k].mean_error) for row in mine])) for k in range(3)]
        spreads = [float(np.mean([row[k].std_error for row in mine])) for k in range(3)]
        cells = [number(v, 5) for v in means] + [number(v) for v in spreads]
        groups.append(Group(f"{height:.1f} m", [*shown, TableRow("mean size", cells)]))
    return groups


def selected_rows(of: Reproduction) -> list[TableRow]:
    """Table 3: mean and standard deviation, paper, here, and the paper's model on our runs."""
    if not of.table_3:
        return []
    every = zip(published.table_3(), of.table_3, of.table_3_published_model, strict=True)
    return [
        TableRow(
            f"{rows[0].height_m:.1f} m",
            [number(row.mean_error) for row in rows] + [number(row.std_error) for row in rows],
        )
        for rows in every
    ]


EXACT, FLOW_OLDER, GYRO_OLDER = "exact gyro scale", "flow 20 ms older", "gyro 20 ms older"
SONARS = ("sonar at once", "sonar 150 ms late")
ByHeight = dict[float, Identified]


def kept_together(text: str) -> str:
    """A number and its unit on one line, minus signs true."""
    return NUMBER_AND_UNIT.sub("\\1\N{NO-BREAK SPACE}\\2", MINUS_SIGN.sub("\N{MINUS SIGN}", text))


def leak_sentences(laboratory: Laboratory | None) -> str:
    """Sentences on the table that `rows.instrument_rows` has; empty where it has none."""
    if laboratory is None or not laboratory.instruments:
        return ""
    found = {other.name: by_height for other, by_height in laboratory.instruments}
    as_is = {height: identified(laboratory.at(height)[0]) for height in HEIGHTS_M}
    left = [100.0 * turned_share(laboratory, height) for height in HEIGHTS_M]
    moved = max(abs(found[name][height].gain - as_is[height].gain) for name in SONARS for height in HEIGHTS_M)
    older, younger = found[FLOW_OLDER], found[GYRO_OLDER]
    return kept_together(
        "A rod turns the sensor as it moves it, and what the gyro does not take off of the turning reads as velocity. "
        f"The gyro of this firmware shows {100.0 * (1.0 - EARLY_GYRO_SCALE):.1f} % too little, which on a rod of "
        "length l at a height h adds h/l times as much: "
        f"{', '.join(f'{share:.0f}' for share in left)} % of the velocity "
        f"at the four heights. Gains are {gains(as_is)}, with an exact gyro {gains(found[EXACT])}. Where flow and gyro "
        f"are of two instants, the leak is in the delay: it is {delays(as_is)}, with the flow 20 ms the older "
        f"{delays(older)} ({trend(older)}; the paper's grows), with the gyro the older {delays(younger)} "
        f"({trend(younger)}). How late the sonar is moves the gain by {moved:.3f} at most: so small a swing hardly "
        "changes the height."
    )


def turned_share(laboratory: Laboratory, height_m: float) -> float:
    """Velocity that the gyro's scale leaves over the sensor's, by the rod's geometry: (1 - scale) h/l."""
    return (1.0 - EARLY_GYRO_SCALE) * height_m / laboratory.at(height_m)[0].log.rod_length_m


def gains(found: ByHeight) -> str:
    """By height."""
    return ", ".join(f"{found[height].gain:.2f}" for height in HEIGHTS_M)


def delays(found: ByHeight) -> str:
    """By height, with the unit."""
    return ", ".join(f"{1e3 * found[height].delay_s:.0f}" for height in HEIGHTS_M) + " ms"


def trend(found: ByHeight) -> str:
    """Whether a delay grows or falls with height."""
    steps = np.diff([found[height].delay_s for height in HEIGHTS_M])
    if (steps > 0.0).all():
        return "growing with height"
    return "falling with height" if (steps < 0.0).all() else "neither growing nor falling with height"
