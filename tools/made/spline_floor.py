"""Generator A, the floor: a height over north and east, with boxes, ledges, a table under the start, and a texture."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from made.flight import Array
from made.spline_flight import Flown, between, into_earth
from made.spline_traits import Traits

TILE_M = 0.33
CLEAR_M = 0.2  # between a box and the vehicle above it, at least


class Floor(NamedTuple):
    """ground_m: its height. boxes (k, 5): north from, to, east from, to [m], height of the top [m]. kind as Traits.

    rich (2, 6): wave numbers [rad/m] and phases of where it is rich in texture.
    """

    ground_m: float
    boxes: Array
    kind: str
    rich: Array

    def height(self, north: Array, east: Array) -> Array:
        """Height of the surface below a place [m]."""
        found = np.full(north.shape, self.ground_m)
        for low_n, high_n, low_e, high_e, top in self.boxes:
            inside = (north > low_n) & (north < high_n) & (east > low_e) & (east < high_e)
            found = np.where(inside, np.maximum(found, top), found)
        return found

    def texture(self, north: Array, east: Array) -> Array:
        """How much there is to see: 1 of good texture, 0 of none."""
        waves = np.cos(np.multiply.outer(north, self.rich[0, :3]) + self.rich[1, :3])
        waves = waves + np.cos(np.multiply.outer(east, self.rich[0, 3:]) + self.rich[1, 3:])
        smooth = 0.75 + 0.08 * waves.sum(axis=-1)
        if self.kind == "carpet":
            return np.clip(smooth + 0.25, 0.0, 1.0)
        if self.kind == "tiles":
            joint = np.minimum(np.abs(north / TILE_M - np.round(north / TILE_M)),
                               np.abs(east / TILE_M - np.round(east / TILE_M))) * TILE_M  # fmt: skip
            return np.clip(0.15 + 0.2 * smooth + 0.8 * np.exp(-((joint / 0.03) ** 2)), 0.0, 1.0)
        return np.clip(smooth, 0.0, 1.0)


def floor_of(traits: Traits, flown: Flown, random: np.random.Generator) -> Floor:
    """The floor of a flight: boxes below its path, where it flies high enough over them."""
    position, boxes = flown.truth.pos_ned_m[::20], []
    if traits.table:
        north, east = flown.table_half_m
        boxes.append([-north, north, -east, east, 0.0])
    wanted = round(between(random, traits.boxes))
    for _ in range(12 * wanted):
        if len(boxes) >= wanted + traits.table:
            break
        middle = position[random.integers(len(position)), :2] + random.normal(0.0, 0.25, 2)
        half = random.uniform(0.12, 0.55, 2)
        if random.random() < 0.15:  # a ledge: half of the room is higher
            middle[0], half[0] = middle[0] + np.sign(random.normal()) * 3.0, 3.0
            half[1] = 9.0
        top = flown.ground_m + between(random, (0.08, 0.45))
        over = (np.abs(position[:, :2] - middle) < half + 0.1).all(axis=1)
        if over.any() and (-position[over, 2] - top).min() > CLEAR_M:
            boxes.append([middle[0] - half[0], middle[0] + half[0], middle[1] - half[1], middle[1] + half[1], top])
    rich = np.stack([random.uniform(0.5, 6.0, 6), random.uniform(0.0, 2.0 * np.pi, 6)])
    return Floor(flown.ground_m, np.array(boxes).reshape(-1, 5), traits.floor, rich)


def depths(
    floor: Floor, position: Array, quaternion: Array, lens_m: float, ray_frd: Array
) -> tuple[Array, Array, Array]:
    """How far along a ray from the lens the floor is [m] (n,), and north and east of where it is met.

    ray_frd (3,) or (n, 3): a direction. The lens stands lens_m above the IMU's foot, which is at `position`.
    """
    ray = into_earth(quaternion, np.broadcast_to(ray_frd, (len(position), 3)))
    sinking = np.maximum(ray[:, 2], 0.2)
    eye = lens_m - position[:, 2]
    north, east = position[:, 0], position[:, 1]
    along = (eye - floor.height(north, east)) / sinking
    for _ in range(2):  # where the ray meets the height that is found there
        below = floor.height(north + along * ray[:, 0], east + along * ray[:, 1])
        along = np.maximum(eye - below, 0.3 * lens_m) / sinking
    return along, north + along * ray[:, 0], east + along * ray[:, 1]
