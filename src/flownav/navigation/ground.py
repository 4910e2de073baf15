"""Growth of the uncertainty of ground and pad over a step.

The ground walks with new ground that passes below. And what lasts in a sensor's error changes with the height: a range
that is wrong by a share e puts the ground e h off, a camera that looks past its axis by e sees its pad e h beside its
place. Both are states as the sensor sees them, and the nearer the ground, the nearer to where they are.
"""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import equation, larger, smaller
from flownav.estimation.named import VelocityNed
from flownav.estimation.states import GROUND, PAD
from flownav.navigation import calls
from flownav.navigation.kernel_settings import HeightSettings, PlaceSettings
from flownav.navigation.motion_records import DriftMemory
from flownav.navigation.verdicts import Doubt, GroundBelow, on_lanes

DRIFT_S = 5.0  # chosen: who sways about one place, in gusts, passes over no new ground and goes nowhere
OVER_GROUND_M_S = 1.0  # from this speed on the ground walks as stated: chosen, a walking pace


@equation
def drifting(velocity: VelocityNed, m: DriftMemory, dt_s: float) -> DriftMemory:
    """The velocity without sways about one place [m/s]."""
    share = dt_s / (DRIFT_S + dt_s)
    return DriftMemory(
        m.north_m_s + share * (velocity.vel_n - m.north_m_s),
        m.east_m_s + share * (velocity.vel_e - m.east_m_s),
        m.down_m_s + share * (velocity.vel_d - m.down_m_s),
    )


@equation
def terrain_walk(drift: DriftMemory, walk_m_rt_s: float) -> float:
    """How the ground's variance grows with the ground that passes below [m2/s]: a hover is over one place."""
    speed_m_s = np.sqrt(drift.north_m_s * drift.north_m_s + drift.east_m_s * drift.east_m_s)
    return smaller(speed_m_s / OVER_GROUND_M_S, 1.0) * walk_m_rt_s * walk_m_rt_s


@equation
def lasting_walk(height_m: float, drift: DriftMemory, sigma: float) -> float:
    """How the variance of e h grows or shrinks with the height h [m2/s], e of a standard deviation sigma: 2 sigma^2 h
    |dh/dt|, which from the ground up, or down to it, sums up to sigma^2 h^2.
    """
    return 2.0 * sigma * sigma * larger(height_m, 0.0) * abs(drift.down_m_s)


class WalkedBelow(NamedTuple):
    """Memory and doubts of ground and pad after a step."""

    drift: DriftMemory
    walked: tuple[Doubt, Doubt, Doubt, Doubt]


@on_lanes(calls.walk_below)
def walk_below(
    m: DriftMemory, velocity: VelocityNed, below: GroundBelow, *, dt_s: float, height: HeightSettings,
    place: PlaceSettings,
) -> WalkedBelow:  # fmt: skip
    """Ground and pad are less sure by what passes below, and by what of the sensors' errors lasts."""
    drift = drifting(velocity, m, dt_s)
    ground = terrain_walk(drift, height.ground_walk_m_rt_s)
    ranged = lasting_walk(below.height_m, drift, height.range_scale_sigma)
    level = lasting_walk(below.height_m, drift, place.pad_boresight_sigma_rad)
    along = lasting_walk(below.height_m, drift, place.pad_scale_sigma)
    return WalkedBelow(
        drift,
        (
            Doubt(GROUND, (ground + ranged) * dt_s),
            Doubt(PAD, level * dt_s),
            Doubt(PAD + 1, level * dt_s),
            Doubt(PAD + 2, along * dt_s),
        ),
    )
