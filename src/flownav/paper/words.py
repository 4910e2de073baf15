"""The words, tiles and table rows of the page; numbers come from the reproduction, none is written here."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from flownav.paper import published
from flownav.paper.findings import FIT_TOLERANCE
from flownav.paper.flights import Flights
from flownav.paper.laboratory import Laboratory, Run, delay_s
from flownav.paper.published import HEIGHTS_M, RELATION_FITS
from flownav.paper.reproduction import Reproduction
from flownav.report.content import Tile, number
from flownav.report.panels import listed
from flownav.rig.excitation import DAMPING_1_S
from flownav.rig.pendulum import largest_speed
from flownav.scoring.errors import STATES
from flownav.sensors.datasheet import Dynamics

FLIGHT_NAMES = {"takeoff": "take-off", "landing": "landing"}
UNITS = dict(zip(STATES, ("m", "m", "m", "m/s", "m/s", "m/s"), strict=True))


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


def facts(of: Reproduction) -> list[tuple[str, str]]:
    """The line under the heading."""
    shown = [("Tables", listed(str(table) for table in of.tables)), ("Seed", str(of.seed))]
    if of.laboratory is not None:
        shown.append(("Rig runs", f"{len(of.laboratory.runs)} of {of.laboratory.fixed.settings.duration_s:.0f} s"))
    if of.flights:
        shown.append(
            ("Flights", " and ".join(f"{flown.flights} {FLIGHT_NAMES[flown.scenario]}s" for flown in of.flights))
        )
    return shown


def summary(of: Reproduction) -> str:
    """The verdict in sentences."""
    agree = sum(finding.agrees for finding in of.findings)
    said = [f"{agree} of {len(of.findings)} claims that could be put to the test come out as printed."]
    laboratory = of.laboratory
    if laboratory is not None and 1 in of.tables:
        within = sum(abs(laboratory.mean_fit(h) - fit) <= FIT_TOLERANCE for h, fit in RELATION_FITS.items())
        worst = max(RELATION_FITS, key=lambda h: abs(laboratory.mean_fit(h) - RELATION_FITS[h]))
        off = laboratory.mean_fit(worst) - RELATION_FITS[worst]
        said.append(
            f"The fits of {within} of {len(RELATION_FITS)} heights lie within {FIT_TOLERANCE:.0f} points of the paper's "
            f"with one configuration of the rig; the farthest is {number(off, 1)} points off, at {worst:g} m."
        )
    for flown in of.flights:
        largest, honest = flown.scores["max_position_error_m"]["median"], flown.honest["max_position_error_m"]["median"]
        said.append(
            f"The {FLIGHT_NAMES[flown.scenario]}'s largest position error is {largest:.3f} m in the median flight "
            f"(the paper: {flown.published['max_position_error_m']:.4f} m), and {honest:.1f} m with the receiver of Table 4."
        )
    return " ".join(said)


def tiles(of: Reproduction) -> list[Tile]:
    """The headline figures."""
    found = []
    if of.laboratory is not None and 1 in of.tables:
        for height, fit in RELATION_FITS.items():
            found.append(
                Tile(f"Fit at {height:g} m", f"{of.laboratory.mean_fit(height):.1f}", "%", f"paper {fit:.0f} %")
            )
    for flown in of.flights:
        largest = flown.scores["max_position_error_m"]["median"]
        note = f"paper {flown.published['max_position_error_m']:.3f} m"
        found.append(Tile(f"Largest error, {FLIGHT_NAMES[flown.scenario]}", f"{largest:.3f}", "m", note))
    if of.table_2 or of.table_3:
        name, table, printed = (
            ("Table 2", of.table_2, published.table_2()) if of.table_2 else ("Table 3", of.table_3, published.table_3())
        )
        if 1 not in of.tables:
            for height in HEIGHTS_M:
                ours, theirs = (
                    np.mean([r.std_error for r in rows if r.height_m == height]) for rows in (table, printed)
                )
                found.append(Tile(f"{name}: error at {height:g} m", f"{ours:.3f}", "m/s", f"paper {theirs:.3f} m/s"))
    return found


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
        mean = [Pair(_mean(m.fit_percent for m in models), _mean(r.fits[2].fit_percent for r in runs)),
                Pair(_mean((m.gain for m in models), 3), _mean((r.dynamics.gain for r in runs), 3)),
                Pair(_mean((1e3 * m.delay_s for m in models), 0), _mean((1e3 * delay_s(r) for r in runs), 0))]  # fmt: skip
        groups.append(Group(f"{height:g} m", [*rows, TableRow("mean", [*mean, Pair("", ""), Pair("", "")])]))
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


def set_up(of: Reproduction) -> list[tuple[str, str, str]]:
    """The fixed configuration: what, its value, why (docs/rig.md)."""
    if of.laboratory is None:
        return []
    s = of.laboratory.fixed.settings
    speed = largest_speed(s.start_angle_rad, s.pivot_height_m, HEIGHTS_M[0])
    return [
        ("Firmware", s.firmware, "The paper says 250 Hz, which is before July 2014; its gains above 1 need the gyro compensation that this build has on, with its scale 12.8 % low."),
        ("Pivot", f"{s.pivot_height_m:g} m above the pad", "Not published."),
        ("Swing", f"{s.start_angle_rad:g} rad, {speed:.2f} m/s at {HEIGHTS_M[0]:g} m; damping {DAMPING_1_S:g} 1/s", "Not published. The amplitude sets the level of all fits (see the wider swing); it was set before the heights were looked at."),
        ("Lens", "focused at each height" if s.refocus == 1.0 else f"refocused by {s.refocus:g}", "\u201cWe make sure that the pattern is being seen clearly by adjusting the lens thread.\u201d"),
        ("Pad and light", f"{s.pad} of 7 mm gaps, {s.light} light", "7 mm between lines is a pitch of 14 mm: a pitch of 7 mm aliases from 0.8 m up."),
        ("Chain delay", f"{1e3 * s.chain_delay_s:.0f} ms", "Microcontroller, serial port and board, not published: the paper's 71 to 120 ms less the sensor's 13 ms."),
        ("Length of a run", f"{s.duration_s:g} s", "Not published; chosen between 15 and 30 s after looking at the fits. A longer run fits worse, since the swing dies away and the noise stays."),
    ]  # fmt: skip


def order_rows(of: Reproduction) -> list[TableRow]:
    """Fit by order, one row a height and kind of run; a second row for runs the model has not seen."""
    rows = []
    for test in of.laboratory.orders if of.laboratory else ():
        rows.append(TableRow(f"{test.kind}, {test.height_m:g} m", [number(fit, 1) for fit in test.fits.values()]))
        if test.unseen:
            rows.append(TableRow("on the next run", [number(fit, 1) for fit in test.unseen.values()]))
    return rows


def identifiable(laboratory: Laboratory) -> str:
    """How many parameters the swings show, in words."""
    counts = [run.excitation.identifiable for run in laboratory.runs]
    return listed(f"{counts.count(n)} runs show {n} of 3 parameters" for n in sorted(set(counts), reverse=True))


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
        groups.append(Group(f"{height:g} m", [*shown, TableRow("mean size", cells)]))
    return groups


def selected_rows(of: Reproduction) -> list[TableRow]:
    """Table 3: mean and standard deviation, paper, here, and the paper's model on our runs."""
    if not of.table_3:
        return []
    every = zip(published.table_3(), of.table_3, of.table_3_published_model, strict=True)
    return [
        TableRow(
            f"{rows[0].height_m:g} m",
            [number(row.mean_error) for row in rows] + [number(row.std_error) for row in rows],
        )
        for rows in every
    ]


