"""The picture of a landing: from the side and from above, the vehicle to scale, and the touchdown close up, in SVG.

What moves is moved by the SVG itself (SMIL) in a loop of 5 s, so that the picture needs no script and stands alone in a
README as well as in a page; where little motion is asked for, and on paper, it shows the instant of the touchdown.
"""

from collections.abc import Callable, Sequence
from html import escape
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flownav.core.measurement import Array
from flownav.core.record import Record
from flownav.report.landing_scene import Course, Scene, scene_of
from flownav.report.panels import metres
from flownav.report.style import FONT, PALETTE

LOOP_S, CLOSE_S = 5.0, 3.0
HIGH_PX, SIDE_PX, ABOVE_PX, CLOSE_PX, GAP_PX, MARGIN_PX = 360, 380, 360, 300, 20, 14
ROUND_M = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
KEY_PX, KEY_LINE_PX = 35.0, 15.0  # of a key's first line, and to the next
WIDE_LETTER_PX, NARROWER_PX = 7.3, 3.0  # of a key's letters in the widest of the page's fonts
WIDEST_PX = 0.4 * HIGH_PX  # a tube that is wider would only tint the picture
TUBE_ELLIPSES = 60  # that a tube of 3 sigma is made of
ROLES: tuple[str, ...] = ("surface", "ink", "muted", "rule", "truth", "flown", "alert", "pad", "padfill", "gps", "flow")
ROLES += tuple(role for role in PALETTE if role.startswith("phase-"))
HERE = Path(__file__).parent
Placed = Callable[[Course], Array]


class Picture(NamedTuple):
    """An SVG, and its words."""

    svg: str
    words: str


def landing_picture(record: Record, *, alone: bool = False, narrow: bool = False) -> Picture | None:
    """The picture; None of a record without a touchdown beside a truth.

    A page gets its views as SVGs that wrap where it is narrow; alone: one SVG for a file of its own, with its colours,
    the views beside each other or, narrow, under each other.
    """
    scene = scene_of(record)
    if scene is None:
        return None
    views = [(_side(scene), SIDE_PX), (_above(scene), ABOVE_PX), (_close(scene), CLOSE_PX)]
    words = _words(scene)
    return Picture(one_svg(views, words, narrow=narrow) if alone else side_by_side(views, words), words)


def side_by_side(views: Sequence[tuple[str, int]], words: str) -> str:
    """Views and their widths [px] as SVGs of one height in a row, which a narrow page breaks."""
    inside = "".join(
        f'<svg class="landing" xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {wide} {HIGH_PX}" '
        f'style="flex:{wide} 1 {0.75 * wide:.0f}px" aria-hidden="true"><g>{view}</g></svg>'
        for view, wide in views
    )
    return f'<div class="landing-views" role="img" aria-label="{escape(words)}">{inside}</div>'


def one_svg(views: Sequence[tuple[str, int]], words: str, *, narrow: bool = False) -> str:
    """Views in a row, or narrow in a column, in one SVG, which has its colours and its ground on light and on dark."""
    before = [[width + GAP_PX for _, width in views[:k]] for k in range(len(views))]
    starts = [(0, (HIGH_PX + GAP_PX) * k) if narrow else (sum(before[k]), 0) for k in range(len(views))]
    wide = max(x + width for (x, _), (_, width) in zip(starts, views, strict=True))
    high = max(y + HIGH_PX for _, y in starts)
    inside = "".join(
        f'<g transform="translate({x} {y})">{view}</g>' for (x, y), (view, _) in zip(starts, views, strict=True)
    )
    around = 2 * MARGIN_PX
    box = f"{-MARGIN_PX} {-MARGIN_PX} {wide + around} {high + around}"
    ground = f'<rect class="ground" x="{-MARGIN_PX}" y="{-MARGIN_PX}" width="100%" height="100%" rx="10"/>'
    light, dark = (";".join(f"--{role}:{PALETTE[role][k]}" for role in ROLES) for k in (0, 1))
    return (
        f'<svg class="landing" xmlns="http://www.w3.org/2000/svg" viewBox="{box}" role="img" '
        f'aria-label="{escape(words)}"><style>.landing{{{light};--font:{escape(FONT, quote=False)}}}'
        f"@media(prefers-color-scheme:dark){{.landing{{{dark}}}}}"
        f"{(HERE / 'landing.css').read_text(encoding='utf-8')}</style>{ground}{inside}</svg>"
    )


