"""Shapes drawn in space: the vehicle and its cameras as outlines in body axes (FRD) [m], the flow as a velocity.

Where the record does not describe the airframe (a replayed log does not), a small cross of axes is drawn and nothing
more: no size is made up. The flow's velocity is flow less the sensor's own turning, times the range.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.frames import velocity_from_flow
from flownav.core.measurement import Array
from flownav.core.record import Record, mapping

Outline = Array  # (n, 3) points of one line in body FRD [m]

CIRCLE_POINTS = 48
LONGEST_SIDE_M = 20.0  # of a vehicle that is drawn; a damaged record's numbers beyond are not
OLDEST_RANGE_S = 0.5  # a range that came longer ago than this is no evidence on the height now


class Camera(NamedTuple):
    """A camera that looks along body down, its image's upper side forward.

    name: of its entity; lens_m: forward, right, down of the body's origin [m]; half_tangents: of the half angles of
    view forward and to the right; width_px: of the image to the right, 0 where the record states none.
    """

    name: str
    lens_m: tuple[float, float, float]
    half_tangents: tuple[float, float]
    width_px: float = 0.0


def vehicle_outline(record: Record) -> list[Outline]:
    """Lines of the vehicle in body FRD: rotor disks, tail boom and skids, or arms and propellers; none if unknown."""
    stated = mapping(mapping(record.manifest.get("parameters")).get("vehicle"))
    values = {str(name): number for name, entry in stated.items() if (number := _number(entry)) is not None}
    if "frame.arm_m" in values and "propeller.radius_m" in values:
        return _multirotor(values)
    if "main_rotor.radius_m" in values:
        return _helicopter(values)
    return []


def cameras(record: Record) -> list[Camera]:
    """The flow camera and the pad camera with the lens and the angle of view that the record's datasheets state."""
    parameters = mapping(record.manifest.get("parameters"))
    sheets = mapping(parameters.get("sensors"))
    found = []
    optics = mapping(mapping(parameters.get("flow_sensor")).get("optics"))
    focal, side = _number(optics.get("focal_length_px")), _number(optics.get("image_side_px"))
    if focal and side and focal > 0.0 and side > 0.0:
        half = 0.5 * side / focal
        found.append(Camera("flow_camera", _lens(sheets.get("flow_camera")), (half, half), side))
    pad = mapping(sheets.get("pad_camera"))
    forward = _number(pad.get("half_view_deg"))
    if forward is not None and 0.0 < forward < 90.0:
        right = _number(pad.get("half_view_right_deg"))
        aside = forward if right is None or not 0.0 < right < 90.0 else right
        tangents = (math.tan(math.radians(forward)), math.tan(math.radians(aside)))
        found.append(Camera("pad_camera", _lens(pad), tangents))
    return found


def _helicopter(values: Mapping[str, float]) -> list[Outline]:
    """Main rotor, tail boom, tail rotor and two skids."""
    hub_up = values.get("main_rotor.hub_above_cg_m", 0.0)
    lines = [_circle((0.0, 0.0, -hub_up), values["main_rotor.radius_m"], "z")]
    behind, up = values.get("tail_rotor.behind_cg_m"), values.get("tail_rotor.above_cg_m", 0.0)
    if behind is not None:
        lines.append(np.array([[0.0, 0.0, 0.0], [-behind, 0.0, -up]]))
        if "tail_rotor.radius_m" in values:
            lines.append(_circle((-behind, 0.0, -up), values["tail_rotor.radius_m"], "y"))
    return _drawable([*lines, np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -hub_up]]), *_skids(values)])


def _multirotor(values: Mapping[str, float]) -> list[Outline]:
    """Arms as an X, the first to the right of the nose, with their propellers."""
    count, arm = round(values.get("frame.rotor_count", 4.0)), values["frame.arm_m"]
    up, lines = values.get("frame.rotors_above_cg_m", 0.0), _skids(values)
    for k in range(min(max(count, 0), 12)):
        angle = (k + 0.5) * 2.0 * math.pi / count
        tip = (arm * math.cos(angle), arm * math.sin(angle), -up)
        lines += [np.array([[0.0, 0.0, 0.0], tip]), _circle(tip, values["propeller.radius_m"], "z")]
    return _drawable(lines)


