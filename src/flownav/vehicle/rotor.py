"""Block 2, flapping and thrust: blade elements and momentum inflow of the main and the tail rotor, and ground effect.

A rotor sees its air through two numbers: `axial`, its velocity through the air against the direction of its
thrust (main rotor: w_a, positive in descent; tail rotor: sideways velocity to the right), and the square of its
`inplane` velocity. Velocities are in m/s throughout; the reference's λ0 = v_i/ΩR, μ = V_inplane/ΩR, μ_z = axial/ΩR.

Uniform inflow, no stall but a limit on thrust, no vortex ring: valid while descending slower than about half the
induced velocity. The main rotor's inflow takes time (`drive`); here is where it goes.

Ground effect is that on the main rotor's thrust (paper equation 11, read as Cheeseman and Bennett printed it).
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from flownav.core.compile import clamp, equation, larger, magnitude, smaller, write_function
from flownav.vehicle.parameters import VehicleParameters

HYPOTENUSE = 2.0 * (2.0**0.5 - 1.0)  # (a² + b² + this·a·b)/(a + b) is √(a² + b²), within 1 %
STILL_AIR_SQ = 1e-12  # [m2/s2] keeps a rotor in dead air from dividing by zero
SMALLEST_SLOPE_SQ = 1e-30
SLOWEST = 0.05  # of the governed speed


class Rotor(NamedTuple):
    """A rotor's constants, derived in `parameters` (see VehicleParameters)."""

    speed_rad_s: float
    tip_speed_m_s: float
    inflow_speed_m_s: float
    thrust_slope_n_s_m: float
    thrust_limit_n: float
    profile_torque_n_m: float


@equation
def speed_ratio(speed_rad_s: float, vehicle: VehicleParameters) -> float:
    """The main rotor's speed over what its governor keeps; a rotor that all but stands has a twentieth."""
    return larger(speed_rad_s * vehicle.per_main_speed_s_rad, SLOWEST)


def rotor_of(name: str) -> Callable[[VehicleParameters, float], Rotor]:
    """An equation: a rotor of a vehicle at a ratio of the main rotor's governed speed, of the parameters so called."""
    speeds, squares = Rotor._fields[:4], Rotor._fields[4:]
    scaled = [f"vehicle.{name}_{field} * ratio" for field in speeds]
    scaled += [f"vehicle.{name}_{field} * (ratio * ratio)" for field in squares]
    text = f"def rotor(vehicle, ratio):\n    return Rotor({', '.join(scaled)})\n"
    return equation(write_function("rotor", text, {"Rotor": Rotor}))


main_rotor, tail_rotor = rotor_of("main"), rotor_of("tail")


@equation
def thrustless_inflow(pitch: float, inplane_sq: float, axial: float, rotor: Rotor) -> float:
    """The induced velocity at which the blades would carry nothing [m/s]: ΩR·θ0·(2/3 + μ²) + axial.

    Equation 2.1 of the reference reads T = thrust_slope·(thrustless_inflow - v_i).
    """
    return pitch * (2.0 / 3.0 * rotor.tip_speed_m_s + inplane_sq * (1.0 / rotor.tip_speed_m_s)) + axial


@equation
def axial_flow_through(thrustless: float, axial: float, rotor: Rotor) -> float:
    """|v_i - axial| without in-plane flow [m/s], exactly: v·|v - axial| = c·(thrustless - v) is a quadratic in it."""
    c = rotor.inflow_speed_m_s
    lift = thrustless - axial
    half = 0.5 * (c + axial if lift.real >= 0.0 else c - axial)
    root: float = np.sqrt(half * half + c * magnitude(lift))
    return root - half


@equation
def refine_induced_velocity(induced: float, thrustless: float, inplane_sq: float, axial: float, rotor: Rotor) -> float:
    """One Halley step on the squared balance f(v) = v²·D² - c²·(thrustless - v)², D² = V_inplane² + (v - axial)².

    Squared, equation 2.2 is a polynomial: the step takes one division and no root.
    """
    c_sq = rotor.inflow_speed_m_s * rotor.inflow_speed_m_s
    through, thrust_part = induced - axial, thrustless - induced
    induced_sq = induced * induced
    resultant_sq = inplane_sq + through * through
    balance = induced_sq * resultant_sq - c_sq * (thrust_part * thrust_part)
    half_slope = induced * resultant_sq + induced_sq * through + c_sq * thrust_part
    quarter_curvature = 0.5 * (resultant_sq + induced_sq - c_sq) + 2.0 * induced * through
    slope_sq = half_slope * half_slope
    # f'²/2 - f·f''/4; the floor binds far outside the model's validity only, and keeps every step finite
    denominator = larger(2.0 * slope_sq - balance * quarter_curvature, slope_sq + SMALLEST_SLOPE_SQ)
    return induced - balance * half_slope / denominator


