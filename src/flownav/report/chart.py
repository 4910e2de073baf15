"""Axes stacked over one time axis, as data, and which samples are drawn: a record's page draws them with uPlot, every
other page with Plotly."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Array
from flownav.report.series import Moment, Window

LINE_POINTS = 2700  # a drawn line has at most this number of points
DOT_POINTS = 900  # a cloud of readings this number of dots
CROSS_POINTS = 250  # and the exceptional ones this number of crosses


def thin(budget: int, *columns: Array) -> NDArray[np.int64]:
    """Rows to draw, at most `budget`: of each stretch those with the smallest and largest value of every column."""
    count = len(columns[0])
    if count <= budget:
        return np.arange(count)
    stretches = (budget - 2) // (2 * len(columns))
    edges = np.linspace(0, count, stretches + 1).astype(int)
    width = int(np.diff(edges).max())
    rows = np.minimum(edges[:-1, None] + np.arange(width), edges[1:, None] - 1)
    kept = [np.array([0, count - 1])]
    for column in columns:
        values = np.asarray(column, float)[rows]
        here = np.arange(stretches)
        kept.append(rows[here, np.where(np.isnan(values), np.inf, values).argmin(axis=1)])
        kept.append(rows[here, np.where(np.isnan(values), -np.inf, values).argmax(axis=1)])
    return np.unique(np.concatenate(kept))


def thin_dots(budget: int, *columns: Array) -> NDArray[np.int64]:
    """Rows of a cloud of dots to draw, at most `budget`: an even sample, and the extremes of each stretch.

    Extremes alone would hollow the cloud out and widen it: they get one part of the budget in twenty.
    """
    count = len(columns[0])
    if count <= budget:
        return np.arange(count)
    extremes = max(budget // 20, 2 + 2 * len(columns))
    sample = np.linspace(0, count - 1, budget - extremes).astype(int)
    return np.unique(np.concatenate([sample, thin(extremes, *columns)]))


def drawn(values: Array) -> NDArray[np.float32]:
    """Values as Plotly's pages carry them: single precision halves their size."""
    with np.errstate(over="ignore"):
        return np.asarray(values, np.float32)


