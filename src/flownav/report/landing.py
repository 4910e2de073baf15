"""The picture of a landing: from the side and from above, the vehicle to scale, and the touchdown close up, as one SVG.

What moves is moved by the SVG itself (SMIL) in a loop of 5 s, so that the picture needs no script and stands alone in a
README as well as in a page; where little motion is asked for, and on paper, it shows the instant of the touchdown.
"""

from collections.abc import Mapping, Sequence
from html import escape
from math import isfinite
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flownav.core.frames import rotation_from_quaternion
from flownav.core.measurement import Array
from flownav.core.record import POSITION_NED, QUATERNION, Record, mapping
from flownav.report.panels import metres
from flownav.report.series import has
from flownav.report.style import FONT, PALETTE
from flownav.report.vehicle_shape import Shape, shape_of

LOOP_S, CLOSE_S, AFTER_S = 5.0, 3.0, 1.5
FROM_M, SHOWN_S = 2.0, (8.0, 40.0)  # the picture begins where the skids were last so high; so long it lasts
FRAMES, WAY_POINTS, DOTS = 72, 400, 400  # that a thing moves through, of a drawn path, of other flights
HIGH_PX, SIDE_PX, ABOVE_PX, CLOSE_PX, GAP_PX = 360, 380, 360, 300, 20
WIDE_PX = SIDE_PX + ABOVE_PX + CLOSE_PX + 2 * GAP_PX
CONTACT = ("t_s", "distance_m", "north_m", "east_m")
ROUND_M = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
ROLES = ("surface", "ink", "muted", "rule", "truth", "flown", "alert", "pad", "padfill", "gps", "flow")


class Picture(NamedTuple):
    """An SVG, and its words."""

    svg: str
    words: str


class Course(NamedTuple):
    """A vehicle over the pad: instants (n,), the middle of its skids NED [m], (n, 3), angles [rad]."""

    t_s: Array
    ned_m: Array
    pitch: Array
    heading: Array


class Scene(NamedTuple):
    """What the picture shows; along: the heading [rad] that the side view has to its right."""

    truth: Course
    said: Course
    ways: tuple[Course, Course]
    name: str
    touch_s: float
    touch_m: tuple[float, float]
    along: float
    half_m: float
    high_m: float
    close_m: float
    pad_m: float
    shape: Shape
    wind: tuple[float, float] | None
    others_m: Array
    r95_m: float | None
    flights: int


def landing_picture(record: Record, *, alone: bool = False) -> Picture | None:
    """The picture; None of a record without a touchdown beside a truth. alone: a file of its own, with its colours."""
    scene = scene_of(record)
    if scene is None:
        return None
    words, right = _words(scene), (0, SIDE_PX + GAP_PX, SIDE_PX + ABOVE_PX + 2 * GAP_PX)
    views = (_side(scene), _above(scene), _close(scene))
    inside = "".join(f'<g transform="translate({x} 0)">{view}</g>' for x, view in zip(right, views, strict=True))
    return Picture(
        f'<svg class="landing" xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDE_PX} {HIGH_PX}" role="img" '
        f'aria-label="{escape(words)}"><style>{_style(alone)}</style>{inside}</svg>',
        words,
    )


