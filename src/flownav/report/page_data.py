"""A record's data as its page carries them: every column once, in decimals, packed small enough to send.

A column is its values in whole steps of a power of ten (at least a millionth of the largest value), the differences
of neighbours, and of these each of the four bytes by itself: smooth series then pack well. All columns together are
compressed with gzip and written as base64; `record_data.js` turns that back with the browser's own DecompressionStream.
"""

import base64
import gzip
import hashlib
import math
from typing import Any

import numpy as np

from flownav.core.measurement import Array
from flownav.report.chart import CROSS_POINTS, DOT_POINTS, LINE_POINTS, Chart, Series, thin, thin_dots
from flownav.report.figures_states import Paths, drawn_rows
from flownav.report.panels import Section

DECIMALS = 6  # decimal places below the leading one of a column's largest value
FINEST_TIME_S = 1e-6
MISSING = np.int64(-(2**31))  # stands for a value that is no number
SMALLEST = 1e-200  # of a column's largest value: below it the column is zero
LARGEST_WHOLE = 2.0e9  # of a whole number that a column holds


class Columns:
    """The pool of columns: one of the same values is kept once."""

    def __init__(self) -> None:
        self.steps: list[float] = []
        self.counts: list[int] = []
        self._packed: list[bytes] = []
        self._known: dict[bytes, int] = {}

    def add(self, values: Array, *, time: bool = False) -> int:
        """Keep a column (n,) and give its number. time: of instants, to FINEST_TIME_S where they are not too large."""
        values = np.asarray(values, float)
        step = _step(values, time=time)
        known = np.isfinite(values) & (np.abs(np.nan_to_num(values)) <= LARGEST_WHOLE * step)
        whole = np.where(known, np.round(np.where(known, values, 0.0) / step), MISSING).astype(np.int64)
        packed = pack(whole)
        digest = hashlib.sha256(packed + str((step, len(values))).encode()).digest()
        if digest not in self._known:
            self._known[digest] = len(self.steps)
            self.steps.append(step)
            self.counts.append(len(values))
            self._packed.append(packed)
        return self._known[digest]

    def text(self) -> str:
        """All columns as base64 of gzip; the same columns give the same text."""
        return base64.b64encode(gzip.compress(b"".join(self._packed), 9, mtime=0)).decode()


def _step(values: Array, *, time: bool) -> float:
    """The power of ten that a column is counted in."""
    finite = np.abs(values[np.isfinite(values)])
    largest = float(finite.max()) if len(finite) else 0.0
    if largest < SMALLEST:
        return 1.0
    finest = 10.0 ** math.ceil(math.log10(largest / LARGEST_WHOLE))
    wanted = FINEST_TIME_S if time else 10.0 ** (math.floor(math.log10(largest)) - DECIMALS)
    return float(f"{max(finest, wanted):.0e}")


def pack(whole: np.ndarray[Any, np.dtype[np.int64]]) -> bytes:
    """Whole numbers of 32 bits: differences modulo 2^32, folded so that small ones of either sign are small, byte by
    byte."""
    step = np.diff(whole, prepend=0).astype(np.int64)
    signed = ((step + 2**31) % 2**32 - 2**31).astype(np.int32)
    folded = ((signed << 1) ^ (signed >> 31)).astype("<u4")
    return folded.view(np.uint8).reshape(-1, 4).T.tobytes()


def sections_data(shown: list[Section], columns: Columns, whole: tuple[float, float]) -> dict[str, Any]:
    """Every chart of the sections by its panel's key, its columns added to the pool."""
    return {
        panel.key: chart_data(panel.drawing, columns, whole)
        for section in shown
        for panel in section.panels
        if isinstance(panel.drawing, Chart)
    }


def chart_data(chart: Chart, columns: Columns, whole: tuple[float, float]) -> dict[str, Any]:
    """A chart as the page's script takes it; window null: the whole flight."""
    rows = []
    for axis in chart.axes:
        row: dict[str, Any] = {"title": axis.title, "series": [_series(one, columns) for one in axis.series]}
        row |= {name: True for name in ("log", "reversed", "from_zero") if getattr(axis, name)}
        if axis.within is not None:
            row["within"] = _rounded(axis.within)
        rows.append(row)
    window = None if chart.window == whole else [_rounded(end) for end in chart.window]
    return {"rows": rows, "height": chart.row_height_px, "window": window}


def _series(one: Series, columns: Columns) -> dict[str, Any]:
    kept = (
        thin_dots(DOT_POINTS if one.kind == "dots" else CROSS_POINTS, one.value)
        if one.kind in ("dots", "crosses")
        else thin(LINE_POINTS, one.value)
    )
    made: dict[str, Any] = {"kind": one.kind, "role": one.role, "name": one.name}
    made |= {"t": columns.add(one.t_s[kept], time=True), "v": columns.add(one.value[kept])}
    if one.middle is not None:
        made["m"] = columns.add(one.middle[kept])
    return made if one.shown else made | {"hidden": True}


def paths_data(paths: Paths | None, columns: Columns) -> dict[str, Any] | None:
    """The paths as the page's script takes them: times, north, east and down of each."""
    if paths is None:
        return None
    tracks = []
    for role, name, track in paths.tracks:
        kept, jumps = drawn_rows(role, track)
        place = {axis: columns.add(track.value[kept, k]) for k, axis in enumerate("ned")}
        tracks.append({"role": role, "name": name, "t": columns.add(track.t_s[kept], time=True), **place,
                       "jumps": jumps.tolist()})  # fmt: skip
    made: dict[str, Any] = {"tracks": tracks, "outages": [list(window) for window in paths.outages]}
    if paths.gps is not None:
        kept = thin_dots(DOT_POINTS, *paths.gps.value.T)
        made["gps"] = {axis: columns.add(paths.gps.value[kept, k]) for k, axis in enumerate("ned")}
    if paths.pad is not None:
        made["pad_m"] = paths.pad.size_m
    if paths.touch is not None:
        made["touch"] = [_rounded(value) for value in paths.touch]
    return made


def _rounded(value: float) -> float:
    return float(f"{value:.7g}")
