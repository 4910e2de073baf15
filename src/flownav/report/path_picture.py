"""The picture of a flight that has no landing to show: its path from above and its height over time, in SVG.

A dot moves along both in a loop of 5 s without a script; on paper it stands at the end.
"""

from html import escape
from itertools import pairwise

import numpy as np

from flownav.core.measurement import Array
from flownav.core.record import Record
from flownav.report.figures_states import Paths, paths_of
from flownav.report.landing import (
    HIGH_PX,
    KEY_PX,
    ROUND_M,
    Picture,
    animated,
    dots,
    key_places,
    phase_key,
    polyline,
    scale_bar,
    side_by_side,
    view,
)
from flownav.report.series import Track, Window, at, is_north_known, start_end_s
from flownav.scoring.phases import Phase, phases_of

MAP_PX, HEIGHT_PX = 430, 430
MARGIN_PX = 24.0
MAP_POINTS, HEIGHT_POINTS, FRAMES = 1500, 300, 72
AROUND_S = 2.0  # on the ground, before and after what the dot flies
ON_GROUND = ("ground", "landed")
LEAST_M = 2.0  # the smallest ground that is shown
FAR_M = (50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0, 5000.0)


def path_picture(record: Record) -> Picture | None:
    """The picture; None of a record without positions or with less than a second of them."""
    paths = paths_of(record)
    window = start_end_s(record)
    if paths is None or window[1] - window[0] < 1.0:
        return None
    shown = [(role, name, _within(path, window)) for role, name, path in paths.tracks]
    shown = [one for one in shown if len(one[2].t_s) > 1]
    gps = None if paths.gps is None else _within(paths.gps, window)
    if gps is not None and len(gps.t_s) > 1:
        shown.insert(0, ("gps", "GPS", gps))
    main = _main(shown)
    if main is None:
        return None
    phases = phases_of(record)
    air = _in_the_air(phases, _ends(main))
    words = _words(shown, paths, window, placed=record.manifest.get("kind") != "fly")
    north = is_north_known(record)
    views = [
        (_map(shown, main, paths, air, north=north), MAP_PX),
        (_height(shown, main, phases, window, air), HEIGHT_PX),
    ]
    return Picture(side_by_side(views, words), words)


def _within(path: Track, window: Window) -> Track:
    inside = path.within(window)
    known = np.isfinite(inside.value[:, :3]).all(axis=1)
    return Track(inside.t_s[known], inside.value[known, :3])


def _main(shown: list[tuple[str, str, Track]]) -> Track | None:
    """The path along which the dot moves: the estimate, or else the last one drawn."""
    order = [path for role, _, path in shown if role == "estimate"] + [path for *_, path in reversed(shown)]
    return order[0] if order else None


def _map(shown: list[tuple[str, str, Track]], main: Track, paths: Paths, air: Window, *, north: bool) -> str:
    """From above, north up the page where it is known; where GPS was cut, a broad line lies under the path."""
    places = np.vstack([path.value[:, :2] for _, _, path in shown])
    low, high = places.min(axis=0), places.max(axis=0)
    scale = float(min(HIGH_PX - 80.0, MAP_PX - 2 * MARGIN_PX) / max(*(high - low), LEAST_M))
    middle = 0.5 * (low + high)

    def placed(ned: Array) -> Array:
        return np.column_stack(
            [0.5 * MAP_PX + scale * (ned[:, 1] - middle[1]), 0.5 * HIGH_PX + 14 - scale * (ned[:, 0] - middle[0])]
        )

    windows = (main.within(one) for one in paths.outages)
    cut = "".join(polyline("cut", placed(_even(part, 100).value)) for part in windows if len(part.t_s) > 1)
    drawn = "".join(_drawn(role, placed(_even(path, MAP_POINTS).value)) for role, _, path in shown)
    rows = [(f"of-{role}", name) for role, name, _ in shown] + ([("cutkey", "GPS withheld")] if cut else [])
    key = "".join(
        f'<text class="key {role}" x="{MAP_PX - 4}" y="{38 + 15 * k}">{escape(name)}</text>'
        for k, (role, name) in enumerate(rows)
    )
    arrow = '<path class="arrow" d="M14 62V38m-4 7 4-7 4 7"/><text x="14" y="76" text-anchor="middle">N</text>'
    dot = _dot(placed(at(np.linspace(*air, FRAMES), main)))
    bar = scale_bar(scale, (*ROUND_M, *FAR_M))
    return view(0, MAP_PX, "The path from above", f"{cut}{drawn}{dot}{key}{arrow if north else ''}{bar}")


