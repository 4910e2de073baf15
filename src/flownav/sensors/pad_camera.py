"""A camera that finds the pad, with what goes wrong: bias, noise, missed and false fixes, a wrong stated accuracy.

The fix is `read_pad`'s (tangents towards body forward and right, distance; MAVLink LANDING_TARGET) of a camera
whose axes are turned against the body by small angles that are drawn once a flight, and whose focal length is believed
too long by a share that is drawn once a flight: tangents are smaller by that share and distances larger. What this
camera sees is reported as if it were right.

**Reach.** A level mark of side s looks s h/d^2 wide at least, h the height and d the distance: as from the height
r = d^2/h straight above it. Where the mark has a larger one round it, `ratio` times as large, that one serves while it
is whole in view and the inner is not, or is too far: as the inner one would at a reach of r/ratio.

**Noise**, of angles and of the distance as a part of it, sigma^2 = floor^2 + (per_m r)^2 + (per_rad_s w)^2: w the rate
at which the ground straight below passes (rows are exposed one after the other, and a frame has one time).

**Missed.** What lies on the pad or shines hides it in a share of the frames, whatever the vehicle does. Otherwise the
detector finds the pad with a probability that falls with its reach and with how fast the image moves, a probit: it
misses where a standard normal exceeds level - a r/r_max - b w/w_blur; the datasheet gives the three shares missed (low
and slow; at the greatest height; at the image rate `blur_rad_s`) that fix level, a and b.

**False.** With a share of the frames something else is taken for the pad, anywhere in the view, at about the true
distance; also where the pad is out of view, while the height is within the limits.

**Stated.** Variances of the tangents at the reported place, sigma^2 L^2 (1 + tan^2) with L^2 = 1 + both squares (noise
across the sight, projected on the image plane), and of the distance, by noise, boresight and scale of the *datasheet*,
which the camera's own may exceed, times a factor that is wrong by a share.

**A fix** is the place of the pad's centre from the lens, as a downward camera and a target give it. It is what MAVLink
LANDING_TARGET carries: tangents of the angles towards body forward and right, and the distance. The line of sight has
white noise across it, the same both ways, and the distance a share of itself; readings are offered while the lens is
between two heights and the pad's mark, whose sides lie north and east, is whole within a view that is so wide forward
and so wide to the right.
"""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import clamp, equation, larger, magnitude
from flownav.core.frames import Rotation, to_body
from flownav.sensors.geometry import LensPose, turned_rotation
from flownav.sensors.processes import factor

SMALLEST_DEPTH_M = 0.01


class PadFixParameters(NamedTuple):
    """Noise and limits; `fitted` 0: the vehicle has no such sensor."""

    fitted: float
    angle_sigma_rad: float
    distance_sigma: float  # of the distance
    min_height_m: float
    max_height_m: float
    half_view_forward_tangent: float
    half_view_right_tangent: float
    side_m: float  # of the mark that must be whole in view; 0: its centre suffices


class PadFixNormals(NamedTuple):
    """Standard normals of one reading (four: pairs are drawn)."""

    forward: float
    right: float
    distance: float
    spare: float


class PadFixReading(NamedTuple):
    """Tangents towards body forward and right, distance [m], and 1 where there is a fix."""

    tan_forward: float
    tan_right: float
    distance_m: float
    valid: float


@equation
def read_pad(
    lens_n_m: float, lens_e_m: float, lens_d_m: float, rotation: Rotation, n: PadFixNormals, p: PadFixParameters
) -> PadFixReading:
    """The fix of a lens at (n, e, d) from the pad's centre, with attitude R_EB."""
    ahead, right, below = to_body(rotation, -lens_n_m, -lens_e_m, -lens_d_m)
    depth = larger(below, SMALLEST_DEPTH_M)
    forward, sideways = ahead / depth, right / depth
    distance = np.sqrt(ahead * ahead + right * right + depth * depth)
    in_height = (-lens_d_m >= p.min_height_m) & (-lens_d_m <= p.max_height_m)
    reach = 0.5 * p.side_m * (magnitude(rotation[0]) + magnitude(rotation[3])) / depth  # of the turned square
    in_view = magnitude(forward) + reach <= p.half_view_forward_tangent
    in_view = in_view & (magnitude(sideways) + reach <= p.half_view_right_tangent)
    seen = in_height & in_view & (p.fitted > 0.5)
    # noise across the sight: unit vectors (1, 0, -forward) and sight x that, of their lengths
    length, level = np.sqrt(forward * forward + sideways * sideways + 1.0), np.sqrt(1.0 + forward * forward)
    one, two = p.angle_sigma_rad * length / level * n.forward, p.angle_sigma_rad / level * n.right
    noisy_ahead = forward + one - forward * sideways * two
    noisy_side = sideways + level * level * two
    noisy_depth = 1.0 - forward * one - sideways * two
    return PadFixReading(
        noisy_ahead / noisy_depth,
        noisy_side / noisy_depth,
        distance * (1.0 + p.distance_sigma * n.distance),
        1.0 if seen else 0.0,
    )