def _skids(values: Mapping[str, float]) -> list[Outline]:
    names = ("skids.half_length_m", "skids.half_track_m", "skids.cg_above_skid_m")
    if not all(name in values for name in names):
        return []
    half, track, down = (values[name] for name in names)
    lines = [np.array([[-half, side, down], [half, side, down]]) for side in (-track, track)]
    return lines + [np.array([[0.0, 0.0, 0.0], [0.0, side, down]]) for side in (-track, track)]


def _circle(centre: tuple[float, float, float], radius_m: float, across: str) -> Outline:
    """A closed circle about the body axis `across`."""
    angle = np.linspace(0.0, 2.0 * np.pi, CIRCLE_POINTS + 1)
    c, s, o = radius_m * np.cos(angle), radius_m * np.sin(angle), np.zeros_like(angle)
    return np.asarray(np.column_stack([c, s, o] if across == "z" else [c, o, s]) + centre)


def _drawable(lines: list[Outline]) -> list[Outline]:
    """The lines of a vehicle whose size can be; none where one of them cannot."""
    sound = all(np.isfinite(line).all() and np.abs(line).max() <= LONGEST_SIDE_M for line in lines)
    return [line for line in lines if np.ptp(line, axis=0).any()] if sound else []


def _lens(sheet: Any) -> tuple[float, float, float]:
    lens = mapping(mapping(sheet).get("lens"))
    forward, right, down = (_number(lens.get(name)) or 0.0 for name in ("forward_m", "right_m", "down_m"))
    return forward, right, down


def _number(value: Any) -> float | None:
    """A finite number, by itself or as {"value": number}; None for anything else."""
    if isinstance(value, Mapping):
        value = value.get("value")
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        return None
    return float(value)


class FlowArrows(NamedTuple):
    """t_s (n,); velocity_m_s (n, 3) forward, right, down in body axes, NaN where a row has no data."""

    t_s: Array
    velocity_m_s: Array


def flow_arrows(record: Record) -> FlowArrows | None:
    """The velocity by the flow, row by row of `flow_rate` (with its gyro and `range`) or `flow_velocity`.

    Rows of quality 0, without the sensor's gyro, or without a range of the last half second are NaN. None where the
    record holds neither table.
    """
    rate, velocity = record.tables.get("flow_rate"), record.tables.get("flow_velocity")
    if velocity is not None and {"vel_u_m_s", "vel_v_m_s"} <= velocity.keys():
        t_s = np.asarray(velocity["t_s"], float)
        body = np.column_stack([record.matrix("flow_velocity", ("vel_u_m_s", "vel_v_m_s")), np.zeros(len(t_s))])
        body[~_seen(velocity)] = np.nan
        return FlowArrows(t_s, body)
    columns = ("flow_x_rad_s", "flow_y_rad_s", "gyro_x_rad_s", "gyro_y_rad_s")
    if rate is None or not set(columns) <= rate.keys():
        return None
    t_s = np.asarray(rate["t_s"], float)
    flow_x, flow_y, gyro_x, gyro_y = record.matrix("flow_rate", columns).T
    forward, right = velocity_from_flow(flow_x - gyro_x, flow_y - gyro_y, _range_at(record, t_s))
    body = np.column_stack([forward, right, np.zeros(len(t_s))])
    body[~_seen(rate) | np.isnan(body).any(axis=1)] = np.nan
    return FlowArrows(t_s, body)


def _seen(table: dict[str, NDArray[np.generic]]) -> NDArray[np.bool_]:
    """The rows with data: quality above 0, or none stated."""
    return np.asarray(np.asarray(table.get("quality", np.ones(len(table["t_s"]))), float) > 0.0)


def _range_at(record: Record, t_s: Array) -> Array:
    """The last range before each instant [m], NaN where there is none that is fresh."""
    table = record.tables.get("range")
    if table is None or "range_m" not in table or not len(table["t_s"]):
        return np.full(len(t_s), np.nan)
    order = np.argsort(table["t_s"], kind="stable")
    received_s, range_m = np.asarray(table["t_s"], float)[order], np.asarray(table["range_m"], float)[order]
    row = np.searchsorted(received_s, t_s, side="right") - 1
    fresh = (row >= 0) & (t_s - received_s[np.maximum(row, 0)] <= OLDEST_RANGE_S)
    return np.where(fresh, range_m[np.maximum(row, 0)], np.nan)