# -- the three views -----------------------------------------------------------------------------------------------
def _side(s: Scene) -> str:
    """Height over the ground, seen across the vehicle's heading at the touchdown."""
    scale = min(SIDE_PX / (2.0 * s.half_m), (HIGH_PX - 74.0) / (s.high_m + 0.1))
    ground, middle = HIGH_PX - 26.0, 0.5 * SIDE_PX

    def at(course: Course) -> Array:
        across = course.ned_m[:, 0] * np.cos(s.along) + course.ned_m[:, 1] * np.sin(s.along)
        return np.column_stack([middle + scale * across, ground + scale * course.ned_m[:, 2]])

    truth, estimated = at(s.truth), at(s.estimated)
    half, (north, east, down) = 0.5 * s.pad_m * scale, s.three_sigma_m.T
    radii = scale * np.column_stack([np.hypot(north * np.cos(s.along), east * np.sin(s.along)), down])
    step = next((size for size in ROUND_M if scale * size >= 60.0), ROUND_M[-1])
    marks = [k * step for k in range(int(s.high_m / step) + 1)]
    ticks = "".join(
        f'<line class="rule" x1="0" x2="{SIDE_PX}" y1="{ground - scale * m:.1f}" y2="{ground - scale * m:.1f}"/>'
        f'<text x="0" y="{ground - scale * m - 4:.1f}">{m:g} m</text>' for m in marks
    )  # fmt: skip
    pad = f'<rect class="pad" x="{middle - half:.1f}" y="{ground:.1f}" width="{2 * half:.1f}" height="5"/>'
    moving = [
        _moved(s.shape.side(scale), "ghost", s, estimated, np.degrees(-s.estimated.pitch)),
        _moved(s.shape.side(scale), "vehicle", s, truth, np.degrees(-s.truth.pitch)),
    ]
    compass = f"nose to the right, heading {round(float(np.degrees(s.along))) % 360}\N{DEGREE SIGN}"
    parts = [ticks, pad, _ways(s, at, radii), *moving, _phase_key(s)]
    return view(0, SIDE_PX, f"From the side, {compass}", "".join(parts))


def _above(s: Scene) -> str:
    """The pad from above, north up the page."""
    scale, x, y = (min(ABOVE_PX, HIGH_PX - 60.0)) / (2.0 * s.half_m), 0.5 * ABOVE_PX, 0.5 * (HIGH_PX + 8.0)

    def at(course: Course) -> Array:
        return np.column_stack([x + scale * course.ned_m[:, 1], y - scale * course.ned_m[:, 0]])

    truth, estimated, half = at(s.truth), at(s.estimated), 0.5 * s.pad_m * scale
    pad = f'<rect class="pad" x="{x - half:.1f}" y="{y - half:.1f}" width="{2 * half:.1f}" height="{2 * half:.1f}"/>'
    moving = [
        _moved(s.shape.above(scale), "ghost", s, estimated, np.degrees(s.estimated.heading)),
        _moved(s.shape.above(scale), "vehicle", s, truth, np.degrees(s.truth.heading)),
    ]
    cross = _cross(x + scale * s.touch_m[1], y - scale * s.touch_m[0], 6.0)
    north = '<path class="arrow" d="M14 62V38m-4 7 4-7 4 7"/><text x="14" y="76" text-anchor="middle">N</text>'
    wind = "" if s.wind is None else _wind_arrow(s.wind)
    title = "From above" + (f", the pad is {s.pad_m:g} m square" if s.pad_m else "")
    return view(
        1,
        ABOVE_PX,
        title,
        "".join([pad, _ways(s, at, scale * s.three_sigma_m[:, 1::-1]), *moving, cross, north, wind, scale_bar(scale)]),
    )