class PadCameraParameters(NamedTuple):
    """Noise, limits and chances of one frame."""

    angle_floor_rad: float
    angle_per_m: float
    angle_per_rad_s: float
    distance_floor: float  # of the distance
    distance_per_m: float
    distance_per_rad_s: float
    min_height_m: float
    max_height_m: float
    half_view_forward_tangent: float
    half_view_right_tangent: float
    side_m: float  # of the mark
    ratio: float  # of the larger mark round it, 1: there is none
    boresight_rad: float  # standard deviation of each angle
    scale: float  # standard deviation of the focal length's share
    stated_spread: float
    missed_above: float  # low and slow
    missed_by_height: float  # taken off the level at the greatest height
    missed_per_rad_s: float  # taken off per rad/s of image rate
    hidden_above: float
    false_above: float


class PadCameraUnit(NamedTuple):
    """This flight: the camera's small angles [rad], factor of the stated deviations, how much too long the focal length
    is believed to be, as a part of it. As normals: one for each.
    """

    turned_x: float
    turned_y: float
    turned_z: float
    stated: float
    longer: float
    spare: float


class PadCameraNormals(NamedTuple):
    """Standard normals of one frame."""

    forward: float
    right: float
    distance: float
    missed: float
    false: float
    false_forward: float
    false_right: float
    hidden: float


class PadCameraReading(NamedTuple):
    """Tangents, distance, stated variances of each, quality 255 or 0, and 1 where there is a fix, true or false."""

    tan_forward: float
    tan_right: float
    distance_m: float
    forward_variance: float
    right_variance: float
    distance_variance_m2: float
    quality: float
    arrived: float


@equation
def draw_pad_camera(n: PadCameraUnit, p: PadCameraParameters) -> PadCameraUnit:
    """This flight's camera."""
    return PadCameraUnit(
        p.boresight_rad * n.turned_x,
        p.boresight_rad * n.turned_y,
        p.boresight_rad * n.turned_z,
        factor(p.stated_spread, n.stated),
        p.scale * n.longer,
        0.0,
    )


@equation
def noise_of(floor: float, per_m: float, per_rad_s: float, reach_m: float, image_rate_rad_s: float) -> float:
    """Standard deviation at a reach and an image rate."""
    by_reach, by_rate = per_m * reach_m, per_rad_s * image_rate_rad_s
    sigma: float = np.sqrt(floor * floor + by_reach * by_reach + by_rate * by_rate)
    return sigma


@equation
def angle_noise(p: PadCameraParameters, reach_m: float, image_rate_rad_s: float) -> float:
    """Standard deviation of each angle [rad]."""
    return noise_of(p.angle_floor_rad, p.angle_per_m, p.angle_per_rad_s, reach_m, image_rate_rad_s)


@equation
def distance_noise(p: PadCameraParameters, reach_m: float, image_rate_rad_s: float) -> float:
    """Standard deviation of the distance, as a part of it."""
    return noise_of(p.distance_floor, p.distance_per_m, p.distance_per_rad_s, reach_m, image_rate_rad_s)


@equation
def reach_of(north_m: float, east_m: float, height_m: float) -> float:
    """From how high straight above it the mark would look as small as it does from here (north, east of it)."""
    above = larger(height_m, SMALLEST_DEPTH_M)
    return (north_m * north_m + east_m * east_m + above * above) / above


