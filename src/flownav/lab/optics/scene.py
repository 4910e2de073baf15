"""Light on the pad and things that lie on it: shadows, covers, glare, each a function of a place on the ground.

The ground is the plane of `projection`; brightness is in units of the light that falls on it, as reflectance is.
"""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import clamp, equation, exp
from flownav.core.measurement import Array
from flownav.lab.optics.projection import Pose

SUN_RAD = 0.0093  # the sun's diameter
VEHICLE_M = (0.12, 1.2)  # width and length of what throws the vehicle's shadow: fuselage and boom
VEHICLE_DEPTH = 0.75
FIXED_SHARE = 0.15  # of sunny flights: something that stands beyond the pad throws a shadow on it or near it
AROUND_M = 3.0  # the middle of such a shadow is within so much of the target, north and east
COVER_SHARE = 0.1  # of flights: something lies on the pad or beside it
FAR_M = 100.0
SHADOW, COVER = 8, 4  # columns of the arrays of shadows and covers


class Shadow(NamedTuple):
    """A straight band without sun: its middle, its direction, half its width and half its length.

    penumbra_m: over which its edge goes from light to dark, the sun's diameter times the way from what throws it;
    depth: the share of the light that is missing within (the sky's stays).
    """

    x_m: float
    y_m: float
    along_x: float
    along_y: float
    half_width_m: float
    half_length_m: float
    penumbra_m: float
    depth: float


class Cover(NamedTuple):
    """Something round and flat that lies on the ground: a leaf, a lump of mud."""

    x_m: float
    y_m: float
    radius_m: float
    reflectance: float


class Gloss(NamedTuple):
    """How the pad mirrors the sun: the direction towards it (earth, z down), the width of its image there [rad], and
    how bright that is in the middle; veil: light that the lens scatters over the whole frame.
    """

    sun_x: float
    sun_y: float
    sun_z: float
    width_rad: float
    strength: float
    veil: float


def penumbra_m(way_m: float) -> float:
    """How wide the edge of a shadow is that is thrown from so far away."""
    return SUN_RAD * way_m


@equation
def lit(s: Shadow, x_m: float, y_m: float) -> float:
    """The share of the light that a place gets: 1 in the sun, 1 - depth in the shadow."""
    off = (x_m - s.x_m) * s.along_y - (y_m - s.y_m) * s.along_x
    way = (x_m - s.x_m) * s.along_x + (y_m - s.y_m) * s.along_y
    inside = clamp((s.half_width_m - np.abs(off)) / s.penumbra_m + 0.5, 0.0, 1.0)
    inside *= clamp((s.half_length_m - np.abs(way)) / s.penumbra_m + 0.5, 0.0, 1.0)
    return 1.0 - s.depth * inside


@equation
def covered(c: Cover, x_m: float, y_m: float) -> bool:
    """Whether the thing lies there."""
    x, y = x_m - c.x_m, y_m - c.y_m
    return x * x + y * y < c.radius_m * c.radius_m


@equation
def mirrored(g: Gloss, x: float, y: float, z: float) -> float:
    """Brightness of the sun's image in a level pad, seen along the ray (x, y, z) of any length, earth axes.

    Full where the ray, thrown back by the ground, points at the sun; a Gaussian of the angle from there.
    """
    size = np.sqrt(x * x + y * y + z * z)
    cosine = clamp((x * g.sun_x + y * g.sun_y - z * g.sun_z) / size, -1.0, 1.0)
    angle_squared = 2.0 * (1.0 - cosine)
    level: float = g.strength * exp(-0.5 * angle_squared / (g.width_rad * g.width_rad))
    return level


class Scene(NamedTuple):
    """One flight's light and what lies about: shadows (n, 8), covers (m, 4), gloss."""

    shadows: Array
    covers: Array
    gloss: Gloss


def shadow_of_vehicle(pose: Pose, gloss: Gloss) -> Shadow:
    """Shadow of the vehicle that carries the camera: as far from below it as the sun stands low, along its body.

    Its body and boom are a band of VEHICLE_M about the camera; gloss shows where the sun is.
    """
    away = pose.height_m / -gloss.sun_z
    ahead = np.hypot(pose.r11, pose.r21)
    width_m, length_m = VEHICLE_M
    return Shadow(
        pose.x_m - away * gloss.sun_x, pose.y_m - away * gloss.sun_y, float(pose.r11 / ahead), float(pose.r21 / ahead),
        0.5 * width_m, 0.5 * length_m, penumbra_m(away), VEHICLE_DEPTH,
    )  # fmt: skip


def in_shadow_of_vehicle(scene: Scene, pose: Pose) -> Scene:
    """The scene with the vehicle's own shadow, where the sun shines."""
    if scene.gloss.strength == 0.0:
        return scene
    return scene._replace(shadows=np.vstack([scene.shadows, shadow_of_vehicle(pose, scene.gloss)]))


def clear(veil: float = 0.0) -> Scene:
    """No sun, no shadow, nothing on the pad."""
    return Scene(np.zeros((0, SHADOW)), np.zeros((0, COVER)), Gloss(0.0, 0.0, -1.0, 1.0, 0.0, veil))


def drawn_scene(rng: np.random.Generator, side_m: float, sunny: bool) -> Scene:
    """The scene of one flight over a target of this side.

    In the sun: a shadow or none of something 3 to 30 m away and 0.3 to 10 m wide (a tree, a wall), 50 to 85 % deep, and
    the pad's gloss, printed matt or laminated. Nothing on the pad in nine flights of ten, else one to three covers of a
    twentieth to an eighth of its side across somewhere near it.
    """
    shadows = []
    if sunny and rng.uniform() < FIXED_SHARE:
        way = rng.uniform(-np.pi, np.pi)
        width_m, from_m = np.exp(rng.uniform(np.log(0.3), np.log(10.0))), np.exp(rng.uniform(np.log(3.0), np.log(30.0)))
        place = rng.uniform(-1.0, 1.0, 2) * AROUND_M
        depth, edge_m = rng.uniform(0.5, 0.85), penumbra_m(from_m)
        shadows.append(Shadow(place[0], place[1], np.cos(way), np.sin(way), 0.5 * width_m, FAR_M, edge_m, depth))
    covers = []
    if rng.uniform() < COVER_SHARE:
        for _ in range(rng.integers(1, 4)):
            x_m, y_m = rng.uniform(-0.7, 0.7, 2) * side_m
            covers.append(Cover(x_m, y_m, side_m * rng.uniform(1.0 / 40.0, 1.0 / 16.0), rng.uniform(0.05, 0.5)))
    laminated = rng.uniform() < 0.3
    high, way = np.radians(rng.uniform(15.0, 75.0)), rng.uniform(-np.pi, np.pi)
    sun = np.cos(high) * np.cos(way), np.cos(high) * np.sin(way), -np.sin(high)
    width_rad, strength = (np.radians(4.0), 4.0) if laminated else (np.radians(15.0), 0.25)
    gloss = Gloss(*sun, width_rad, strength if sunny else 0.0, rng.uniform(0.01, 0.06))
    return Scene(np.array(shadows).reshape(-1, SHADOW), np.array(covers).reshape(-1, COVER), gloss)
