"""The change that one unit of each fault makes to a reading of flow, and to a GPS fix."""

import numpy as np

from flownav.core.compile import Lanes, Work, equation, procedure, replacing
from flownav.core.frames import angular_flow, to_body
from flownav.estimation.hypotheses import (
    FLOW_AGE,
    FLOW_REVERSED,
    FLOW_SCALE,
    FLOW_SWAPPED,
    GPS_DRIFT,
    followed,
    sign,
    sign_all,
)
from flownav.estimation.motion import rotation_of
from flownav.estimation.named import VelocityNed
from flownav.navigation.flow_noise import LONGEST_STEP_S
from flownav.navigation.memory import (
    DRIFT_SINCE,
    MEMORY,
    load_flow,
    load_look,
    load_sign,
    shared,
    store_sign,
)
from flownav.navigation.records import FlowSignMemory

load_velocity, _ = MEMORY.access(VelocityNed)
with_x, with_y = replacing(FlowSignMemory, "read_x"), replacing(FlowSignMemory, "read_y")
with_turning = replacing(FlowSignMemory, "turning_x", "turning_y", "speed_m_s")


@procedure
def sign_flow(work: Work, lanes: Lanes, t_s: float, component: int, angular: bool) -> None:
    """Effects of faults on a component of flow [rad/s] or body velocity [m/s]: a share, other channel, older motion.

    Of what the sensor itself reads: an angular rate still holds the vehicle's turning. That is taken from the reading
    before, so that the gyro's noise, which is in the innovation too, does not pass for a fault (an instrumental
    variable: Young, Recursive Estimation and Time-Series Analysis, 2011, chapter 6).
    """
    if followed(work, lanes) == 0:
        return
    for lane in range(len(lanes)):
        look, m = load_look(work, lanes, lane), load_sign(work, lanes, lane)
        own, other = read_by(seen_by(work, lanes, lane, look.range_m, m, angular), component)
        since_s = t_s - load_flow(work, lanes, lane).taken_s
        slope = (own - (m.read_x if component == 0 else m.read_y)) / since_s
        lately = since_s > 0.0 and since_s < LONGEST_STEP_S
        level = component < 2 and bool(np.isfinite(own + other))
        sign(work, lanes, FLOW_SCALE, lane, own if level else 0.0)
        sign(work, lanes, FLOW_SWAPPED, lane, other - own if level else 0.0, -1.0)
        sign(work, lanes, FLOW_REVERSED, lane, -2.0 * own if level else 0.0, -1.0)
        sign(work, lanes, FLOW_AGE, lane, -slope if level and lately else 0.0)
        m = with_x(m, read_x=own) if level and component == 0 else m
        m = with_y(m, read_y=own) if level and component != 0 else m
        per = look.range_m if angular else 1.0
        m = followed_sign(m, own, other, level, per, look.turning_x, look.turning_y) if component == 1 else m
        store_sign(work, lanes, lane, m)


@equation
def seen_by(
    work: Work, lanes: Lanes, lane: int, range_m: float, m: FlowSignMemory, angular: bool
) -> tuple[float, float]:
    """The filter's prediction of the sensor's two channels [rad/s or m/s]."""
    v = load_velocity(work, lanes, lane)
    u, v, _ = to_body(rotation_of(work, lanes, lane), v.vel_n, v.vel_e, v.vel_d)
    return angular_flow(u, v, m.turning_x, m.turning_y, range_m) if angular else (u, v)


@equation
def read_by(read: tuple[float, float], component: int) -> tuple[float, float]:
    """The component's own channel, and the other."""
    return (read[0], read[1]) if component == 0 else (read[1], read[0])


@equation
def followed_sign(
    m: FlowSignMemory, own: float, other: float, level: bool, range_m: float, turned_x: float, turned_y: float
) -> FlowSignMemory:
    """Speed and turning of the reading at hand, for the next."""
    speed = np.sqrt(own * own + other * other) * range_m
    return with_turning(
        m,
        turning_x=turned_x if np.isfinite(turned_x) else 0.0,
        turning_y=turned_y if np.isfinite(turned_y) else 0.0,
        speed_m_s=speed if level else 0.0,
    )


@procedure
def sign_drift(work: Work, lanes: Lanes, t_s: float, axis: int) -> None:
    """Effect of a fault on an axis of a GPS position: the time since the drift began."""
    since_s = shared(work, lanes, DRIFT_SINCE)
    sign_all(work, lanes, GPS_DRIFT + axis, t_s - since_s if np.isfinite(since_s) else 0.0)
