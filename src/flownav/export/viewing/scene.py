"""The flight in space, in Rerun's words. Needs the package rerun-sdk.

Frames: `/enu` (east, north, up: right-handed, z up, the axes of Rerun's view) > `/enu/ned` > everything else, so that
every position stands in the file as the record has it, in NED metres, and body axes are forward-right-down.
"""

from typing import Any

import numpy as np
import rerun as rr

from flownav.core.measurement import Array
from flownav.core.record import POSITION_NED, Record
from flownav.export.trajectory import ENU_FROM_NED, SIGMAS, Trajectory
from flownav.export.viewing.shapes import Camera, cameras, flow_arrows, vehicle_outline

TIMELINE = "t_s"
EARTH, NED = "/enu", "/enu/ned"
COLOURS = {"estimate": (10, 95, 180), "smoothed": (154, 47, 107), "truth": (60, 66, 74), "autopilot": (131, 57, 168),
           "gps": (191, 91, 11), "flow": (14, 122, 95), "pad": (125, 136, 148)}  # fmt: skip
MOST_SEGMENTS = 5000  # of a path that is drawn; the poses are all there
AXIS_M, CAMERA_PLANE_M = 0.25, 0.4
# an image's right, down and depth in body FRD, as columns
DOWN_LOOKING = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
STEPS_PX = 1000.0  # side of an image whose pixels the record does not state


def times(t_s: Array) -> Any:
    """The one time line of a recording [s of the record's clock]."""
    return rr.TimeColumn(TIMELINE, duration=np.asarray(t_s, float))


def log_scene(stream: Any, record: Record, paths: list[Trajectory]) -> None:
    """Everything in space: frames, pad, paths, vehicle, cameras, flow, standard deviations and GPS readings."""
    stream.log(EARTH, rr.ViewCoordinates.RFU, static=True)
    w, x, y, z = map(float, ENU_FROM_NED)
    stream.log(NED, rr.Transform3D(quaternion=rr.Quaternion(xyzw=(x, y, z, w))), static=True)
    _log_pad(stream, record)
    for path in paths:
        _log_path(stream, path)
    vehicle = carrier(paths)
    _log_vehicle(stream, record, vehicle)
    for camera in cameras(record):
        _log_camera(stream, f"{NED}/{vehicle.name}/{camera.name}", camera)
    _log_flow(stream, record, vehicle)
    _log_spread(stream, record, paths)
    _log_gps(stream, record)


def carrier(paths: list[Trajectory]) -> Trajectory:
    """The path on which the vehicle is drawn with its cameras: the truth where it has an attitude, else the first."""
    return next((path for path in paths if path.name == "truth" and path.oriented), paths[0])


def _log_pad(stream: Any, record: Record) -> None:
    """The pad: a square about the origin of NED."""
    size_m = record.manifest.get("pad_size_m")
    if isinstance(size_m, bool) or not isinstance(size_m, (int, float)) or not 0.0 < size_m < 1000.0:
        return
    half = 0.5 * float(size_m)
    corners = [(-half, -half, 0.0), (-half, half, 0.0), (half, half, 0.0), (half, -half, 0.0)]
    square = rr.Mesh3D(
        vertex_positions=corners, triangle_indices=[(0, 1, 2), (0, 2, 3)], albedo_factor=(*COLOURS["pad"], 120)
    )
    stream.log(f"{NED}/pad", square, rr.LineStrips3D([[*corners, corners[0]]], colors=[COLOURS["pad"]]), static=True)


def _log_path(stream: Any, path: Trajectory) -> None:
    """A path's poses, axes at the moving body, and its line, which grows with the time."""
    colour = COLOURS[path.name]
    quaternion_xyzw = path.quaternion[:, [1, 2, 3, 0]]
    pose = rr.Transform3D.columns(translation=path.position_m, quaternion=quaternion_xyzw)
    stream.send_columns(f"{NED}/{path.name}", indexes=[times(path.t_s)], columns=pose)
    axes = rr.Arrows3D(vectors=AXIS_M * np.eye(3), colors=[(200, 40, 40), (40, 150, 60), colour])
    stream.log(f"{NED}/{path.name}/axes", axes, static=True)
    rows = np.unique(np.linspace(0, len(path.t_s) - 1, min(len(path.t_s), MOST_SEGMENTS + 1)).astype(int))
    where = path.position_m[rows]
    if len(rows) > 1:
        segments = np.stack([where[:-1], where[1:]], axis=1)
        line = rr.LineStrips3D.columns(strips=list(segments), colors=[colour] * len(segments))
        stream.send_columns(f"{NED}/path/{path.name}", indexes=[times(path.t_s[rows[1:]])], columns=line)