def scene_of(record: Record) -> Scene | None:
    """What there is to draw; None without a touchdown, a truth and an estimate with attitude beside it."""
    contact = mapping(mapping(mapping(record.manifest.get("scores")).get("touchdown")).get("contact"))
    said = "flown" if has(record, "flown", (*POSITION_NED, *QUATERNION)) else "estimate"
    known = all(has(record, name, (*POSITION_NED, *QUATERNION)) for name in ("truth", said))
    if not known or record.manifest.get("kind") != "fly" or len(_numbers(contact, CONTACT)) < len(CONTACT):
        return None
    shape, touch_s = shape_of(record), contact["t_s"]
    span = _begins(record, touch_s, shape.skids_below_m), touch_s + AFTER_S
    truth, flown, *ways = (
        _course(record, name, np.linspace(*span, count), shape.skids_below_m)
        for count in (FRAMES, WAY_POINTS)
        for name in ("truth", said)
    )
    touch = contact["north_m"], contact["east_m"]
    pad_m = float(record.manifest.get("pad_size_m") or 0.0)
    reach = float(np.hypot(*truth.ned_m[:, :2].T).max()) + shape.reach_m
    many = mapping(record.manifest.get("many"))
    r95 = _numbers(many, ("r95_m",)).get("r95_m")
    near = [1.6 * contact["distance_m"], r95 or 0.0, 0.03]
    return Scene(
        truth, flown, (ways[0], ways[1]), "autopilot's input" if said == "flown" else "estimate", touch_s, touch,
        float(truth.heading[-1]), min(max(0.6 * pad_m, reach), 8.0), float(np.max(-truth.ned_m[:, 2])) + shape.high_m,
        1.35 * max(near), pad_m, shape, _wind(record), _others(many), r95,
        int(_numbers(many, ("flights",)).get("flights", 1)),
    )  # fmt: skip


def _numbers(said: Mapping[str, Any], names: Sequence[str]) -> dict[str, float]:
    """Those of the names that say a finite number: a manifest comes from a file."""
    found = {name: said.get(name) for name in names}
    return {name: float(value) for name, value in found.items() if isinstance(value, int | float) and isfinite(value)}


def _others(many: Mapping[str, Any]) -> Array:
    """Where other flights touched, north and east [m], (n, 2)."""
    axes = [many.get("north_m"), many.get("east_m")]
    pairs = zip(*(axis if isinstance(axis, list) else () for axis in axes), strict=False)
    known = [pair for pair in pairs if all(isinstance(value, float) for value in pair)]
    return np.asarray(known[:DOTS], float).reshape(-1, 2)


def _begins(record: Record, touch_s: float, below_m: float) -> float:
    """When the picture begins [s]: as the skids are last at FROM_M, within SHOWN_S before the touchdown."""
    truth = record.tables["truth"]
    t_s, high_m = np.asarray(truth["t_s"], float), -np.asarray(truth["pos_d_m"], float) - below_m
    above = t_s[(high_m > FROM_M) & (t_s < touch_s)]
    shown_s = float(np.clip(touch_s - above[-1] if len(above) else SHOWN_S[1], *SHOWN_S))
    return max(touch_s - shown_s, float(t_s[0]))


def _course(record: Record, name: str, t_s: Array, below_m: float) -> Course:
    table = record.tables[name]
    rows = np.clip(np.searchsorted(np.asarray(table["t_s"], float), t_s), 0, len(table["t_s"]) - 1)
    place, attitude = record.matrix(name, POSITION_NED)[rows], record.matrix(name, QUATERNION)[rows]
    r = np.asarray(rotation_from_quaternion(*attitude.T))  # rows of the matrix one after the other, (9, n)
    return Course(t_s, place + below_m * r[[2, 5, 8]].T, np.arcsin(-np.clip(r[6], -1, 1)), np.arctan2(r[3], r[0]))


def _wind(record: Record) -> tuple[float, float] | None:
    """Speed [m/s] and the heading [rad] that the wind blows to; None without one."""
    parameters = mapping(record.manifest.get("parameters"))
    stated, drawn = mapping(mapping(parameters.get("scenario")).get("wind")), mapping(parameters.get("drawn"))
    speed, origin = (drawn.get(f"wind.{key}", stated.get(key)) for key in ("speed_20ft_m_s", "from_direction_deg"))
    if not isinstance(speed, (int, float)) or not isinstance(origin, (int, float)) or speed <= 0.0:
        return None
    return float(speed), float(np.radians(origin + 180.0))


