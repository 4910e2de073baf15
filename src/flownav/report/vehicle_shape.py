"""Outlines of the vehicles that fly in simulation, to scale: SVG about the middle of the skids."""

from typing import Any, NamedTuple

import numpy as np

from flownav.core.record import Record, mapping


class Shape(NamedTuple):
    """A vehicle's measures [m]: rotors as (forward, right, radius), over the skids, the tail's reach and its rotor."""

    rotors: tuple[tuple[float, float, float], ...]
    rotor_high_m: float
    tail_m: float
    tail_rotor_m: float
    tail_high_m: float
    half_length_m: float
    half_track_m: float
    skids_below_m: float

    @property
    def reach_m(self) -> float:
        """The farthest that anything stands out."""
        return max([self.tail_m + self.tail_rotor_m, *(float(np.hypot(x, y)) + r for x, y, r in self.rotors)])

    @property
    def high_m(self) -> float:
        """How high it stands."""
        return self.rotor_high_m + 0.1

    def side(self, scale: float) -> str:
        """Seen from its left, nose to the right; y is down."""
        cg, top, feet = self.skids_below_m, self.rotor_high_m, self.half_length_m
        nose, tail = 1.6 * feet, self.tail_m
        parts = [_path([(-feet, 0), (feet, 0), (1.25 * feet, 0.15 * cg)], scale),
                 _path([(0.5 * feet, 0), (0.4 * feet, 0.6 * cg)], scale),
                 _path([(-0.5 * feet, 0), (-0.4 * feet, 0.6 * cg)], scale)]  # fmt: skip
        body = (0.3 * nose, cg, 0.75 * nose, 0.45 * cg) if tail else (0.0, cg, nose, 0.3 * cg)
        parts.append(f'<ellipse class="solid" cx="{scale * body[0]:.1f}" cy="{-scale * body[1]:.1f}" '
                     f'rx="{scale * body[2]:.1f}" ry="{scale * body[3]:.1f}"/>')  # fmt: skip
        if tail:
            parts.append(_path([(0, 1.1 * cg), (-tail, self.tail_high_m)], scale))
            parts.append(f'<circle cx="{-scale * tail:.1f}" cy="{-scale * self.tail_high_m:.1f}" '
                         f'r="{scale * self.tail_rotor_m:.1f}"/>')  # fmt: skip
        for forward, _, radius in self.rotors:
            parts.append(_path([(forward, cg), (forward, top)], scale))
            parts.append(_path([(forward - radius, top), (forward + radius, top)], scale))
        if not tail:
            along = [forward for forward, _, _ in self.rotors]
            parts.append(_path([(min(along), cg), (max(along), cg)], scale))
        return "".join(parts)

    def above(self, scale: float) -> str:
        """Seen from above, nose up the page."""
        parts = [f'<circle cx="{scale * right:.1f}" cy="{-scale * forward:.1f}" r="{scale * radius:.1f}"/>'
                 for forward, right, radius in self.rotors]  # fmt: skip
        for side in (-self.half_track_m, self.half_track_m):
            parts.append(_path([(side, -self.half_length_m), (side, self.half_length_m)], scale))
        if self.tail_m:
            back, blade = self.tail_m, self.tail_rotor_m
            parts.append(_path([(0, 1.3 * self.half_length_m), (0, -back)], scale))
            parts.append(_path([(0.03, -back - blade), (0.03, -back + blade)], scale))
        else:
            parts += [_path([(0, 0), (right, forward)], scale) for forward, right, _ in self.rotors]
        nose = 1.6 * self.half_length_m
        parts.append(_path([(-0.4 * nose, 0.6 * nose), (0, nose), (0.4 * nose, 0.6 * nose)], scale))
        return "".join(parts)


def shape_of(record: Record) -> Shape:
    """The shape of the vehicle whose numbers the record carries; of an unknown one a quadrotor of half a metre."""
    vehicle = mapping(mapping(record.manifest.get("parameters")).get("vehicle"))

    def size(name: str, otherwise: float) -> float:
        found: Any = vehicle.get(name)
        found = mapping(found).get("value", found)
        return float(found) if isinstance(found, (int, float)) else otherwise

    below = size("skids.cg_above_skid_m", 0.16)
    skids = size("skids.half_length_m", 0.11), size("skids.half_track_m", 0.13), below
    if "main_rotor.radius_m" in vehicle:
        rotor = (0.0, 0.0, size("main_rotor.radius_m", 0.9))
        high = below + size("main_rotor.hub_above_cg_m", 0.25)
        tail = size("tail_rotor.behind_cg_m", 1.0), size("tail_rotor.radius_m", 0.15)
        return Shape((rotor,), high, *tail, below + size("tail_rotor.above_cg_m", 0.08), *skids)
    count, arm = int(size("frame.rotor_count", 4.0)), size("frame.arm_m", 0.225)
    turns = 2.0 * np.pi * (np.arange(count) + 0.5) / count
    radius = size("propeller.radius_m", 0.127)
    rotors = tuple((float(arm * np.cos(turn)), float(arm * np.sin(turn)), radius) for turn in turns)
    return Shape(rotors, below + size("frame.rotors_above_cg_m", 0.03), 0.0, 0.0, 0.0, *skids)


def _path(points: list[tuple[float, float]], scale: float) -> str:
    """A line through points (to the right, up) [m]."""
    return f'<path d="M{"L".join(f"{scale * x:.1f} {-scale * y:.1f}" for x, y in points)}"/>'
