"""The phases of a flight: on the ground, climb, hover, transit, descent, approach, touchdown, landed.

They follow from the path and from ground contact alone, so that a simulated flight, a replay and a live session are
divided alike. The path is the truth's, or the estimate's where there is no truth. Contact is the truth's, or else the
landed signal's, the events' or the rangefinder's; where none of these is known, the flight has no phases on the ground.

In the air a stretch climbs or descends where its height changes faster than CLIMB_M_S over WINDOW_S, and is a transit
where it moves faster than TRANSIT_M_S over the ground; else it hovers. A stretch shorter than SHORTEST_S joins the
longer neighbour, except the descent onto the ground. The descent that ends in contact, and a transit within it, is the
approach; from contact until rest is the touchdown, and the ground afterwards is named landed.
"""

from collections.abc import Mapping
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Array
from flownav.core.record import POSITION_NED, Record

GRID_S = 0.1
WINDOW_S = 2.0
CLIMB_M_S = 0.15
TRANSIT_M_S = 0.7
SHORTEST_S = 2.0
SETTLING_M = 0.15
TOUCHDOWN_S = 1.0  # where no rest is scored
CONTACT_RANGE_M = 0.3  # above what the rangefinder read first
LONGEST_CONTACT_GAP_S = 0.5  # skids flutter
NAMES = ("ground", "climb", "hover", "transit", "descent", "approach", "touchdown", "landed")


class Phase(NamedTuple):
    """A stretch of a flight: its name, one of NAMES, and from when to when it lasts [s]."""

    name: str
    t0: float
    t1: float


def phases_of(record: Record) -> list[Phase]:
    """The phases of a record, in order and without gaps; none where it holds no path of at least two instants."""
    source = next((name for name in ("truth", "estimate", "smoothed") if _has(record, name, POSITION_NED)), None)
    if source is None:
        return []
    t_s = np.asarray(record.tables[source]["t_s"], float)
    position = record.matrix(source, POSITION_NED)
    known = np.isfinite(position).all(axis=1) & np.isfinite(t_s)
    t_s, position = t_s[known], position[known]
    if len(t_s) < 2 or t_s[-1] - t_s[0] < GRID_S:
        return []
    grid = np.arange(t_s[0], t_s[-1] + 0.5 * GRID_S, GRID_S)
    path = np.column_stack([np.interp(grid, t_s, column) for column in position.T])
    labels = motion_of(path)
    contact = contact_of(record, grid)
    if contact is not None:
        labels = np.where(contact, NAMES.index("ground"), labels)
    return _named(_merged(_runs(_settling(labels, -path[:, 2]), grid)), record)


def motion_of(path: Array) -> NDArray[np.int64]:
    """The motion of each instant of a path NED (n, 3) at every GRID_S, as a place in NAMES: climb, hover, transit,
    descent."""
    half = max(1, round(0.5 * WINDOW_S / GRID_S))
    ahead = np.minimum(np.arange(len(path)) + half, len(path) - 1)
    behind = np.maximum(np.arange(len(path)) - half, 0)
    velocity = (path[ahead] - path[behind]) / ((ahead - behind)[:, None] * GRID_S)
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    steep = np.abs(velocity[:, 2]) > np.maximum(CLIMB_M_S, 0.2 * speed)  # a transit may rise and sink a little
    names = np.where(speed > TRANSIT_M_S, NAMES.index("transit"), NAMES.index("hover"))
    vertical = np.where(velocity[:, 2] < 0.0, NAMES.index("climb"), NAMES.index("descent"))
    return np.where(steep, vertical, names)


def _settling(labels: NDArray[np.int64], height_m: Array) -> NDArray[np.int64]:
    """A hover that ends in contact sinks at its end, however slowly: its last SETTLING_M of height are a descent."""
    labels, ground, hover = labels.copy(), NAMES.index("ground"), NAMES.index("hover")
    for row in np.flatnonzero((labels[1:] == ground) & (labels[:-1] == hover)):
        first = row
        while first > 0 and labels[first] == hover and height_m[first] < height_m[row + 1] + SETTLING_M:
            first -= 1
        labels[first + 1 : row + 1] = NAMES.index("descent")
    return labels


def contact_of(record: Record, t_s: Array) -> NDArray[np.bool_] | None:
    """Whether the vehicle stands on the ground at each instant (n,); None where the record does not show it."""
    if _has(record, "truth", ("on_ground",)):
        table = record.tables["truth"]
        return _held(np.asarray(table["t_s"], float), np.asarray(table["on_ground"], float) > 0.5, t_s)
    if _has(record, "landed", ("landed",)) and np.asarray(record.tables["landed"]["landed"], float).min() < 0.5:
        table = record.tables["landed"]
        return _held(np.asarray(table["t_s"], float), np.asarray(table["landed"], float) > 0.5, t_s)
    return _by_events(record, t_s) if _by_events(record, t_s) is not None else _by_range(record, t_s)


def _held(times: Array, contacts: NDArray[np.bool_], t_s: Array) -> NDArray[np.bool_]:
    """The last landed state reported at each instant, with breaks in contact shorter than a flutter bridged."""
    rows = np.clip(np.searchsorted(times, t_s, side="right") - 1, 0, len(times) - 1)
    held = contacts[rows]
    width = round(LONGEST_CONTACT_GAP_S / GRID_S)
    for first, last in _stretches(~held):
        if last - first <= width and first > 0 and last < len(held):
            held[first:last] = True
    return held