def gap_before(t_s: Array, kept: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether a kept sample follows a pause since the one kept before: half a second, and twenty usual intervals.

    A pause lies between two neighbours of the whole series, so thinning makes none.
    """
    interval = np.diff(t_s, prepend=t_s[:1])
    pauses = np.cumsum(interval > max(0.5, 20.0 * float(np.median(interval)) if len(interval) else 0.0))
    return np.asarray(np.diff(pauses[kept], prepend=pauses[kept[:1]]) > 0)


def sliding_rms(t_s: Array, squares: Array, width_s: float) -> Array:
    """Root of the mean of squares over a window of time centred on each instant."""
    total = np.concatenate([[0.0], np.cumsum(squares)])
    first = np.searchsorted(t_s, t_s - width_s / 2, side="left")
    last = np.searchsorted(t_s, t_s + width_s / 2, side="right")
    return np.asarray(np.sqrt(np.maximum(total[last] - total[first], 0.0) / (last - first)))


def sliding_mean(t_s: Array, values: Array, width_s: float) -> Array:
    """Mean of values (n,) over a window of time centred on each instant; NaN counts for nothing."""
    known = np.isfinite(values)
    total = np.concatenate([[0.0], np.cumsum(np.where(known, values, 0.0))])
    count = np.concatenate([[0], np.cumsum(known)])
    first = np.searchsorted(t_s, t_s - width_s / 2, side="left")
    last = np.searchsorted(t_s, t_s + width_s / 2, side="right")
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray((total[last] - total[first]) / (count[last] - count[first]))


ROW_HEIGHT_PX = 138

Kind = Literal["line", "dots", "crosses", "band"]


@dataclass(frozen=True, eq=False)
class Series:
    """One thing over time on one axis: t_s (n,) and value (n,); of a band the value is half its width, about `middle`
    (n,) or, where that is None, about zero.

    role: its colour, a key of style.PALETTE. name: what it is called beside its end or in a legend.
    """

    kind: Kind
    role: str
    name: str
    t_s: Array
    value: Array
    shown: bool = True
    middle: Array | None = None


@dataclass
class Axis:
    """An upright axis: its title with the unit, what is drawn on it, and how it is scaled.

    within: half its height, zero in the middle, where it is not to reach as far as its values do.
    """

    title: str
    series: list[Series] = field(default_factory=list)
    log: bool = False
    reversed: bool = False
    from_zero: bool = False
    within: float | None = None

    def reach(self) -> tuple[float, float]:
        """Smallest and largest finite value of its lines and readings; NaN without one."""
        parts = [one.value[np.isfinite(one.value)] for one in self.series if one.kind != "band"]
        known = np.concatenate(parts) if parts else np.zeros(0)
        return (float(known.min()), float(known.max())) if len(known) else (np.nan, np.nan)


@dataclass(frozen=True)
class Chart:
    """Axes over a window of time [s]; moments and outages are those inside the window."""

    axes: tuple[Axis, ...]
    window: Window
    moments: tuple[Moment, ...] = ()
    outages: tuple[Window, ...] = ()
    row_height_px: int = ROW_HEIGHT_PX

    def names(self) -> list[str]:
        """The drawn names, each once, in the order of drawing."""
        return list(dict.fromkeys(one.name for axis in self.axes for one in axis.series))


class Stack:
    """A chart being put together. Rows count from 1; values that are no number are left open."""

    def __init__(self, titles: Sequence[str], row_height_px: int = ROW_HEIGHT_PX) -> None:
        self._axes = [Axis(title) for title in titles]
        self._row_height_px = row_height_px

    @property
    def names(self) -> list[str]:
        """The names drawn so far, each once."""
        return Chart(tuple(self._axes), (0.0, 0.0)).names()

    def _add(self, row: int, one: Series) -> None:
        self._axes[row - 1].series.append(one)

    def line(self, row: int, role: str, name: str, t_s: Array, values: Array) -> None:
        """A line in a role's style."""
        self._add(row, Series("line", role, name, np.asarray(t_s, float), np.asarray(values, float)))

    def dots(self, row: int, role: str, name: str, t_s: Array, values: Array, *, shown: bool = True) -> None:
        """Readings as dots; not shown, they wait until they are asked for."""
        self._readings("dots", row, role, name, t_s, values, shown)

    def crosses(self, row: int, role: str, name: str, t_s: Array, values: Array) -> None:
        """Exceptional readings as crosses."""
        self._readings("crosses", row, role, name, t_s, values, True)

    def _readings(self, kind: Kind, row: int, role: str, name: str, t_s: Array, values: Array, shown: bool) -> None:
        known = ~np.isnan(np.asarray(values, float))
        if known.any():
            self._add(row, Series(kind, role, name, np.asarray(t_s, float)[known], values[known], shown))

    def band(self, row: int, name: str, t_s: Array, half_width: Array, middle: Array | None = None) -> None:
        """The area half_width to either side of `middle` (else of zero), open where nothing was measured for long."""
        about = None if middle is None else np.asarray(middle, float)
        self._add(
            row, Series("band", "band", name, np.asarray(t_s, float), np.asarray(half_width, float), middle=about)
        )

    def log_axis(self, row: int) -> None:
        """Make an upright axis logarithmic."""
        self._axes[row - 1].log = True

    def reverse(self, row: int) -> None:
        """Draw an axis with its positive end down, as z of NED."""
        self._axes[row - 1].reversed = True

    def within(self, row: int, half_height: float) -> None:
        """Let an upright axis reach from -half_height to +half_height."""
        self._axes[row - 1].within = half_height

    def from_zero(self) -> None:
        """Let every upright axis start at zero."""
        for axis in self._axes:
            axis.from_zero = True

    def chart(self, window: Window, moments: Iterable[Moment] = (), outages: Iterable[Window] = ()) -> Chart:
        """The chart over a window of time, with the moments and GPS outages inside it marked."""
        inside = tuple(moment for moment in moments if window[0] <= moment.t_s <= window[1])
        cut = tuple(outage for outage in outages if outage[0] < window[1] and outage[1] > window[0])
        return Chart(tuple(self._axes), window, inside, cut, self._row_height_px)