# -- the three views -----------------------------------------------------------------------------------------------
def _side(s: Scene) -> str:
    """Height over the ground, seen across the vehicle's heading at the touchdown."""
    scale = min(SIDE_PX / (2.0 * s.half_m), (HIGH_PX - 56.0) / (s.high_m + 0.1))
    ground, middle = HIGH_PX - 26.0, 0.5 * SIDE_PX

    def at(course: Course) -> Array:
        across = course.ned_m[:, 0] * np.cos(s.along) + course.ned_m[:, 1] * np.sin(s.along)
        return np.column_stack([middle + scale * across, ground + scale * course.ned_m[:, 2]])

    truth, said = at(s.truth), at(s.said)
    half = 0.5 * s.pad_m * scale
    step = next((size for size in ROUND_M if scale * size >= 60.0), ROUND_M[-1])
    marks = [k * step for k in range(int(s.high_m / step) + 1)]
    ticks = "".join(
        f'<line class="rule" x1="0" x2="{SIDE_PX}" y1="{ground - scale * m:.1f}" y2="{ground - scale * m:.1f}"/>'
        f'<text x="0" y="{ground - scale * m - 4:.1f}">{m:g} m</text>' for m in marks
    )  # fmt: skip
    pad = f'<rect class="pad" x="{middle - half:.1f}" y="{ground:.1f}" width="{2 * half:.1f}" height="5"/>'
    moving = [
        _moved(s.shape.side(scale), "ghost", s, said, np.degrees(-s.said.pitch)),
        _moved(s.shape.side(scale), "vehicle", s, truth, np.degrees(-s.truth.pitch)),
    ]
    compass = f"nose to the right, heading {np.degrees(s.along) % 360.0:.0f}\N{DEGREE SIGN}"
    return _view(0, SIDE_PX, f"From the side, {compass}", f"{ticks}{pad}{_lines(*map(at, s.ways))}{''.join(moving)}")


def _above(s: Scene) -> str:
    """The pad from above, north up the page."""
    scale, x, y = (min(ABOVE_PX, HIGH_PX - 60.0)) / (2.0 * s.half_m), 0.5 * ABOVE_PX, 0.5 * (HIGH_PX + 8.0)

    def at(course: Course) -> Array:
        return np.column_stack([x + scale * course.ned_m[:, 1], y - scale * course.ned_m[:, 0]])

    truth, said, half = at(s.truth), at(s.said), 0.5 * s.pad_m * scale
    pad = f'<rect class="pad" x="{x - half:.1f}" y="{y - half:.1f}" width="{2 * half:.1f}" height="{2 * half:.1f}"/>'
    moving = [
        _moved(s.shape.above(scale), "ghost", s, said, np.degrees(s.said.heading)),
        _moved(s.shape.above(scale), "vehicle", s, truth, np.degrees(s.truth.heading)),
    ]
    cross = _cross(x + scale * s.touch_m[1], y - scale * s.touch_m[0], 6.0)
    north = '<path class="arrow" d="M14 62V38m-4 7 4-7 4 7"/><text x="14" y="76" text-anchor="middle">N</text>'
    wind = "" if s.wind is None else _wind_arrow(s.wind)
    title = "From above" + (f", the pad is {s.pad_m:g} m square" if s.pad_m else "")
    return _view(
        1, ABOVE_PX, title, f"{pad}{_lines(*map(at, s.ways))}{''.join(moving)}{cross}{north}{wind}{_bar(scale)}"
    )


def _close(s: Scene) -> str:
    """Where it touched: the cross, the way there, and of many flights every touch and the ring that 95 % are within."""
    scale, x, y = (CLOSE_PX - 24.0) / (2.0 * s.close_m), 0.5 * CLOSE_PX, 0.5 * (HIGH_PX + 8.0)

    def at(course: Course) -> Array:
        return np.column_stack([x + scale * course.ned_m[:, 1], y - scale * course.ned_m[:, 0]])

    truth, said = at(s.truth), at(s.said)
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
    moving = [_moved(spot, "ghost", s, said, None), _moved(spot, "vehicle spot", s, truth, None)]
    cross = _cross(x + scale * s.touch_m[1], y - scale * s.touch_m[0], 8.0)
    ends = [at(way)[way.t_s > s.touch_s - CLOSE_S] for way in s.ways]
    away = float(np.hypot(*s.touch_m))
    title = f"Touchdown, {metres(away)} m off the centre"
    return _view(2, CLOSE_PX, title,
                 f"{centre}{dots}{_lines(*ends)}{''.join(moving)}{ring}{cross}{_bar(scale)}{_key(s)}")  # fmt: skip


