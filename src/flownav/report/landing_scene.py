"""The content of a landing's picture: the vehicle's path, the navigator's estimate, pad, touchdown, wind."""

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any, NamedTuple

import numpy as np

from flownav.core.frames import rotation_from_quaternion
from flownav.core.measurement import Array
from flownav.core.record import POSITION_NED, QUATERNION, Record, mapping
from flownav.report.series import has
from flownav.report.sureness import three_sigma
from flownav.report.vehicle_shape import Shape, shape_of
from flownav.scoring.phases import Phase, phases_of

AFTER_S = 1.5
FROM_M, SHOWN_S = 2.0, (8.0, 40.0)  # the picture begins where the skids were last so high; so long it lasts
FRAMES, WAY_POINTS, DOTS = 72, 240, 400  # that a thing moves through, of a drawn path, of other flights
CONTACT = ("t_s", "distance_m", "north_m", "east_m")


class Course(NamedTuple):
    """A vehicle over the pad: instants (n,), the middle of its skids NED [m], (n, 3), angles [rad]."""

    t_s: Array
    ned_m: Array
    pitch: Array
    heading: Array


class Scene(NamedTuple):
    """The content of the picture; along: the heading [rad] that the side view has to its right.

    ways: the drawn paths of truth and estimate; three_sigma_m: what the filter states along the second, NED, (n, 3),
    NaN where it states nothing.
    """

    truth: Course
    estimated: Course
    ways: tuple[Course, Course]
    phases: list[Phase]
    three_sigma_m: Array
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


def scene_of(record: Record) -> Scene | None:
    """The scene of a record; None without a touchdown, a truth and an estimate with attitude."""
    contact = mapping(mapping(mapping(record.manifest.get("scores")).get("touchdown")).get("contact"))
    estimated = "flown" if has(record, "flown", (*POSITION_NED, *QUATERNION)) else "estimate"
    known = all(has(record, name, (*POSITION_NED, *QUATERNION)) for name in ("truth", estimated))
    if not known or record.manifest.get("kind") != "fly" or len(_numbers(contact, CONTACT)) < len(CONTACT):
        return None
    shape, touch_s = shape_of(record), contact["t_s"]
    span = _begins(record, touch_s, shape.skids_below_m), touch_s + AFTER_S
    truth, flown, *ways = (
        _course(record, name, np.linspace(*span, count), shape.skids_below_m)
        for count in (FRAMES, WAY_POINTS)
        for name in ("truth", estimated)
    )
    touch = contact["north_m"], contact["east_m"]
    pad_m = float(record.manifest.get("pad_size_m") or 0.0)
    reach = float(np.hypot(*truth.ned_m[:, :2].T).max()) + shape.reach_m
    many = mapping(record.manifest.get("many"))
    r95 = _numbers(many, ("r95_m",)).get("r95_m")
    near = [1.6 * contact["distance_m"], r95 or 0.0, 0.03]
    return Scene(
        truth, flown, (ways[0], ways[1]), phases_of(record), three_sigma(record, ways[1].t_s),
        touch_s, touch,
        float(truth.heading[-1]), min(max(0.6 * pad_m, reach), 8.0), float(np.max(-truth.ned_m[:, 2])) + shape.high_m,
        1.35 * max(near), pad_m, shape, _wind(record), _others(many), r95,
        int(_numbers(many, ("flights",)).get("flights", 1)),
    )  # fmt: skip


def _numbers(numbers: Mapping[str, Any], names: Sequence[str]) -> dict[str, float]:
    """The finite numbers among these entries: a manifest comes from a file."""
    found = {name: numbers.get(name) for name in names}
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
