"""Ground effect on the main rotor's thrust (paper equation 11, read as Cheeseman and Bennett printed it)."""

from __future__ import annotations

from flownav.core.compile import equation, larger

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
    velocity, at least 0.3 m/s. The source image is valid for about 0.5 <= z/R <= 2: below R/2 the value there
    serves; above 2R the formula runs on (1.0 % at 1.25 diameters, where the paper's text says zero).
    """
    return multiplier_of_squares(hub_height_m, airspeed_m_s * airspeed_m_s, induced_m_s, radius_m)