@equation
def inner_serves(lens: LensPose, reach_m: float, p: PadCameraParameters) -> bool:
    """Whether the mark itself is whole in view and near enough, else the larger one round it has to serve."""
    seen = read_pad(
        lens.north_m, lens.east_m, -lens.height_m, lens.rotation, PadFixNormals(0.0, 0.0, 0.0, 0.0),
        PadFixParameters(
            1.0, 0.0, 0.0, p.min_height_m, p.max_height_m, p.half_view_forward_tangent, p.half_view_right_tangent,
            p.side_m,
        ),
    )  # fmt: skip
    return (seen.valid > 0.5) & (reach_m <= p.max_height_m)


@equation
def read_pad_camera(
    unit: PadCameraUnit, lens: LensPose, image_rate_rad_s: float, n: PadCameraNormals, p: PadCameraParameters,
    datasheet: PadCameraParameters,
) -> PadCameraReading:  # fmt: skip
    """One frame of a lens, its height that above the pad; image_rate_rad_s: of the ground below.

    p: the camera as it is; datasheet: as its datasheet has it.
    """
    north_m, east_m, height_m, rotation = lens
    reach_m = reach_of(north_m, east_m, height_m)
    turned = turned_rotation(rotation, unit.turned_x, unit.turned_y, unit.turned_z)
    inner_sees = inner_serves(LensPose(north_m, east_m, height_m, turned), reach_m, p)
    size = 1.0 if inner_sees else p.ratio
    shown_m = reach_m / size
    distance_sigma = distance_noise(p, shown_m, image_rate_rad_s)
    fix = read_pad(
        north_m, east_m, -height_m, turned, PadFixNormals(n.forward, n.right, n.distance, 0.0),
        PadFixParameters(
            1.0, angle_noise(p, shown_m, image_rate_rad_s), distance_sigma, p.min_height_m * size,
            p.max_height_m * size, p.half_view_forward_tangent, p.half_view_right_tangent, p.side_m * size,
        ),
    )  # fmt: skip
    level = p.missed_above - p.missed_by_height * (shown_m / p.max_height_m) - p.missed_per_rad_s * image_rate_rad_s
    found = (fix.valid > 0.5) & (shown_m <= p.max_height_m) & (n.missed <= level) & (n.hidden <= p.hidden_above)
    in_height = (height_m >= p.min_height_m) & (height_m <= p.max_height_m * p.ratio)
    false = in_height & (n.false > p.false_above)
    ahead, aside = p.half_view_forward_tangent, p.half_view_right_tangent
    wrong_forward = clamp(0.5 * ahead * n.false_forward, -ahead, ahead)
    wrong_right = clamp(0.5 * aside * n.false_right, -aside, aside)
    wrong_sight = np.sqrt(1.0 + wrong_forward * wrong_forward + wrong_right * wrong_right)
    wrong_m = larger(height_m, 0.0) * wrong_sight * (1.0 + distance_sigma * n.distance)
    shrunk = 1.0 - unit.longer
    forward = wrong_forward if false else shrunk * fix.tan_forward
    right = wrong_right if false else shrunk * fix.tan_right
    distance_m = wrong_m if false else (1.0 + unit.longer) * fix.distance_m
    there = 1.0 if false | found else 0.0
    return stated_fix(unit, forward, right, distance_m, there, shown_m, image_rate_rad_s, datasheet)


@equation
def stated_fix(
    unit: PadCameraUnit,
    forward: float,
    right: float,
    distance_m: float,
    there: float,
    shown_m: float,
    image_rate_rad_s: float,
    datasheet: PadCameraParameters,
) -> PadCameraReading:
    """A fix (there: 1 where there is one) with the accuracy that the camera states of it; shown_m: the mark's reach."""
    noise, far = (
        angle_noise(datasheet, shown_m, image_rate_rad_s),
        distance_noise(datasheet, shown_m, image_rate_rad_s),
    )
    across = unit.stated * np.sqrt(noise * noise + datasheet.boresight_rad * datasheet.boresight_rad)
    along = unit.stated * np.sqrt(far * far + datasheet.scale * datasheet.scale) * distance_m
    spread = across * across * (1.0 + forward * forward + right * right)
    return PadCameraReading(
        forward,
        right,
        distance_m,
        spread * (1.0 + forward * forward),
        spread * (1.0 + right * right),
        along * along,
        255.0 * there,
        there,
    )
