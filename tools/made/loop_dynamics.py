"""Generator B, the motion: a quadrotor as a rigid body on its motors, its controller, and the ground, in a closed loop.

Motors are first-order lags of thrust; rotors drag along the air they meet; near the ground thrust grows (Cheeseman and
Bennett 1955) and their wash comes back as gusts; feet are springs with Coulomb's friction. The controller flies on a
position of its own that is wrong by what an indoor position is wrong by. Earth north-east-down, body
forward-right-down, SI. Compiled, since it steps a thousand times a second; NumPy's and Numba's arithmetic alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

STEP_S = 0.001
EACH = 10  # steps between rows of its commands
GRAVITY_M_S2 = 9.80665
OFF, IDLE, FLY, LAND, HAND = 0.0, 1.0, 2.0, 3.0, 4.0
COLUMNS = (
    19  # north, east, down; velocity; quaternion; rate; thrust of four rotors over weight; feet on the ground; phase
)


class Vehicle(NamedTuple):
    """The parameters of a vehicle. Forces are over its mass, torques over its inertia.

    arm_m: from the middle to a rotor along x and y; foot_m: the same to a foot; leg_m (4,): how far below the IMU
    each foot is. most: thrust of all rotors over weight; lag_s: of a motor; spread (4,): factor of each motor on its
    command. gyration_m2: moment of inertia over mass about x, y; about z twice that. yaw_m: torque over thrust of a
    rotor. offset_m (2,): of the centre of mass, forward and right, which tips it as it lifts off. drag_per_s.
    rotor_m: radius. friction: Coulomb's coefficient.
    """

    arm_m: float
    foot_m: float
    leg_m: np.ndarray
    most: float
    lag_s: float
    spread: np.ndarray
    gyration_m2: float
    yaw_m: float
    offset_m: np.ndarray
    drag_per_s: float
    rotor_m: float
    friction: float


class Told(NamedTuple):
    """The commands to the vehicle and the disturbances on it, a row every EACH steps (m, ...).

    phase (m,): OFF to HAND. place (m, 3), yaw (m,): where to go, in HAND where the hand holds it, at angle (m, 3),
    roll, pitch and yaw. slip_rad_s (m,): what turns it on the floor. wind_m_s (m, 3). believed (m, 7): errors of the
    position and the velocity that the controller has, and of its heading. wash (m, 6): unit noise of the wash on
    force and on torque.
    """

    phase: np.ndarray
    place: np.ndarray
    yaw: np.ndarray
    angle: np.ndarray
    slip_rad_s: np.ndarray
    wind_m_s: np.ndarray
    believed: np.ndarray
    wash: np.ndarray


@njit(cache=True)
def floor_under(boxes, ground_m, north, east):
    """Height of what is below a place, down [m]; boxes (k, 5): north from, to, east from, to, down."""
    found = ground_m
    for k in range(boxes.shape[0]):
        if boxes[k, 0] < north < boxes[k, 1] and boxes[k, 2] < east < boxes[k, 3]:
            found = min(found, boxes[k, 4])
    return found


@njit(cache=True)
def rotation(q):
    """Body to earth (3, 3) of a quaternion, w first."""
    w, x, y, z = q
    return np.array([
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ])  # fmt: skip


@njit(cache=True)
def turned(q, rate, step_s):
    """The quaternion after a step of a constant body rate."""
    size = np.sqrt(rate[0] ** 2 + rate[1] ** 2 + rate[2] ** 2)
    half = 0.5 * size * step_s
    c, s = np.cos(half), 0.5 * step_s
    if half > 1e-9:
        s = np.sin(half) / size
    x, y, z = s * rate[0], s * rate[1], s * rate[2]
    w0, x0, y0, z0 = q
    new = np.array([
        w0 * c - x0 * x - y0 * y - z0 * z, w0 * x + x0 * c + y0 * z - z0 * y,
        w0 * y - x0 * z + y0 * c + z0 * x, w0 * z + x0 * y - y0 * x + z0 * c,
    ])  # fmt: skip
    return new / np.sqrt((new**2).sum())


@njit(cache=True)
def feet(vehicle, boxes, ground_m, p, v, r, rate, feels, twists):
    """Adds what the ground does: acceleration (3,) in the earth's axes, torque (3,) over mass in the body's [m2/s2].

    Returns the part of the weight that the feet carry.
    """
    carried = 0.0
    stiff, damp, slow = GRAVITY_M_S2 / (4.0 * 0.0008), 2.0 * 0.35 * np.sqrt(GRAVITY_M_S2 / 0.0008) / 4.0, 0.015
    arm = np.empty(3)
    for k in range(4):
        arm[0] = vehicle.foot_m if k < 2 else -vehicle.foot_m
        arm[1] = vehicle.foot_m if k % 2 == 0 else -vehicle.foot_m
        arm[2] = vehicle.leg_m[k]
        spin = np.cross(rate, arm)
        at = p + r @ arm
        moving = v + r @ spin
        deep = at[2] - floor_under(boxes, ground_m, at[0], at[1])
        if deep <= 0.0 or deep > 0.05:  # beside an edge rather than on it
            continue
        normal = max(stiff * deep + damp * moving[2], 0.0)
        level = np.sqrt(moving[0] ** 2 + moving[1] ** 2)
        grip = vehicle.friction * normal / max(level, slow)
        push = np.array([-grip * moving[0], -grip * moving[1], -normal])
        feels += push
        twists += np.cross(arm, r.T @ push)
        carried += normal / GRAVITY_M_S2
    return carried


@njit(cache=True)
def mixed(vehicle, lift, twist, motors):
    """Thrust over weight that each rotor is commanded, from lift over weight and angular acceleration [rad/s2]."""
    inertia = vehicle.gyration_m2 / GRAVITY_M_S2
    roll, pitch = twist[0] * inertia / (4.0 * vehicle.arm_m), twist[1] * inertia / (4.0 * vehicle.arm_m)
    yaw = min(max(twist[2] * 2.0 * inertia / (4.0 * vehicle.yaw_m), -0.06), 0.06)
    for k in range(4):  # front right, front left, back right, back left; the first and the last turn against the clock
        ahead, right = (1.0 if k < 2 else -1.0), (1.0 if k % 2 == 0 else -1.0)
        turn = 1.0 if k in (0, 3) else -1.0
        told = 0.25 * lift - right * roll + ahead * pitch + turn * yaw
        motors[k] = min(max(told, 0.02), 0.25 * vehicle.most)


@njit(cache=True)
def controlled(vehicle, place, yaw, seen_p, seen_v, r, rate, memory, motors):
    """A cascade: position to velocity to acceleration to tilt to rate to torque; memory (3,): its integral."""
    wanted = np.empty(3)
    for k in range(3):
        speed = min(max(1.1 * (place[k] - seen_p[k]), -1.6), 1.6)
        if k == 2:
            speed = min(max(speed, -0.8), 0.6)
        slip = speed - seen_v[k]
        memory[k] = min(max(memory[k] + 0.8 * slip * STEP_S, -2.0), 2.0)
        wanted[k] = 2.6 * slip + memory[k]
    level = np.sqrt(wanted[0] ** 2 + wanted[1] ** 2)
    if level > 3.5:
        wanted[0], wanted[1] = wanted[0] * 3.5 / level, wanted[1] * 3.5 / level
    wanted[2] = min(max(wanted[2] - GRAVITY_M_S2, -1.6 * GRAVITY_M_S2), -0.4 * GRAVITY_M_S2)
    size = np.sqrt((wanted**2).sum())
    down = r.T @ (-wanted / size)  # where the body's z should point, in the body's axes
    lift = -(wanted[0] * r[0, 2] + wanted[1] * r[1, 2] + wanted[2] * r[2, 2]) / GRAVITY_M_S2
    heading = np.arctan2(r[1, 0], r[0, 0])
    off = yaw - heading
    off -= 2.0 * np.pi * np.floor((off + np.pi) / (2.0 * np.pi))
    asked = np.array([-7.0 * down[1], 7.0 * down[0], 2.5 * off])
    asked[2] = min(max(asked[2], -2.0), 2.0)
    twist = np.array([22.0 * (asked[0] - rate[0]), 22.0 * (asked[1] - rate[1]), 8.0 * (asked[2] - rate[2])])
    mixed(vehicle, max(lift, 0.2), twist, motors)


@njit(cache=True)
def pushed(vehicle, wind, wash, height, motors, v, r, thrust, feels, twists):
    """Lets rotors follow their motors' commands; adds their thrust, more near the ground, and the forces of the air."""
    near = vehicle.rotor_m / (4.0 * (height + 0.03))
    grown = min(1.0 / max(1.0 - near * near, 0.5), 1.2)
    lift, whole = 0.0, 0.0
    for k in range(4):
        thrust[k] += (vehicle.spread[k] * motors[k] - thrust[k]) * STEP_S / vehicle.lag_s
        ahead, right = (1.0 if k < 2 else -1.0), (1.0 if k % 2 == 0 else -1.0)
        turn = 1.0 if k in (0, 3) else -1.0
        force = GRAVITY_M_S2 * grown * thrust[k]
        twists[0] -= (right * vehicle.arm_m - vehicle.offset_m[1]) * force
        twists[1] += (ahead * vehicle.arm_m - vehicle.offset_m[0]) * force
        twists[2] += turn * vehicle.yaw_m * force
        lift, whole = lift + force, whole + thrust[k]
    turning = min(whole, 1.0)
    washed = turning * np.exp(-height / 0.35)
    along = r.T @ (v - wind)
    dragged = r @ np.array([-vehicle.drag_per_s * along[0], -vehicle.drag_per_s * along[1], -0.4 * along[2]])
    feels += turning * dragged + 0.7 * washed * wash[:3] - lift * r[:, 2]
    shaken = vehicle.gyration_m2 * 12.0
    twists[0] += 0.5 * washed * wash[3] * shaken
    twists[1] += 0.5 * washed * wash[4] * shaken
    twists[2] += 0.15 * turning * wash[5] * shaken