# -- what they are made of -----------------------------------------------------------------------------------------
def _view(number: int, wide: float, title: str, inside: str) -> str:
    clip = f'<clipPath id="landing-{number}"><rect y="22" width="{wide}" height="{HIGH_PX - 22}" rx="6"/></clipPath>'
    head = f'<text class="title" x="0" y="13">{escape(title)}</text>'
    return f'{clip}{head}<g clip-path="url(#landing-{number})">{inside}</g>'


def _lines(truth: Array, said: Array) -> str:
    drawn = (("truth", truth), ("flown", said))
    return "".join(f'<polyline class="way {role}" points="{_points(way)}"/>' for role, way in drawn)


def _points(way: Array) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in way[np.isfinite(way).all(axis=1)])


def _moved(shape: str, role: str, s: Scene, way: Array, degrees: Array | None) -> str:
    """A shape on its way in the loop, and, where nothing is to move, at the touchdown."""
    still = min(int(np.searchsorted(s.truth.t_s, s.touch_s)), len(way) - 1)
    x, y = way[still]
    turn = "" if degrees is None else f" rotate({degrees[still]:.1f})"
    turning = (
        "" if degrees is None else _animated("rotate", [f"{angle:.1f}" for angle in np.unwrap(degrees, period=360)])
    )
    going = _animated("translate", [f"{a:.1f} {b:.1f}" for a, b in way])
    return (
        f'<g class="still {role}" transform="translate({x:.1f} {y:.1f}){turn}">{shape}</g>'
        f'<g class="moving {role}">{going}<g>{turning}{shape}</g></g>'
    )


def _animated(kind: str, values: Sequence[str]) -> str:
    return (
        f'<animateTransform attributeName="transform" type="{kind}" dur="{LOOP_S:g}s" repeatCount="indefinite" '
        f'values="{";".join(values)}"/>'
    )


def _cross(x: float, y: float, size: float) -> str:
    wide = f"{2 * size}"
    return f'<path class="cross" d="M{x - size:.1f} {y - size:.1f}l{wide} {wide}m0 -{wide}l-{wide} {wide}"/>'


def _wind_arrow(wind: tuple[float, float]) -> str:
    """An arrow along the wind, in a corner."""
    return (
        f'<g transform="translate({ABOVE_PX - 44} 54) rotate({np.degrees(wind[1]):.0f})"><path class="wind" '
        f'd="M0 17V-17m-6 9 6-9 6 9"/></g><text class="windtext" x="{ABOVE_PX - 44}" y="88" text-anchor="middle">'
        f"wind {wind[0]:.1f} m/s</text>"
    )


def _bar(scale: float) -> str:
    """A bar of a round length."""
    length = max((size for size in ROUND_M if scale * size <= 110.0), default=ROUND_M[0])
    said = f"{100 * length:g} cm" if length < 1.0 else f"{length:g} m"
    right = f"M8 {HIGH_PX - 10}v4h{scale * length:.1f}v-4"
    return f'<path class="arrow" d="{right}"/><text x="{12}" y="{HIGH_PX - 11}">{said}</text>'


def _key(s: Scene) -> str:
    """The names of the colours."""
    rows = [("truth", "truth"), ("flown", s.name), ("alert", "touchdown")]
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
        f"vehicle is to scale. Dashed: {s.name}, what the navigator made of it.{wind}{ring}"
    )


def _style(alone: bool) -> str:
    """The picture's own rules; a page brings the colours, a file of its own has them on light and on dark."""
    rules = (Path(__file__).parent / "landing.css").read_text(encoding="utf-8")
    if not alone:
        return rules
    light, dark = (";".join(f"--{role}:{PALETTE[role][k]}" for role in ROLES) for k in (0, 1))
    return (
        f".landing{{{light};--font:{escape(FONT, quote=False)}}}"
        f"@media(prefers-color-scheme:dark){{.landing{{{dark}}}}}{rules}"
    )