def _close(s: Scene) -> str:
    """Where it touched: the cross, the way there, and of many flights every touch and the ring that 95 % are within."""
    scale, x, y = (CLOSE_PX - 24.0) / (2.0 * s.close_m), 0.5 * CLOSE_PX, 0.5 * (HIGH_PX + 8.0)

    def at(course: Course) -> Array:
        return np.column_stack([x + scale * course.ned_m[:, 1], y - scale * course.ned_m[:, 0]])

    truth, estimated = at(s.truth), at(s.estimated)
    centre = f'<path class="centre" d="M{x - 8:.1f} {y:.1f}h16M{x:.1f} {y - 8:.1f}v16"/>'
    dots = "".join(
        f'<circle class="other" cx="{x + scale * e:.1f}" cy="{y - scale * n:.1f}" r="2.5"/>' for n, e in s.others_m
    )
    ring = "" if s.r95_m is None else (
        f'<circle class="ring" cx="{x:.1f}" cy="{y:.1f}" r="{scale * s.r95_m:.1f}"/>'
        f'<text class="ringtext" x="{x:.1f}" y="{y + scale * s.r95_m + 15:.1f}" text-anchor="middle">'
        f"R95 {metres(s.r95_m)} m of {s.flights} flights</text>"
    )  # fmt: skip
    spot = '<circle r="5"/>'
    moving = [_moved(spot, "ghost", s, estimated, None), _moved(spot, "vehicle spot", s, truth, None)]
    cross = _cross(x + scale * s.touch_m[1], y - scale * s.touch_m[0], 8.0)
    late = s.ways[1].t_s > s.touch_s - CLOSE_S
    ends = [at(way)[late] for way in s.ways]
    tube = _tube(ends[1], scale * s.three_sigma_m[late, 1::-1])
    away = float(np.hypot(*s.touch_m))
    title = f"Touchdown, {metres(away)} m off the centre"
    parts = [tube, centre, dots, _lines(*ends), *moving, ring, cross, scale_bar(scale), _key(s, bool(tube))]
    return view(2, CLOSE_PX, title, "".join(parts))


# -- what they are made of -----------------------------------------------------------------------------------------
def view(number: int, wide: float, title: str, inside: str) -> str:
    """A view under its title; number: which of its picture, wide [px]."""
    clip = f'<clipPath id="landing-{number}"><rect y="22" width="{wide}" height="{HIGH_PX - 22}" rx="6"/></clipPath>'
    head = f'<text class="title" x="0" y="13">{escape(title)}</text>'
    return f'{clip}{head}<g clip-path="url(#landing-{number})">{inside}</g>'


def _ways(s: Scene, at: Placed, radii: Array) -> str:
    """The paths of truth, under it its phases in colour, and of the estimate, under it its tube of 3 sigma [px]."""
    truth, estimated = map(at, s.ways)
    t_s, coloured = s.ways[0].t_s, []
    for phase in s.phases:
        part = truth[(t_s >= phase.t0) & (t_s <= phase.t1)]
        if len(part) > 1:
            colour = f'style="stroke:var(--phase-{escape(phase.name)})"'
            coloured.append(f'<polyline class="phase-way" {colour} points="{_points(part)}"/>')
    return f"{_tube(estimated, radii)}{''.join(coloured)}{_lines(truth, estimated)}"


def _tube(way: Array, radii: Array) -> str:
    """Ellipses of 3 sigma along a path, which together are its tube; nothing where none is stated."""
    every = max(1, len(way) // TUBE_ELLIPSES)
    rows = zip(way[::every], radii[::every], strict=True)
    shown = [(*place, *radius) for place, radius in rows if np.isfinite(radius).all() and max(radius) < WIDEST_PX]
    ellipses = "".join(f'<ellipse cx="{x:.1f}" cy="{y:.1f}" rx="{a:.1f}" ry="{b:.1f}"/>' for x, y, a, b in shown)
    return f'<g class="tube">{ellipses}</g>' if ellipses else ""


def _phase_key(s: Scene) -> str:
    """The colours of the phases that the picture shows, over it."""
    t0, t1 = s.ways[0].t_s[0], s.ways[0].t_s[-1]
    return phase_key([phase.name for phase in s.phases if phase.t0 < t1 and phase.t1 > t0], SIDE_PX)


def phase_key(names: Sequence[str], right: float) -> str:
    """The phases' colours and names, each once; what goes beyond `right` [px] stands on a second line."""
    return "".join(
        f'<rect x="{x:.0f}" y="{y - 9:.0f}" width="10" height="10" rx="2" '
        f'style="fill:var(--phase-{escape(name)})"/><text x="{x + 13:.0f}" y="{y:.0f}">{escape(name)}</text>'
        for name, x, y in key_places(names, right)
    )


def key_places(names: Sequence[str], right: float) -> list[tuple[str, float, float]]:
    """Each name once, and where it stands [px]."""
    x, y, places = 0.0, KEY_PX, []
    for name in dict.fromkeys(names):
        wide = 20.0 + WIDE_LETTER_PX * len(name) - NARROWER_PX * sum(letter in "fijlrt" for letter in name)
        x, y = (0.0, y + KEY_LINE_PX) if x + wide > right else (x, y)
        places.append((name, x, y))
        x += wide
    return places


def _lines(truth: Array, estimated: Array) -> str:
    return polyline("way truth", truth) + polyline("way flown", estimated)


def polyline(role: str, way: Array) -> str:
    """A line through places (n, 2) [px], those that are numbers."""
    return f'<polyline class="{role}" points="{_points(way)}"/>'


def dots(role: str, way: Array) -> str:
    """Dots at places (n, 2) [px], those that are numbers: readings, which no line joins."""
    places = "".join(f"M{x:.1f} {y:.1f}h0" for x, y in way[np.isfinite(way).all(axis=1)])
    return f'<path class="{role}" d="{places}"/>'


def _points(way: Array) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in way[np.isfinite(way).all(axis=1)])