@njit(cache=True)
def held(place, angle, p, v, q, r, rate, feels, twist):
    """Adds the action of a hand: a spring to its place, and the turn of the held vehicle."""
    feels += 400.0 * (place - p) - 40.0 * v
    feels[2] -= GRAVITY_M_S2
    cr, sr = np.cos(0.5 * angle[0]), np.sin(0.5 * angle[0])
    cp, sp = np.cos(0.5 * angle[1]), np.sin(0.5 * angle[1])
    cy, sy = np.cos(0.5 * angle[2]), np.sin(0.5 * angle[2])
    w, x = cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy
    y, z = cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy
    # conj(q) * wanted
    ew = q[0] * w + q[1] * x + q[2] * y + q[3] * z
    sign = 2.0 if ew >= 0.0 else -2.0
    twist[0] += 400.0 * sign * (q[0] * x - q[1] * w - q[2] * z + q[3] * y) - 40.0 * rate[0]
    twist[1] += 400.0 * sign * (q[0] * y + q[1] * z - q[2] * w - q[3] * x) - 40.0 * rate[1]
    twist[2] += 400.0 * sign * (q[0] * z - q[1] * y + q[2] * x - q[3] * w) - 40.0 * rate[2]


@njit(cache=True)
def fly(vehicle, told, boxes, ground_m, p, q, out):
    """Steps the whole flight from a place (3,) and a quaternion (4,) at rest; rows into out (n, COLUMNS)."""
    v, rate, memory = np.zeros(3), np.zeros(3), np.zeros(3)
    thrust, motors = np.zeros(4), np.zeros(4)
    inertia = np.array([vehicle.gyration_m2, vehicle.gyration_m2, 2.0 * vehicle.gyration_m2])
    down_s, landed = 0.0, False
    for step in range(out.shape[0]):
        row = step // EACH
        phase = told.phase[row]
        r = rotation(q)
        feels, twists, twist = np.zeros(3), np.zeros(3), np.zeros(3)
        carried = feet(vehicle, boxes, ground_m, p, v, r, rate, feels, twists)
        landed = landed and phase in (LAND, IDLE)
        if phase == LAND:
            down_s = down_s + STEP_S if carried > 0.2 else 0.0
            landed = landed or down_s > 0.05
        out[step, 0:3], out[step, 3:6], out[step, 6:10], out[step, 10:13] = p, v, q, rate
        out[step, 13:17] = thrust
        out[step, 17], out[step, 18] = carried, 1.0 if landed else phase
        if phase in (OFF, HAND):
            motors[:] = 0.0
            memory[:] = 0.0
        elif phase == IDLE or landed:
            motors[:] = 0.06
            memory[:] = 0.0
        else:
            wrong = told.believed[row]
            yaw = told.yaw[row] + wrong[6]
            controlled(vehicle, told.place[row], yaw, p + wrong[:3], v + wrong[3:6], r, rate, memory, motors)
        height = max(floor_under(boxes, ground_m, p[0], p[1]) - p[2], 0.02)
        pushed(vehicle, told.wind_m_s[row], told.wash[row], height, motors, v, r, thrust, feels, twists)
        if phase == HAND:
            held(told.place[row], told.angle[row], p, v, q, r, rate, feels, twist)
        feels[2] += GRAVITY_M_S2
        twist += twists / inertia
        twist[0] += (inertia[1] - inertia[2]) / inertia[0] * rate[1] * rate[2] - 0.5 * rate[0]
        twist[1] += (inertia[2] - inertia[0]) / inertia[1] * rate[2] * rate[0] - 0.5 * rate[1]
        twist[2] -= 0.5 * rate[2]
        v = v + feels * STEP_S
        rate = rate + twist * STEP_S
        if told.slip_rad_s[row] != 0.0 and carried > 0.0:
            rate[2] = told.slip_rad_s[row]
        p = p + v * STEP_S
        q = turned(q, rate, STEP_S)
