"""A record's paths as text: TUM and EuRoC in the local frame, KML and GPX on the earth.

TUM: `t x y z qx qy qz qw`, seconds and metres, comment lines begin with #
(Sturm et al. 2012, file formats of the RGB-D benchmark).
EuRoC: comma-separated, nanoseconds, position, quaternion w first, velocity (Burri et al. 2016,
state_groundtruth_estimate0). Its bias columns are left out, header and all: no figure is made up.
KML 2.2 with gx:Track (https://developers.google.com/kml/documentation/kmlreference), GPX 1.1
(https://www.topografix.com/gpx/1/1/). Both are a dozen elements, written with the standard library: simplekml's last
release is of 2021, and no writer would know more of a track than its points.
"""

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from contextlib import ExitStack
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flownav.core.errors import InputError, arg
from flownav.core.guard import write_text, written_whole
from flownav.core.marks import DECLARATION, XML, marked, marked_table
from flownav.core.measurement import Array
from flownav.core.record import POSITION_NED, Record
from flownav.export.trajectory import Trajectory, stamps, trajectories

AXES = {"ned": "earth NED, body FRD", "enu": "earth ENU, body FLU"}
EUROC_POSE = (
    *("#timestamp [ns]", "p_RS_R_x [m]", "p_RS_R_y [m]", "p_RS_R_z [m]"),
    *("q_RS_w []", "q_RS_x []", "q_RS_y []", "q_RS_z []"),
)
EUROC_VELOCITY = ("v_RS_R_x [m s^-1]", "v_RS_R_y [m s^-1]", "v_RS_R_z [m s^-1]")
KML, GX, GPX = (
    "http://www.opengis.net/kml/2.2",
    "http://www.google.com/kml/ext/2.2",
    "http://www.topografix.com/GPX/1/1",
)
COLOURS = {
    "estimate": "ffb45f0a",
    "smoothed": "ff6b2f9a",
    "truth": "ff191916",
    "autopilot": "ffa83983",
    "GPS": "ff0b5bbf",
}
UNDATED_S = 1e9  # a clock below this counts from a boot, not from 1970
MOST_ALTITUDE_M = 1e5

Origin = tuple[float, float, float]


def tum_text(path: Trajectory, frame: str) -> str:
    """A path as a TUM file, whose first line states its frame."""
    lines = [f"# flownav {path.name}; {AXES[frame]}; t_s x y z qx qy qz qw"]
    rows = np.column_stack([path.t_s, path.position_m, path.quaternion[:, [1, 2, 3, 0]]])
    lines += [" ".join(f"{value:.9f}" for value in row) for row in rows.tolist()]
    return "\n".join(lines) + "\n"


def euroc_text(path: Trajectory, frame: str) -> str:
    """A path as EuRoC CSV; without velocity columns where the path has none. The format has no place for the frame."""
    names, columns = list(EUROC_POSE), [path.position_m, path.quaternion]
    if path.velocity_m_s is not None:
        names, columns = [*names, *EUROC_VELOCITY], [*columns, path.velocity_m_s]
    rows = np.column_stack(columns).tolist()
    times = stamps(path.t_s, 1e9).tolist()
    lines = [f"{t}," + ",".join(f"{value:.9f}" for value in row) for t, row in zip(times, rows, strict=True)]
    return "\n".join([",".join(names), *lines]) + "\n"


TEXTS = {".tum": (tum_text, marked), ".csv": (euroc_text, marked_table)}  # by suffix, and how each is marked


def write_poses(record: Record, path: Path, frame: str) -> tuple[list[Path], list[str]]:
    """Write each path of the record beside `path`, NAME_estimate and so on, all or none; the files and notes.

    The suffix of `path` decides the format: .tum or .csv (EuRoC). InputError where the record holds no path.
    """
    paths = trajectories(record, frame)
    files = [path.with_name(f"{path.stem}_{one.name}{path.suffix}") for one in paths]
    with ExitStack() as stack:
        for one, file in zip(paths, files, strict=True):
            text, mark = TEXTS[path.suffix]
            stack.enter_context(written_whole(file)).write_bytes(mark(text(one, frame)))
    return files, [note for one in paths for note in one.notes]


# -- on the earth -------------------------------------------------------------------------------------------
class Track(NamedTuple):
    """A path: name; t_s (n,); lat_deg, lon_deg, alt_m as columns (n, 3)."""

    name: str
    t_s: Array
    place: Array


def origin_from(text: str) -> Origin:
    """Latitude, longitude [deg] and altitude [m] of "LAT,LON,ALT". InputError where it is none."""
    parts = text.split(",")
    try:
        latitude, longitude, altitude = map(float, parts)
    except ValueError:
        raise InputError(
            f"{arg('origin')} {text}: LAT,LON,ALT is needed, in degrees and metres: 47.3977,8.5456,488"
        ) from None
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0 and abs(altitude) < MOST_ALTITUDE_M):
        raise InputError(f"{arg('origin')} {text}: latitude to 90, longitude to 180 degrees, altitude in metres")
    return latitude, longitude, altitude


