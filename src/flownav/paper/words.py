"""The words, tiles and table rows of the page; figures of merit come from the reproduction, none is written here."""

from typing import Any, NamedTuple

import numpy as np

from flownav.paper import published
from flownav.paper.findings import FIT_TOLERANCE
from flownav.paper.flights import RIG_ERRORS, Flights
from flownav.paper.published import HEIGHTS_M, RELATION_FITS
from flownav.paper.reproduction import Reproduction
from flownav.paper.rows import TableRow, kept_together
from flownav.report.panels import Tile, listed, number
from flownav.scoring.errors import STATES

UNITS = dict(zip(STATES, ("m", "m", "m", "m/s", "m/s", "m/s"), strict=True))


def facts(of: Reproduction) -> list[tuple[str, str]]:
    """The line under the heading."""
    shown = [("Tables", listed(str(table) for table in of.tables)), ("Seed", str(of.seed))]
    if of.laboratory is not None:
        shown.append(("Rig runs", f"{len(of.laboratory.runs)} of {of.laboratory.fixed.settings.duration_s:.0f} s"))
    if of.flights:
        shown.append(("Flights", " and ".join(f"{flown.flights} {flown.what}s" for flown in of.flights)))
    return shown


def summary(of: Reproduction) -> str:
    """The verdict in sentences."""
    sentences = []
    laboratory = of.laboratory
    if laboratory is not None and 1 in of.tables:
        off = {height: laboratory.mean_fit(height) - fit for height, fit in RELATION_FITS.items()}
        within = sum(abs(points) <= FIT_TOLERANCE for points in off.values())
        worst = max(off, key=lambda height: abs(off[height]))
        sentences.append(
            f"With one configuration of the rig the fits lie within {FIT_TOLERANCE:.0f} points of the paper's at "
            f"{within} of {len(off)} heights; the farthest is {number(off[worst], 1)} points off, at {worst:.1f} m."
        )
    for flown in of.flights:
        largest, honest = flown.scores["max_position_error_m"]["median"], flown.honest["max_position_error_m"]["median"]
        sentences.append(
            f"At {flown.what} the largest position error of the median flight is {largest:.3f} m "
            f"(the paper: {flown.published['max_position_error_m']:.3f} m); with the receiver of its Table 4 "
            f"it is {honest:.1f} m."
        )
    agree = sum(finding.agrees for finding in of.findings)
    sentences.append(
        f"Of {len(of.findings)} claims put to the test, {agree} come out as printed and {len(of.findings) - agree} do "
        "not."
    )
    return kept_together(" ".join(sentences))


def tiles(of: Reproduction) -> list[Tile]:
    """The headline figures."""
    found = []
    if of.laboratory is not None and 1 in of.tables:
        for height, fit in RELATION_FITS.items():
            found.append(
                Tile(f"Fit at {height:.1f} m", f"{of.laboratory.mean_fit(height):.1f}", "%", f"paper {fit:.0f} %")
            )
    for flown in of.flights:
        largest = flown.scores["max_position_error_m"]["median"]
        note = f"paper {flown.published['max_position_error_m']:.3f} m"
        found.append(Tile(f"Largest error, {flown.what}", f"{largest:.3f}", "m", note))
    if of.table_2 or of.table_3:
        name, table, printed = (
            ("Table 2", of.table_2, published.table_2()) if of.table_2 else ("Table 3", of.table_3, published.table_3())
        )
        if 1 not in of.tables:
            for height in HEIGHTS_M:
                ours, theirs = (
                    np.mean([r.std_error for r in rows if r.height_m == height]) for rows in (table, printed)
                )
                found.append(Tile(f"{name}: error at {height:.1f} m", f"{ours:.3f}", "m/s", f"paper {theirs:.3f} m/s"))
    return found


def signal(of: Reproduction) -> str:
    """How fast the paper's runs were, which its Tables 1 and 2 imply, and ours."""
    if of.laboratory is None or not of.table_2:
        return ""
    theirs, ours = [], []
    for height in HEIGHTS_M:
        fit = float(np.mean([m.fit_percent for m in published.table_1() if m.height_m == height]))
        error = float(np.mean([r.std_error for r in published.table_2() if r.height_m == height]))
        theirs.append(error / (1.0 - 0.01 * fit))
        ours.append(float(np.mean([run.log.flow_velocity_m_s.std() for run in of.laboratory.at(height)])))
    by_height = (", ".join(f"{value:.2f}" for value in values) for values in (theirs, ours))
    return kept_together(
        "An error's standard deviation over 1 less the fit is that of the signal: the paper's Tables 1 and 2 imply "
        "{} m/s at the four heights, where our sensor's is {} m/s. ".format(*by_height)
        + f"From the lowest to the highest theirs changes by a factor of {theirs[-1] / theirs[0]:.1f}, ours by "
        f"{ours[-1] / ours[0]:.1f}; section III.E says 0.63. Where the runs were faster, so are the errors in m/s "
        "at the same fit."
    )


