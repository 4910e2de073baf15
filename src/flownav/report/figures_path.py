"""The path over the ground: top view and 3-D view over the pad."""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Array, Sensor
from flownav.core.record import POSITION_NED, Record
from flownav.report.chart import LINE_POINTS, thin
from flownav.report.panels import Panel, listed
from flownav.report.series import Track, Window, at, estimates, moments, outages, readings

JUMP_M = 0.5  # from one row to the next: what is flown on jumps so far as a pad is found


class Pad(NamedTuple):
    """The landing pad: a square on the ground about the origin, length of a side [m]."""

    size_m: float

    def corners(self) -> Array:
        """North, east, down of the closed outline, shape (5, 3)."""
        half = 0.5 * self.size_m
        north, east = half * np.array([-1, 1, 1, -1, -1]), half * np.array([-1, -1, 1, 1, -1])
        return np.column_stack([north, east, np.zeros(5)])


@dataclass(frozen=True)
class Paths:
    """What moved where: (role, name, track NED [m]) with the truth last, GPS readings, the pad, the touchdown (3,)."""

    tracks: tuple[tuple[str, str, Track], ...]
    gps: Track | None
    pad: Pad | None
    touch: Array | None
    outages: tuple[Window, ...]

    def main(self) -> tuple[str, str, Track]:
        """The path that stands for the vehicle: the truth's, or else the estimate's."""
        return self.tracks[-1]

    def names(self) -> list[str]:
        """What is drawn, in words."""
        gps, where = ["GPS"] * (self.gps is not None), ["pad"] * (self.pad is not None)
        return [*where, *gps, *(name for _, name, _ in self.tracks), *["touchdown"] * (self.touch is not None)]


@dataclass(frozen=True)
class View:
    """A way to look at the paths: from above, or in space."""

    paths: Paths
    from_where: Literal["above", "space"]


def pad(record: Record) -> Pad | None:
    """The pad of manifest["pad_size_m"], None where the record states none."""
    size_m = record.manifest.get("pad_size_m")
    return Pad(float(size_m)) if isinstance(size_m, (int, float)) else None


def paths_of(record: Record) -> Paths | None:
    """The paths of a record; None where it holds no position."""
    tracks = tuple(estimates(record, POSITION_NED))
    if not tracks:
        return None
    gps = readings(record, Sensor.GPS_POSITION)
    return Paths(tracks, gps, pad(record), _touchdown(record, tracks[-1][2]), tuple(outages(record)))


def _touchdown(record: Record, path: Track) -> Array | None:
    touch = next((m.t_s for m in moments(record) if m.name == "touchdown"), None)
    if touch is None:
        return None
    point = at(np.array([touch]), path)[0]
    return None if np.isnan(point).any() else point


def drawn_rows(role: str, path: Track) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows of a path that are drawn, and places among them before which it is open, as what is flown on jumps."""
    steps = np.linalg.norm(np.diff(path.value, axis=0), axis=1) if role == "flown" else np.zeros(0)
    jumps = np.flatnonzero(steps > JUMP_M) + 1
    kept = np.union1d(thin(LINE_POINTS, *path.value.T), np.concatenate([jumps - 1, jumps]))
    return kept, np.searchsorted(kept, jumps)


def path_over_pad(record: Record) -> Panel:
    """3-D view of the path over the pad; height is drawn upwards."""
    paths = paths_of(record)
    key, title = "path-3d", "Path over the pad" if pad(record) else "Path in space"
    if paths is None:
        return Panel(key, title, absent="The record holds no positions.")
    caption = "Drag to turn, or use the arrow keys. The stem under the vehicle stands on the ground below it."
    where = ", over the pad" if paths.pad else ""
    alt = f"Path in space: {listed([name for _, name, _ in paths.tracks])}{where}."
    return Panel(key, title, caption, alt, View(paths, "space"))


def ground_track(record: Record) -> Panel:
    """Top view: north up the page, east to the right, GPS readings, paths, pad, outages."""
    paths = paths_of(record)
    key, title = "ground-track", "Ground track"
    if paths is None:
        return Panel(key, title, absent="The record holds no positions.")
    caption = f"From above, {paths.main()[1]} coloured by time. Point at it to move to that instant."
    caption += f" The pad is {paths.pad.size_m:g} m square." if paths.pad else ""
    return Panel(key, title, caption, f"Path over the ground from above: {listed(paths.names())}.",
                 View(paths, "above"))  # fmt: skip