def _height(shown: list[tuple[str, str, Track]], main: Track, phases: list[Phase], window: Window, air: Window) -> str:
    """Height over time, on the colours of the phases."""
    heights = np.concatenate([-path.value[:, 2] for _, _, path in shown])
    low, high = float(min(heights.min(), 0.0)), float(max(heights.max(), 1.0))
    names = [phase.name for phase in phases if phase.t0 < window[1] and phase.t1 > window[0]]
    above = KEY_PX + 15.0 + max((y - KEY_PX for _, _, y in key_places(names, HEIGHT_PX)), default=0.0)
    top, bottom, left = above + 10.0, HIGH_PX - 34.0, 34.0
    across, up = (HEIGHT_PX - left - 8.0) / (window[1] - window[0]), (bottom - top) / (high - low)

    def placed(path: Track) -> Array:
        return np.column_stack([left + across * (path.t_s - window[0]), bottom + up * (path.value[:, 2] + low)])

    bands = "".join(_band(phase, window, left, across, (above, bottom + 6.0)) for phase in phases)
    key = phase_key(names, HEIGHT_PX)
    step = next((size for size in (*ROUND_M, *FAR_M) if up * size >= 50.0), FAR_M[-1])
    marks = 0.0 + np.arange(np.ceil(low / step), np.floor(high / step) + 1) * step
    ticks = "".join(
        f'<line class="rule" x1="{left}" x2="{HEIGHT_PX}" y1="{bottom - up * (m - low):.1f}" '
        f'y2="{bottom - up * (m - low):.1f}"/><text x="0" y="{bottom - up * (m - low) + 4:.1f}">{m:g} m</text>'
        for m in marks
    )
    times = "".join(
        f'<text x="{left + across * (t - window[0]):.0f}" y="{HIGH_PX - 4}" text-anchor="{side}">{t:.0f} s</text>'
        for t, side in ((window[0], "start"), (0.5 * sum(window), "middle"), (window[1], "end"))
    )
    drawn = "".join(_drawn(role, placed(_even(path, HEIGHT_POINTS))) for role, _, path in shown)
    t_s = np.linspace(*air, FRAMES)
    dot = _dot(placed(Track(t_s, at(t_s, main))))
    return view(1, HEIGHT_PX, "Height over time, by phase of the flight", f"{bands}{ticks}{times}{drawn}{dot}{key}")


def _drawn(role: str, way: Array) -> str:
    """A path (n, 2) [px] in its role's colour: a line, or dots of a receiver's readings."""
    return (dots if role == "gps" else polyline)(f"way of-{role}", way)


def _band(phase: Phase, window: Window, left: float, across: float, span_px: Window) -> str:
    t0, t1 = max(phase.t0, window[0]), min(phase.t1, window[1])
    if t1 <= t0:
        return ""
    colour = f'style="fill:var(--phase-{escape(phase.name)})"'
    x, wide = left + across * (t0 - window[0]), across * (t1 - t0)
    high = span_px[1] - span_px[0]
    return f'<rect class="band" {colour} x="{x:.1f}" y="{span_px[0]:.0f}" width="{wide:.1f}" height="{high:.1f}"/>'


def _ends(path: Track) -> Window:
    return float(path.t_s[0]), float(path.t_s[-1])


def _even(path: Track, count: int) -> Track:
    """At most `count` rows of a path, even in time."""
    if len(path.t_s) <= count:
        return path
    rows = np.unique(np.searchsorted(path.t_s, np.linspace(*_ends(path), count)))
    return Track(path.t_s[rows], path.value[rows])


def _dot(way: Array) -> str:
    moved = animated("translate", [f"{x:.1f} {y:.1f}" for x, y in way])
    x, y = way[-1]
    return (
        f'<circle class="still dot" cx="{x:.1f}" cy="{y:.1f}" r="5"/>'
        f'<g class="moving">{moved}<circle class="dot" r="5"/></g>'
    )


def _in_the_air(phases: list[Phase], window: Window) -> Window:
    """From AROUND_S before the vehicle leaves the ground to as long after it is back, in the window; else all of it."""
    air = [phase for phase in phases if phase.name not in ON_GROUND and phase.t0 < window[1] and phase.t1 > window[0]]
    if not air:
        return window
    return max(window[0], air[0].t0 - AROUND_S), min(window[1], air[-1].t1 + AROUND_S)


def _words(shown: list[tuple[str, str, Track]], paths: Paths, window: Window, *, placed: bool) -> str:
    """The picture in words; placed: whether the other paths were shifted, as those of a log are."""
    names = [name for _, name, _ in shown]
    names_words = names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
    path = _main(shown)
    assert path is not None
    far = sum(float(np.hypot(*(b - a))) for a, b in pairwise(_even(path, MAP_POINTS).value[:, :2]))
    spans = ", ".join(f"{t0:.0f} to {t1:.0f} s" for t0, t1 in paths.outages[:3])
    more = f" and {len(paths.outages) - 3} more times" if len(paths.outages) > 3 else ""
    cut = f" GPS was withheld from {spans}{more} (broad, red)." if paths.outages else ""
    lasts = f"{window[1] - window[0]:.0f} s and some {far:.0f} m over the ground"
    shifted = " The others are shifted so that they agree with it or with GPS on average."
    laid = shifted if placed and len(names) > 1 else ""
    return f"The path of {lasts}: {names_words}. The dot flies the estimate in a loop of 5 s.{laid}{cut}"