# -- Tables 5 and 6 -------------------------------------------------------------------------------------------------
class FlightTable(NamedTuple):
    """Table 5 or 6: title, rows of states, the row of the largest error, and the touchdown in words."""

    key: str
    title: str
    flights: int
    rows: list[TableRow]
    touchdown: str
    leaking: str


def flight_tables(of: Reproduction) -> list[FlightTable]:
    """Tables 5 and 6 as rows."""
    return [_flight_table(flown) for flown in of.flights]


def _flight_table(flown: Flights) -> FlightTable:
    rows = []
    for state in STATES:
        theirs, ours = flown.published["states"][state], flown.scores["states"][state]
        where = flown.percentile["states"][state]
        cells: list[Any] = []
        for statistic in ("mean_error", "std_error"):
            cells += [number(theirs[statistic]), _spread(ours[statistic]), number(where[statistic], 0)]
        rows.append(TableRow(f"{state} ({UNITS[state]})", [*cells, _spread(ours["max_error"])]))
    title = f"{flown.published['title']}: {flown.what}"
    return FlightTable(flown.scenario, title, flown.flights, rows, _touchdown(flown), leaking(flown))


def leaking(flown: Flights) -> str:
    """Sentence on the effect of a sensor with the rig's errors on the table."""
    largest = (of["max_position_error_m"]["median"] for of in (flown.scores, flown.leaking))
    spreads = [
        f"{state} {flown.scores['states'][state]['std_error']['median']:.3f} to "
        f"{flown.leaking['states'][state]['std_error']['median']:.3f}"
        for state in ("x", "y", "u", "v")
    ]
    return kept_together(
        f"With the rig's errors of gyro and sonar ({100.0 * RIG_ERRORS['rotation_leak']:.1f} % of the rotation left in "
        f"the velocity, a range {1e3 * RIG_ERRORS['sonar_lag_s']:.0f} ms old) the largest position error goes from "
        "{:.3f} to {:.3f} m".format(*largest)
        + f", and the standard deviations from {', '.join(spreads)}, in m and m/s."
    )


def _touchdown(flown: Flights) -> str:
    landed = flown.scores["touchdown"]
    largest, percentile = flown.scores["max_position_error_m"], flown.percentile["max_position_error_m"]
    sentences = (
        f"Largest position error {_range(largest, 3)} m; the paper's {flown.published['max_position_error_m']:.4f} m "
        f"lies at percentile {percentile:.0f} of our flights."
    )
    if landed and landed["contact"]["distance_m"]:
        sentences += f" Touchdown {_range(landed['contact']['distance_m'], 3)} m from the pad's centre."
    return sentences


class Spread(NamedTuple):
    """A median and the 5 to 95 % about it, as text."""

    median: str
    between: str


def _spread(entry: dict[str, float], digits: int = 4) -> Spread:
    median, low, high = (number(entry[key], digits) for key in ("median", "p05", "p95"))
    return Spread(median, "" if entry["p05"] == entry["p95"] else f"{low} to {high}")


def _range(entry: dict[str, float], digits: int = 4) -> str:
    shown = _spread(entry, digits)
    return f"{shown.median} ({shown.between})" if shown.between else shown.median


def own_systems(of: Reproduction) -> list[tuple[str, str, str]]:
    """This reproduction's rows of the comparison: what, figure, what it measures."""
    error = "largest difference between estimate and truth on one axis"
    place = "distance of simulated touchdowns from the pad's centre; the autopilot notes the pad at the start"
    rows = []
    for flown in of.flights:
        for gps, scores in (("white GPS noise of 0.3 m", flown.scores), ("GPS of 2 m CEP", flown.honest)):
            name, landed = f"Here: {flown.what}, {gps}", scores["touchdown"]
            rows.append((name, _centimetres(scores["max_position_error_m"]), error))
            if landed and landed["contact"]["distance_m"]:
                rows.append((name, _centimetres(landed["contact"]["distance_m"]), place))
    return rows


def _centimetres(entry: dict[str, float]) -> str:
    return _range({key: 100.0 * value for key, value in entry.items()}, 0)