def _log_vehicle(stream: Any, record: Record, path: Trajectory) -> None:
    outline = vehicle_outline(record)
    if outline:
        stream.log(f"{NED}/{path.name}/vehicle", rr.LineStrips3D(outline, colors=[COLOURS[path.name]]), static=True)


def _log_camera(stream: Any, entity: str, camera: Camera) -> None:
    """A frustum below its lens: a pinhole camera whose optical axis is body down."""
    forward, right = camera.half_tangents
    width = camera.width_px or STEPS_PX
    focal = 0.5 * width / right
    pinhole = rr.Pinhole(
        focal_length=focal, width=width, height=2.0 * focal * forward, camera_xyz=rr.ViewCoordinates.RDF,
        image_plane_distance=CAMERA_PLANE_M,
    )  # fmt: skip
    stream.log(entity, rr.Transform3D(translation=camera.lens_m, mat3x3=DOWN_LOOKING), pinhole, static=True)


def _log_flow(stream: Any, record: Record, path: Trajectory) -> None:
    """The velocity by the flow, as an arrow from the vehicle: a metre for a metre per second."""
    arrows = flow_arrows(record)
    if arrows is None:
        return
    seen = np.isfinite(arrows.velocity_m_s).all(axis=1) & np.isfinite(arrows.t_s)
    kept = np.isfinite(arrows.t_s) & (seen | np.append(False, seen[:-1]))  # a row without data takes the arrow away
    if not seen.any():
        return
    columns = rr.Arrows3D.columns(vectors=arrows.velocity_m_s[seen], colors=[COLOURS["flow"]] * int(seen.sum()))
    entity, counts = f"{NED}/{path.name}/flow", seen[kept].astype(int)
    parts = [column.partition(counts) for column in columns]
    stream.send_columns(entity, indexes=[times(arrows.t_s[kept])], columns=parts)


def _log_spread(stream: Any, record: Record, paths: list[Trajectory]) -> None:
    """Three standard deviations along north, east and down about the estimate; a record keeps no correlations."""
    columns = tuple(f"std_{name}" for name in POSITION_NED)
    path = next((path for path in paths if path.name == "estimate"), None)
    if path is None or not set(columns) <= record.tables["estimate"].keys():
        return
    spread = record.matrix("estimate", columns)[path.row]
    known = np.isfinite(spread).all(axis=1) & (spread > 0.0).all(axis=1)
    if not known.any():
        return
    count = int(known.sum())
    ellipsoids = rr.Ellipsoids3D.columns(
        half_sizes=SIGMAS * spread[known], centers=path.position_m[known], colors=[COLOURS["estimate"]] * count,
        fill_mode=[rr.components.FillMode.MajorWireframe] * count,
    )  # fmt: skip
    stream.send_columns(f"{NED}/estimate_3_sigma", indexes=[times(path.t_s[known])], columns=ellipsoids)


def _log_gps(stream: Any, record: Record) -> None:
    """The receiver's positions, each at its time."""
    table = record.tables.get("gps_position", {})
    if not {"t_s", *POSITION_NED} <= table.keys():
        return
    position, t_s = record.matrix("gps_position", POSITION_NED), np.asarray(table["t_s"], float)
    good = np.isfinite(position).all(axis=1) & np.isfinite(t_s)
    if good.any():
        count = int(good.sum())
        points = rr.Points3D.columns(positions=position[good], colors=[COLOURS["gps"]] * count, radii=[0.03] * count)
        stream.send_columns(f"{NED}/gps", indexes=[times(t_s[good])], columns=points)