def _by_events(record: Record, t_s: Array) -> NDArray[np.bool_] | None:
    table = record.tables.get("events", {})
    kinds = [str(kind).lower() for kind in table.get("kind", ())]
    contacts = [(float(t), kind == "touchdown") for t, kind in zip(table.get("t_s", ()), kinds, strict=False)
            if kind in ("lift-off", "lift_off", "takeoff", "touchdown")]  # fmt: skip
    if not contacts:
        return None
    down = np.full(len(t_s), not contacts[0][1])
    for t, on_ground in contacts:
        down[t_s >= t] = on_ground
    return down


def _by_range(record: Record, t_s: Array) -> NDArray[np.bool_] | None:
    """By a rangefinder that begins on the ground: near what it read first, and before or after the flight."""
    if not _has(record, "range", ("range_m",)):
        return None
    table = record.tables["range"]
    distance = np.asarray(table["range_m"], float)
    times = np.asarray(table["t_s"], float)
    known = np.isfinite(distance)
    if known.sum() < 2:
        return None
    first = float(np.median(distance[known][:20]))
    near = np.interp(t_s, times[known], distance[known]) < first + CONTACT_RANGE_M
    away = np.flatnonzero(~near)
    if first > 1.0 or not len(away):
        return None
    near[away[0] : away[-1] + 1] = False
    return np.asarray(near)


def _has(record: Record, table: str, columns: tuple[str, ...]) -> bool:
    there = record.tables.get(table, {})
    return len(there.get("t_s", ())) > 0 and all(name in there for name in columns)


def _stretches(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Where flags hold without a break: from and up to, as places."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    return [(int(first), int(last)) for first, last in zip(edges[::2], edges[1::2], strict=True)]


def _runs(labels: NDArray[np.int64], grid: Array) -> list[Phase]:
    edges = [0, *(np.flatnonzero(np.diff(labels)) + 1).tolist(), len(labels)]
    ends = [*grid[edges[1:-1]], grid[-1]]
    return [
        Phase(NAMES[labels[first]], float(grid[first]), float(end))
        for (first, _), end in zip(pairwise(edges), ends, strict=True)
    ]


def _merged(runs: list[Phase]) -> list[Phase]:
    """Runs in the air that are too short join the longer neighbour in the air, the shortest first."""
    runs = list(runs)
    while True:
        short = [
            (run.t1 - run.t0, k) for k, run in enumerate(runs)
            if run.name != "ground" and run.t1 - run.t0 < SHORTEST_S and not _lands(runs, k)
            and any(runs[n].name != "ground" for n in (k - 1, k + 1) if 0 <= n < len(runs))
        ]  # fmt: skip
        if not short:
            return runs
        k = min(short)[1]
        beside = [n for n in (k - 1, k + 1) if 0 <= n < len(runs) and runs[n].name != "ground"]
        name = runs[max(beside, key=lambda n: runs[n].t1 - runs[n].t0)].name
        runs[k] = runs[k]._replace(name=name)
        runs = _joined(runs)


def _lands(runs: list[Phase], k: int) -> bool:
    """Whether a run is the descent onto the ground, which is kept however short it is."""
    return runs[k].name == "descent" and k + 1 < len(runs) and runs[k + 1].name == "ground"


def _joined(runs: list[Phase]) -> list[Phase]:
    """Neighbours of one name as one."""
    joined: list[Phase] = []
    for run in runs:
        if joined and joined[-1].name == run.name:
            joined[-1] = joined[-1]._replace(t1=run.t1)
        else:
            joined.append(run)
    return joined


def _named(runs: list[Phase], record: Record) -> list[Phase]:
    """The approach before a contact, the touchdown and the ground after it."""
    named: list[Phase] = []
    for k, run in enumerate(runs):
        lands = run.name == "ground" and k > 0
        if lands:
            for before in range(len(named) - 1, -1, -1):
                if named[before].name not in ("descent", "transit") or (
                    named[before].name == "transit" and not any(p.name == "approach" for p in named[before:])
                ):
                    break
                named[before] = named[before]._replace(name="approach")
            rest = min(_rest_s(record, run), run.t1)
            named += [Phase("touchdown", run.t0, rest), Phase("landed", rest, run.t1)]
        else:
            named.append(run)
    return [phase for phase in _joined(named) if phase.t1 > phase.t0]


def _rest_s(record: Record, ground: Phase) -> float:
    """When the vehicle rests after the contact that begins this stretch of ground [s]."""
    scores: Any = record.manifest.get("scores")
    landing = scores.get("touchdown") if isinstance(scores, Mapping) else None
    rest = landing.get("rest") if isinstance(landing, Mapping) else None
    t_s = rest.get("t_s") if isinstance(rest, Mapping) else None
    if isinstance(t_s, (int, float)) and ground.t0 - GRID_S <= t_s <= ground.t1:
        return max(float(t_s), ground.t0)
    return ground.t0 + TOUCHDOWN_S


def phase_at(phases: list[Phase], t_s: float) -> str:
    """The name of the phase of an instant; "" before the first and after the last."""
    return next((phase.name for phase in phases if phase.t0 <= t_s <= phase.t1), "")