@equation
def induced_velocity(pitch: float, inplane_sq: float, axial: float, rotor: Rotor) -> float:
    """Induced velocity v_i [m/s] at which momentum theory and blade elements agree on the thrust.

    Equations 2.1 and 2.2 of the reference together: v·D = c·(thrustless - v), D = √(V_inplane² + (v - axial)²),
    c = `inflow_speed`. D is first estimated from the exact solution in axial flow, then two Halley steps follow:
    fixed work, no loop. Exact in axial flow; over 12 m/s in plane, -4..1.5 m/s axial and 0..12 degrees of pitch
    the error of λ0 is below 1e-9, but for a rotor that a climb faster than 3 m/s drives at no pitch (below 1e-5).
    """
    c = rotor.inflow_speed_m_s
    thrustless = thrustless_inflow(pitch, inplane_sq, axial, rotor)
    through = axial_flow_through(thrustless, axial, rotor)
    inplane = np.sqrt(inplane_sq + STILL_AIR_SQ)
    sides = inplane + through
    squares = inplane_sq + through * through + HYPOTENUSE * inplane * through
    start = c * thrustless * sides / (c * sides + squares)
    once = refine_induced_velocity(start, thrustless, inplane_sq, axial, rotor)
    twice = refine_induced_velocity(once, thrustless, inplane_sq, axial, rotor)
    # the thrust pushes the air its own way, so v_i lies between none and thrustless
    return clamp(twice, smaller(thrustless, 0.0), larger(thrustless, 0.0))


@equation
def thrust(pitch: float, inplane_sq: float, axial: float, induced: float, rotor: Rotor) -> float:
    """Thrust out of ground effect [N] at an induced velocity (equation 2.1), held to the stall limit."""
    free = rotor.thrust_slope_n_s_m * (thrustless_inflow(pitch, inplane_sq, axial, rotor) - induced)
    return clamp(free, -rotor.thrust_limit_n, rotor.thrust_limit_n)


@equation
def torque(thrust_n: float, inplane_sq: float, axial: float, induced: float, rotor: Rotor) -> float:
    """Shaft torque [N m]: C_Q = C_T·(λ0 - μ_z) + σ·C_D0/8·(1 + 7/3·μ²)."""
    mu_sq = inplane_sq * (1.0 / (rotor.tip_speed_m_s * rotor.tip_speed_m_s))
    lifting = thrust_n * (induced - axial) * (1.0 / rotor.speed_rad_s)
    return lifting + rotor.profile_torque_n_m * (1.0 + 7.0 / 3.0 * mu_sq)


@equation
def blowback(
    pitch: float, inplane_sq: float, axial: float, induced: float, lift_solidity: float, tip_speed_m_s: float
) -> float:
    """How far the disc tilts away from the oncoming air, per in-plane advance ratio [rad].

    da1/dμ = 2·(4/3·θ0 - λ0), and 16·|μ|·μ_z / ((1 - μ²/2)·(8|μ| + a·σ)) for flow through the disc; both along
    the in-plane airspeed, whatever its direction.
    """
    per_tip = 1.0 / tip_speed_m_s
    mu_sq = inplane_sq * (per_tip * per_tip)
    mu: float = np.sqrt(inplane_sq + STILL_AIR_SQ) * per_tip
    through = 16.0 * mu * (axial * per_tip) / ((1.0 - 0.5 * mu_sq) * (8.0 * mu + lift_solidity))
    return 2.0 * (4.0 / 3.0 * pitch - induced * per_tip) + through


@equation
def sine_of_tilt(angle: float) -> float:
    """The sine of a flapping angle [rad] by its series, shorter than `compile.sin`: error below 3e-9 to 0.2 rad."""
    square = angle * angle
    return angle * (1.0 + square * (-1.0 / 6.0 + square * (1.0 / 120.0)))


@equation
def cosine_of_tilt(angle: float) -> float:
    """The cosine of a flapping angle [rad] by its series: error below 1e-7 to 0.2 rad."""
    square = angle * angle
    return 1.0 + square * (-0.5 + square * (1.0 / 24.0))


LOWEST_INDUCED_SQ = 0.3**2  # [m2/s2]


@equation
def source_and_image(
    hub_height_m: float, airspeed_sq: float, induced_m_s: float, radius_m: float
) -> tuple[float, float]:
    """The multiplier is the first over the first less the second; airspeed_sq: horizontal, squared [m2/s2]."""
    height = larger(hub_height_m, 0.5 * radius_m)
    induced_sq = larger(induced_m_s * induced_m_s, LOWEST_INDUCED_SQ)
    return 16.0 * (height * height) * (induced_sq + airspeed_sq), radius_m * radius_m * induced_sq


@equation
def multiplier_of_squares(hub_height_m: float, airspeed_sq: float, induced_m_s: float, radius_m: float) -> float:
    """`multiplier` with the square of the horizontal airspeed [m2/s2], which the physics has at hand."""
    free, image = source_and_image(hub_height_m, airspeed_sq, induced_m_s, radius_m)
    return free / (free - image)


@equation
def multiplier(hub_height_m: float, airspeed_m_s: float, induced_m_s: float, radius_m: float) -> float:
    """T_IGE/T_OGE = 1 / (1 - (R/4z)² / (1 + (V/v_i)²)) (equation 11), 1.333 at z = R/2 in hover.

    z is the height of the rotor hub above ground, not of the vehicle; V the horizontal airspeed; v_i the induced
    velocity, at least 0.3 m/s. The source image is valid for about 0.5 <= z/R <= 2: below R/2 the value there serves;
    above 2R the formula runs on (1.0 % at 1.25 diameters, where the paper's text has zero).
    """
    return multiplier_of_squares(hub_height_m, airspeed_m_s * airspeed_m_s, induced_m_s, radius_m)
