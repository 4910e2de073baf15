"""Where a sensor sits, how it looks, and where its beam meets the ground.

Levers are body FRD metres from the centre of gravity. A mounting error is three small angles [rad] about the body's
x, y and z by which the sensor's axes are turned against the body's; first order, good to 2e-4 of the vector at a
degree (Titterton, Weston, Strapdown Inertial Navigation Technology, 2nd ed., section 3.6).

The ground is a plane with a slope, one straight step in it, and a rough surface. Its height over the datum, metres
upwards, north and east from the origin:

    z(n, e) = slope_n n + slope_e e + (step where (n - edge_n) dir_n + (e - edge_e) dir_e > 0)

A deck's edge, a kerb and a box's side are steps; their faces are vertical. Plane geometry, exact. A rough surface adds
three waves of fixed directions and lengths, which no vehicle of a metre's size can tell from grass or gravel; what the
beam's distance has of it is its height where the beam meets the plane.
"""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import equation, larger, smaller
from flownav.core.frames import Rotation, Vector, angular_flow, to_earth


class LensPose(NamedTuple):
    """A lens north and east of the pad's centre and above what it looks at [m], and R_EB of the body it is on."""

    north_m: float
    east_m: float
    height_m: float
    rotation: Rotation


@equation
def lever_velocity(
    rotation: Rotation,
    rate_p_rad_s: float, rate_q_rad_s: float, rate_r_rad_s: float,
    lever_x_m: float, lever_y_m: float, lever_z_m: float,
) -> Vector:  # fmt: skip
    """R_EB (w x l): velocity [m/s, NED] of a point of the body against its centre of gravity."""
    return to_earth(
        rotation,
        rate_q_rad_s * lever_z_m - rate_r_rad_s * lever_y_m,
        rate_r_rad_s * lever_x_m - rate_p_rad_s * lever_z_m,
        rate_p_rad_s * lever_y_m - rate_q_rad_s * lever_x_m,
    )


@equation
def in_turned_axes(x: float, y: float, z: float, about_x: float, about_y: float, about_z: float) -> Vector:
    """A body vector in axes that are turned by small angles: v - theta x v."""
    return (
        x + y * about_z - z * about_y,
        y + z * about_x - x * about_z,
        z + x * about_y - y * about_x,
    )


@equation
def turned_rotation(rotation: Rotation, about_x: float, about_y: float, about_z: float) -> Rotation:
    """R_ES of axes that are turned by small angles in the body: R_EB (I + [theta x])."""
    xx, xy, xz, yx, yy, yz, zx, zy, zz = rotation
    return (
        xx + xy * about_z - xz * about_y, xy + xz * about_x - xx * about_z, xz + xx * about_y - xy * about_x,
        yx + yy * about_z - yz * about_y, yy + yz * about_x - yx * about_z, yz + yx * about_y - yy * about_x,
        zx + zy * about_z - zz * about_y, zy + zz * about_x - zx * about_z, zz + zx * about_y - zy * about_x,
    )  # fmt: skip


SMALLEST_APPROACH = 0.1  # of a beam on a plane, per metre of beam: one that grazes the ground stays finite


class Ground(NamedTuple):
    """Slopes (rise over run), the step's height, a point of its edge, the unit direction in which the step is up.

    rough: amplitude of each wave of the surface [m], waves a metre, and where along them the origin lies [m].
    """

    slope_n: float
    slope_e: float
    step_m: float
    edge_n_m: float
    edge_e_m: float
    direction_n: float
    direction_e: float
    rough_m: float = 0.0
    waves_1_m: float = 1.0
    wave_place_m: float = 0.0


class BeamHit(NamedTuple):
    """Distance along the beam, and the cosine of the angle between the beam and the sloping ground's normal."""

    distance_m: float
    incidence_cosine: float


LEVEL = Ground(0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0)


@equation
def wave(cycles: float) -> float:
    """A wave of amplitude 1 and period 1 made of parabolas: a sine within 0.06."""
    part = cycles - np.floor(cycles)
    first = part < 0.5
    half = part if first else part - 0.5
    height: float = 16.0 * half * (0.5 - half)
    return height if first else -height


@equation
def roughness(pos_n_m: float, pos_e_m: float, ground: Ground) -> float:
    """Height of the rough surface over its plane [m]: waves from three sides, of lengths that do not meet again."""
    n, e = (pos_n_m + ground.wave_place_m) * ground.waves_1_m, (pos_e_m - ground.wave_place_m) * ground.waves_1_m
    return ground.rough_m * (
        wave(n) + wave(0.73 * (0.8660254037844386 * e - 0.5 * n)) + wave(1.41 * (-0.8660254037844386 * e - 0.5 * n))
    )


@equation
def stepped(pos_n_m: float, pos_e_m: float, ground: Ground) -> float:
    """Height that the step adds to the plane at this place [m]."""
    g = ground
    beyond = (pos_n_m - g.edge_n_m) * g.direction_n + (pos_e_m - g.edge_e_m) * g.direction_e
    return g.step_m if beyond > 0.0 else 0.0


@equation
def ground_height(pos_n_m: float, pos_e_m: float, ground: Ground) -> float:
    """Height of the ground over the datum at this place [m]."""
    plane = ground.slope_n * pos_n_m + ground.slope_e * pos_e_m
    return plane + stepped(pos_n_m, pos_e_m, ground) + roughness(pos_n_m, pos_e_m, ground)


@equation
def beam_distance(pos_n_m: float, pos_e_m: float, height_m: float, rotation: Rotation, ground: Ground) -> BeamHit:
    """From a lens at (n, e), `height_m` over the datum, along body z to the ground; attitude R_EB.

    The beam meets the lower plane at t0 and the upper at t1. Each counts where its point lies on its own side of the
    edge, the nearer if both do; if neither does, the beam meets the step's face.
    """
    g = ground
    north, east, down = rotation[2], rotation[5], rotation[8]
    approach = larger(down + (g.slope_n * north + g.slope_e * east), SMALLEST_APPROACH)
    over_plane = height_m - (g.slope_n * pos_n_m + g.slope_e * pos_e_m)
    low, high = over_plane / approach, (over_plane - g.step_m) / approach
    beyond = (pos_n_m - g.edge_n_m) * g.direction_n + (pos_e_m - g.edge_e_m) * g.direction_e
    towards = north * g.direction_n + east * g.direction_e
    on_low, on_high = beyond + towards * low <= 0.0, beyond + towards * high > 0.0
    face = -beyond / (towards if towards * towards > 1e-24 else 1e-12)
    one = low if on_low else high
    hit = smaller(low, high) if on_low & on_high else (one if on_low | on_high else face)
    hit = hit - roughness(pos_n_m + north * hit, pos_e_m + east * hit, g) / approach
    normal = 1.0 / np.sqrt(1.0 + g.slope_n * g.slope_n + g.slope_e * g.slope_e)
    return BeamHit(larger(hit, 0.0), smaller(approach * normal, 1.0))


@equation
def image_rate_rad_s(
    forward_m_s: float, right_m_s: float, rate_p_rad_s: float, rate_q_rad_s: float, height_m: float
) -> tuple[float, float]:
    """How fast the ground straight below passes, towards body forward and right, as tangents a second.

    The ground falls back as the camera goes ahead, and comes forward as the nose goes up.
    """
    flow_x, flow_y = angular_flow(forward_m_s, right_m_s, rate_p_rad_s, rate_q_rad_s, height_m)
    return -flow_y, flow_x