def _moved(shape: str, role: str, s: Scene, way: Array, degrees: Array | None) -> str:
    """A shape on its way in the loop, and, where nothing is to move, at the touchdown."""
    still = min(int(np.searchsorted(s.truth.t_s, s.touch_s)), len(way) - 1)
    x, y = way[still]
    turn = "" if degrees is None else f" rotate({degrees[still]:.1f})"
    turning = (
        "" if degrees is None else animated("rotate", [f"{angle:.1f}" for angle in np.unwrap(degrees, period=360)])
    )
    going = animated("translate", [f"{a:.1f} {b:.1f}" for a, b in way])
    return (
        f'<g class="still {role}" transform="translate({x:.1f} {y:.1f}){turn}">{shape}</g>'
        f'<g class="moving {role}">{going}<g>{turning}{shape}</g></g>'
    )


def animated(kind: str, values: Sequence[str]) -> str:
    """A motion ("translate" or "rotate") through values in the loop."""
    return (
        f'<animateTransform attributeName="transform" type="{kind}" dur="{LOOP_S:g}s" repeatCount="indefinite" '
        f'values="{";".join(values)}"/>'
    )


def _cross(x: float, y: float, size: float) -> str:
    wide = f"{2 * size}"
    return f'<path class="cross" d="M{x - size:.1f} {y - size:.1f}l{wide} {wide}m0 -{wide}l-{wide} {wide}"/>'


def _wind_arrow(wind: tuple[float, float]) -> str:
    """An arrow along the wind and its speed, over the pad's upper edge."""
    return (
        f'<g transform="translate({ABOVE_PX - 20} 40) rotate({np.degrees(wind[1]):.0f})"><path class="wind" '
        f'd="M0 15V-15m-6 8 6-8 6 8"/></g><text class="windtext" x="{ABOVE_PX - 44}" y="44" text-anchor="end">'
        f"wind {wind[0]:.1f} m/s</text>"
    )


def scale_bar(scale: float, lengths_m: Sequence[float] = ROUND_M) -> str:
    """A bar of a round length, scale in px/m."""
    length = max((size for size in lengths_m if scale * size <= 110.0), default=lengths_m[0])
    label = f"{100 * length:g} cm" if length < 1.0 else f"{length:g} m"
    right = f"M8 {HIGH_PX - 10}v4h{scale * length:.1f}v-4"
    return f'<path class="arrow" d="{right}"/><text x="{12}" y="{HIGH_PX - 11}">{label}</text>'


def _key(s: Scene, tube: bool) -> str:
    """The names of the colours."""
    band = [("band", "3 \N{GREEK SMALL LETTER SIGMA}")] if tube else []
    touch = [("alert", "\N{MULTIPLICATION SIGN} touchdown")]
    rows = [("truth", "\N{BLACK CIRCLE} truth"), ("flown", "estimate"), *band, *touch]
    return "".join(
        f'<text class="key {role}" x="{CLOSE_PX - 2}" y="{HIGH_PX - 10 - 15 * k}">{escape(name)}</text>'
        for k, (role, name) in enumerate(reversed(rows))
    )


def _words(s: Scene) -> str:
    wind = "" if s.wind is None else f" Wind of {s.wind[0]:.1f} m/s."
    ring = "" if s.r95_m is None else f" 95 % of {s.flights} flights touch within {metres(s.r95_m)} m."
    off, lasts = metres(float(np.hypot(*s.touch_m))), s.touch_s - float(s.truth.t_s[0])
    return (
        f"The last {lasts:.0f} s before the touchdown, {off} m off the pad's centre, in a loop of {LOOP_S:g} s; the "
        "vehicle is to scale, and close up a dot. Dashed: the navigator's estimate that the autopilot uses."
        f"{wind}{ring}"
    )
