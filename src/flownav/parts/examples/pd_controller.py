"""A controller in one file: proportional position, velocity and tilt loops, with rate damping and no integrators.

It hovers and follows a path in calm air; with a steady wind it stands off, as a controller without integrators does.
"""

import numpy as np

from flownav.control.gains import AutopilotGains
from flownav.core.measurement import Array
from flownav.parts import Controls, Flown, Reference
from flownav.parts.tools import matrix

GRAVITY_M_S2 = 9.80665


class PdController:
    """Position to velocity to tilt to cyclic; height to collective; heading to pedal."""

    name = "pd"

    def start(self, gains: AutopilotGains) -> None:
        """Gains and trims of our autopilot for this vehicle serve as a beginning."""
        self.gains = gains

    def command(self, t_s: float, flown: Flown, reference: Reference, *, flying: bool) -> Controls:
        """Blade angles [rad]: lon > 0 pitches up, lat > 0 rolls right, col > 0 climbs, ped > 0 yaws right."""
        g, rotation = self.gains, matrix(flown.quaternion)
        if not flying:
            return Controls(0.0, 0.0, g.idle_collective_rad, g.pedal_trim_rad)
        heading = np.arctan2(rotation[1, 0], rotation[0, 0])
        level = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
        off_m = np.array([reference.pos_n, reference.pos_e, reference.pos_d]) - flown.pos_ned_m
        vel_m_s = rotation @ flown.vel_frd_m_s
        wanted_m_s = limited(g.position_gain * off_m[:2], g.horizontal_speed_limit_m_s)
        accel = level @ (wanted_m_s - vel_m_s[:2]) * g.forward_gain
        pitch, roll = g.pitch_trim_sine - accel[0] / GRAVITY_M_S2, g.roll_trim_sine + accel[1] / GRAVITY_M_S2
        p, q, r = flown.rate_frd_rad_s
        climb_m_s = -float(np.clip(g.height_gain * off_m[2], -g.climb_limit_m_s, g.climb_limit_m_s))
        return Controls(
            g.lon_trim_rad + g.pitch_gain * (pitch + rotation[2, 0]) - g.pitch_damping * q,
            g.lat_trim_rad + g.roll_gain * (roll - rotation[2, 1]) - g.roll_damping * p,
            g.collective_trim_rad + 2.0 * g.collective_gain * (climb_m_s + vel_m_s[2]),
            g.pedal_trim_rad + g.yaw_rate_gain * (-g.heading_gain * heading - r),
        )


def limited(vector: Array, length: float) -> Array:
    """A vector no longer than this."""
    return np.asarray(vector * min(1.0, length / max(float(np.linalg.norm(vector)), 1e-9)))
