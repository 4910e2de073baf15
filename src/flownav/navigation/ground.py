"""The ground below: it walks with new ground that passes below, and with what a range's scale makes of a climb."""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import equation, larger, smaller
from flownav.estimation.named import VelocityNed
from flownav.estimation.states import GROUND, PAD
from flownav.navigation.motion_records import DriftMemory
from flownav.navigation.told import HeightSettings, PlaceSettings
from flownav.navigation.verdicts import Doubt, GroundBelow, on_lanes

DRIFT_S = 5.0  # chosen: a sway about one place, slower than gusts push, passes over no new ground
OVER_GROUND_M_S = 1.0  # from this speed on the ground walks as stated: chosen, a walking pace


@equation
def drifting(velocity: VelocityNed, m: DriftMemory, dt_s: float) -> DriftMemory:
    """The velocity over the ground without sways about one place [m/s]."""
    share = dt_s / (DRIFT_S + dt_s)
    return DriftMemory(
        m.north_m_s + share * (velocity.vel_n - m.north_m_s), m.east_m_s + share * (velocity.vel_e - m.east_m_s),
        m.down_m_s + share * (velocity.vel_d - m.down_m_s),
    )


@equation
def terrain_walk(drift: DriftMemory, walk_m_rt_s: float) -> float:
    """How the ground's variance grows with what passes below [m2/s]: a hover is over one place."""
    speed_m_s = np.sqrt(drift.north_m_s * drift.north_m_s + drift.east_m_s * drift.east_m_s)
    return smaller(speed_m_s / OVER_GROUND_M_S, 1.0) * walk_m_rt_s * walk_m_rt_s


@equation
def scale_walk(height_m: float, climb_m_s: float, scale_sigma: float) -> float:
    """How it grows with the climb [m2/s]: a range that is wrong by a share e puts the ground e h off, and
    d(e h)^2/dt = 2 e^2 h dh/dt.
    """
    return 2.0 * scale_sigma * scale_sigma * larger(height_m, 0.0) * abs(climb_m_s)


class WalkedGround(NamedTuple):
    """What the ground does over a step."""

    drift: DriftMemory
    walked: tuple[Doubt, Doubt, Doubt, Doubt]


@on_lanes
def walk_ground(
    m: DriftMemory, velocity: VelocityNed, below: GroundBelow, *, dt_s: float, s: HeightSettings, place: PlaceSettings
) -> WalkedGround:
    """The ground is less sure by what passes below, and by what the range's scale makes of the climb."""
    drift = drifting(velocity, m, dt_s)
    rate = terrain_walk(drift, s.ground_walk_m_rt_s) + scale_walk(
        below.height_m, drift.down_m_s, s.range_scale_sigma
    )
    level = scale_walk(below.height_m, drift.down_m_s, place.pad_boresight_sigma_rad)
    down = scale_walk(below.height_m, drift.down_m_s, place.pad_scale_sigma)
    return WalkedGround(
        drift, (Doubt(GROUND, rate * dt_s), Doubt(PAD, level * dt_s), Doubt(PAD + 1, level * dt_s), Doubt(PAD + 2, down * dt_s))
    )
