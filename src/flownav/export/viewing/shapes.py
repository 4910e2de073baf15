"""The vehicle and its cameras as a record's parameters describe them: outlines in body axes (FRD) [m].

What the record does not say (a replayed log knows nothing of the airframe) is drawn as a small cross of axes and
nothing more: no size is made up.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.record import Record

Array = NDArray[np.float64]
Outline = Array  # (n, 3) points of one line in body FRD [m]

CIRCLE_POINTS = 48
LONGEST_SIDE_M = 20.0  # of a vehicle that is drawn; what a damaged record says beyond is not


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
    said = _mapping(_mapping(record.manifest.get("parameters")).get("vehicle"))
    values = {str(name): number for name, entry in said.items() if (number := _number(entry)) is not None}
    if "frame.arm_m" in values and "propeller.radius_m" in values:
        return _multirotor(values)
    if "main_rotor.radius_m" in values:
        return _helicopter(values)
    return []


def cameras(record: Record) -> list[Camera]:
    """The flow camera and the pad camera with the lens and the angle of view that the record's datasheets state."""
    parameters = _mapping(record.manifest.get("parameters"))
    sheets = _mapping(parameters.get("sensors"))
    found = []
    optics = _mapping(_mapping(parameters.get("flow_sensor")).get("optics"))
    focal, side = _number(optics.get("focal_length_px")), _number(optics.get("image_side_px"))
    if focal and side and focal > 0.0 and side > 0.0:
        half = 0.5 * side / focal
        found.append(Camera("flow_camera", _lens(sheets.get("flow_camera")), (half, half), side))
    pad = _mapping(sheets.get("pad_camera"))
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
    lens = _mapping(_mapping(sheet).get("lens"))
    forward, right, down = (_number(lens.get(name)) or 0.0 for name in ("forward_m", "right_m", "down_m"))
    return forward, right, down


def _mapping(value: Any) -> Mapping[str, Any]:
    """The value where it is a mapping, an empty one elsewhere: manifests come from files."""
    return value if isinstance(value, Mapping) else {}


def _number(value: Any) -> float | None:
    """A finite number, by itself or as {"value": number}; None for anything else."""
    if isinstance(value, Mapping):
        value = value.get("value")
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        return None
    return float(value)