def origin_of(record: Record) -> Origin:
    """Where the record's origin lies on the earth. InputError where it does not state it."""
    parameters = record.manifest.get("parameters")
    stated = parameters.get("origin_lat_lon_deg_alt_m") if isinstance(parameters, dict) else None
    if not isinstance(stated, list | tuple) or len(stated) != 3:
        raise InputError(
            "the record does not say where on earth its origin is (simulated, or without GPS); "
            f"give {arg('origin')} LAT,LON,ALT, in degrees and metres"
        )
    return origin_from(",".join(map(str, stated)))


def tracks(record: Record, origin: Origin) -> tuple[list[Track], list[str]]:
    """Every path of the record and its GPS positions on the earth; notes."""
    import pymap3d

    paths = trajectories(record)
    found = [(path.name, path.t_s, path.position_m) for path in paths]
    notes = [note for path in paths for note in path.notes if "attitude" not in note]
    table = record.tables.get("gps_position", {})
    if {"t_s", *POSITION_NED} <= table.keys():
        t_s, position = np.asarray(table["t_s"], float), record.matrix("gps_position", POSITION_NED)
        rows = np.flatnonzero(np.isfinite(t_s) & np.isfinite(position).all(axis=1))
        rows = rows[np.argsort(t_s[rows], kind="stable")]
        if len(rows):
            found.append(("GPS", t_s[rows], position[rows]))
    return [
        Track(name, t_s, np.column_stack(pymap3d.ned2geodetic(*position.T, *origin))) for name, t_s, position in found
    ], notes


def write_earth(record: Record, path: Path, to: str, origin: Origin | None) -> tuple[list[Path], list[str]]:
    """Write the record's tracks as KML or GPX, whole or not at all; the file and notes.

    origin: where the record's origin is; None takes the record's own. InputError where neither is stated, or the record
    holds no path.
    """
    found, notes = tracks(record, origin or origin_of(record))
    start_s = record.manifest.get("clock_start_s")
    dated = isinstance(start_s, int | float) and start_s > UNDATED_S
    if not dated:
        notes.append("times count from 1970-01-01: the record does not say on which day it flew")
    stamp = _stamps(float(start_s) if isinstance(start_s, int | float) and dated else 0.0)
    tree = (_kml if to == "kml" else _gpx)(record, found, stamp)
    ElementTree.indent(tree)
    write_text(DECLARATION + ElementTree.tostring(tree, encoding="unicode"), path, XML)
    return [path], notes


def _stamps(start_s: float) -> Callable[[float], str]:
    """Times as ISO 8601 in UTC, milliseconds; t_s counts from `start_s` after 1970."""
    begin = datetime(1970, 1, 1, tzinfo=UTC)

    def text(t_s: float) -> str:
        moment = begin + timedelta(milliseconds=round(1e3 * (start_s + t_s)))
        return moment.strftime("%Y-%m-%dT%H:%M:%S.") + f"{moment.microsecond // 1000:03d}Z"

    return text


def _name(record: Record) -> str:
    return str(record.manifest.get("log") or record.manifest.get("scenario") or "a record")


def _kml(record: Record, found: list[Track], stamp: Callable[[float], str]) -> Any:
    """A document with a gx:Track for each path; altitudes are of the kind that the origin's is."""
    ElementTree.register_namespace("", KML)
    ElementTree.register_namespace("gx", GX)
    root = ElementTree.Element(f"{{{KML}}}kml")
    document = _child(root, KML, "Document")
    _child(document, KML, "name", f"flownav: {_name(record)}")
    for track in found:
        style = _child(document, KML, "Style")
        style.set("id", track.name)
        line = _child(style, KML, "LineStyle")
        _child(line, KML, "color", COLOURS[track.name])
        _child(line, KML, "width", "3")
    for track in found:
        mark = _child(document, KML, "Placemark")
        _child(mark, KML, "name", track.name)
        _child(mark, KML, "styleUrl", f"#{track.name}")
        drawn = _child(mark, GX, "Track")
        _child(drawn, KML, "altitudeMode", "absolute")
        for t_s in track.t_s.tolist():
            _child(drawn, KML, "when", stamp(t_s))
        for latitude, longitude, altitude in track.place.tolist():
            _child(drawn, GX, "coord", f"{longitude:.9f} {latitude:.9f} {altitude:.3f}")
    return root


def _gpx(record: Record, found: list[Track], stamp: Callable[[float], str]) -> Any:
    """A trk of one segment for each path."""
    ElementTree.register_namespace("", GPX)
    root = ElementTree.Element(f"{{{GPX}}}gpx", {"version": "1.1", "creator": "flownav"})
    _child(_child(root, GPX, "metadata"), GPX, "name", _name(record))
    for track in found:
        element = _child(root, GPX, "trk")
        _child(element, GPX, "name", track.name)
        segment = _child(element, GPX, "trkseg")
        for t_s, (latitude, longitude, altitude) in zip(track.t_s.tolist(), track.place.tolist(), strict=True):
            point = _child(segment, GPX, "trkpt")
            point.set("lat", f"{latitude:.9f}")
            point.set("lon", f"{longitude:.9f}")
            _child(point, GPX, "ele", f"{altitude:.3f}")
            _child(point, GPX, "time", stamp(t_s))
    return root


def _child(parent: Any, space: str, name: str, text: str | None = None) -> Any:
    element = ElementTree.SubElement(parent, f"{{{space}}}{name}")
    element.text = text
    return element