# -- Tables 5 and 6 -------------------------------------------------------------------------------------------------
class FlightTable(NamedTuple):
    """Table 5 or 6: title, rows of states, the row of the largest error, and the touchdown in words."""

    key: str
    title: str
    flights: int
    rows: list[TableRow]
    touchdown: str


def flight_tables(of: Reproduction) -> list[FlightTable]:
    """Tables 5 and 6 as rows."""
    return [_flight_table(flown) for flown in of.flights]


def _flight_table(flown: Flights) -> FlightTable:
    rows = []
    for state in STATES:
        theirs, ours = flown.published["states"][state], flown.scores["states"][state]
        where = flown.percentile["states"][state]
        cells = []
        for statistic in ("mean_error", "std_error"):
            cells += [number(theirs[statistic]), _range(ours[statistic]), number(where[statistic], 0)]
        rows.append(TableRow(f"{state} ({UNITS[state]})", [*cells, _range(ours["max_error"])]))
    return FlightTable(
        flown.scenario,
        f"{flown.published['title']}: {FLIGHT_NAMES[flown.scenario]}",
        flown.flights,
        rows,
        _touchdown(flown),
    )


def _touchdown(flown: Flights) -> str:
    landed = flown.scores["touchdown"]
    largest, percentile = flown.scores["max_position_error_m"], flown.percentile["max_position_error_m"]
    said = (
        f"Largest position error {_range(largest, 3)} m; the paper's {flown.published['max_position_error_m']:.4f} m lies at "
        f"percentile {percentile:.0f} of our flights."
    )
    if landed:
        said += f" Touchdown {_range(landed['horizontal_error_m'], 3)} m from the pad's centre."
    return said


def _range(entry: dict[str, float], digits: int = 4) -> str:
    values = [number(entry[key], digits) for key in ("median", "p05", "p95")]
    return f"{values[0]} ({values[1]} to {values[2]})" if not math.isclose(entry["p05"], entry["p95"]) else values[0]


def own_systems(of: Reproduction) -> list[tuple[str, str, str]]:
    """This reproduction's rows of the comparison: what, figure, what it measures."""
    rows = []
    for flown in of.flights:
        name = FLIGHT_NAMES[flown.scenario]
        for gps, scores in (("white GPS noise of 0.3 m", flown.scores), ("GPS of 2 m CEP", flown.honest)):
            largest = scores["max_position_error_m"]
            what = "largest difference between estimate and truth on one axis"
            rows.append((f"Here: {name}, {gps}", _centimetres(largest), what))
            if scores["touchdown"]:
                what = (
                    "distance of simulated touchdowns from the pad's centre; the autopilot notes the pad at the start"
                )
                rows.append((f"Here: {name}, {gps}", _centimetres(scores["touchdown"]["horizontal_error_m"]), what))
    return rows


def _centimetres(entry: dict[str, float]) -> str:
    return _range({key: 100.0 * value for key, value in entry.items()}, 0)
