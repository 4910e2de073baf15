"""When the optical-flow sensor sees the pattern of the pad and can follow it."""

from __future__ import annotations

from flownav.core.compile import equation, larger, magnitude, replacing
from flownav.sensors.flow import FlowParameters, FlowState
from flownav.sensors.geometry import LensPose

SMALLEST_COSINE = 0.1  # keeps a ray finite that grazes the ground

with_engaged = replacing(FlowState, "engaged")


@equation
def _corner_reach(lens: LensPose, right: float, forward: float) -> float:
    """Distance of one image corner's ground point from the pad's centre: the larger of |north| and |east|.

    The corner's ray is (forward, right, 1) in the body.
    """
    rotation = lens.rotation
    north = rotation[0] * forward + rotation[1] * right + rotation[2]
    east = rotation[3] * forward + rotation[4] * right + rotation[5]
    down = rotation[6] * forward + rotation[7] * right + rotation[8]
    length = lens.height_m / larger(down, SMALLEST_COSINE)
    return larger(magnitude(lens.north_m + length * north), magnitude(lens.east_m + length * east))


@equation
def pattern_reach(lens: LensPose, half_fov_tangent: float) -> float:
    """Half the side of the smallest pad (square, its sides north and east) that fills the whole image [m].

    The four corners of the image are projected through the attitude on to level ground, so tilt, heading and footprint
    are exact (finite while tilt < 84 degrees).
    """
    t = half_fov_tangent
    front = larger(_corner_reach(lens, t, t), _corner_reach(lens, -t, t))
    back = larger(_corner_reach(lens, t, -t), _corner_reach(lens, -t, -t))
    return larger(front, back)


@equation
def engagement(
    engaged: float,
    height_m: float,
    tilt_cosine: float,
    reach_m: float,
    pad_half_size_m: float,
    flow_x_rad_s: float,
    flow_y_rad_s: float,
    p: FlowParameters,
) -> float:
    """1 where the sensor can see and follow the pattern, else 0.

    Height between its limits, tilt and flow rate below theirs, and the pattern filling the image. A sensor that
    is engaged stays so up to the limits; one that is not must first be inside them by the fraction `hysteresis`.
    """
    was = engaged > 0.5
    inside = 1.0 if was else 1.0 - p.hysteresis
    lowest_m = p.min_height_m if was else p.min_height_m * (1.0 + p.hysteresis)
    lowest_cosine = p.min_tilt_cosine if was else p.engaging_tilt_cosine
    flow_rad_s = larger(magnitude(flow_x_rad_s), magnitude(flow_y_rad_s))
    in_height = (height_m >= lowest_m) & (height_m <= p.max_height_m * inside)
    in_motion = (tilt_cosine >= lowest_cosine) & (flow_rad_s <= p.max_flow_rad_s * inside)
    in_view = reach_m <= pad_half_size_m * inside
    return 1.0 if in_height & in_motion & in_view else 0.0


@equation
def engage_flow(
    state: FlowState, lens: LensPose, flow_x_rad_s: float, flow_y_rad_s: float, pad_half_size_m: float,
    p: FlowParameters,
) -> FlowState:  # fmt: skip
    """The state with `engaged` judged anew from the lens's true place over the pad, its attitude and the flow."""
    reach_m = pattern_reach(lens, p.half_fov_tangent)
    tilt_cosine = lens.rotation[8]
    engaged = engagement(
        state.engaged, lens.height_m, tilt_cosine, reach_m, pad_half_size_m, flow_x_rad_s, flow_y_rad_s, p
    )
    return with_engaged(state, engaged=engaged)
