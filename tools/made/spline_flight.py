"""Generator A, the motion: smooth paths between waypoints; the attitude is the one that flies such a path.

A multirotor's thrust is along its own z, and what else pushes it is the drag of its rotors: tilt follows from the
acceleration flown (differential flatness: Mellinger and Kumar 2011; rotor drag: Faessler, Franchi and Scaramuzza 2018).
NumPy alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from made.flight import GRAVITY_M_S2, Array, Truth, into_body
from made.spline_traits import Traits

RATE_HZ = 1000
STEP_S = 1.0 / RATE_HZ
SMOOTH_S = (0.45, 0.4, 0.3, 0.15)  # boxes that a piecewise linear path is averaged over: three continuous derivatives
SETTLE_S = (2.0, 5.0)  # motors off, after the landing
ROOM_M = 2.2
MOST_PATH_M = 36.0
WHOLE = 500  # steps of a flight are a multiple, and one instant more: a length that is quick to transform


class Flown(NamedTuple):
    """The scene of the sensors. truth; motors (n,): 0 off, 0.5 idle, 1 in flight; ground_m: height of the floor about
    the table that it started on (0 without).
    """

    truth: Truth
    motors: Array
    ground_m: float
    table_half_m: tuple[float, float]


class Times(NamedTuple):
    """Instants [s]: motors on, lift-off, the end of the course, the end of the log."""

    motors: float
    lift: float
    course_end: float
    end: float


def between(random: np.random.Generator, pair: tuple[float, float]) -> float:
    """An even draw of a range."""
    return float(random.uniform(*pair))


def fly(traits: Traits, random: np.random.Generator) -> Flown:
    """One flight."""
    ground_m = -between(random, (0.45, 0.8)) if traits.table else 0.0
    half = (between(random, (0.2, 0.45)), between(random, (0.2, 0.45)))
    knots_s, knots, sink_s = _course(traits, random, ground_m, half)
    motors_s = between(random, traits.rest_s)
    lift_s = motors_s + between(random, traits.spin_s)
    end_s = lift_s + knots_s[-1] + sum(SMOOTH_S) + between(random, SETTLE_S)
    t_s = np.arange(WHOLE * round(end_s * RATE_HZ / WHOLE) + 1) * STEP_S
    path = _smoothed(t_s, lift_s + 0.5 * sum(SMOOTH_S) + knots_s, knots)
    path[:, :3] += _wobble(traits, random, t_s, lift_s)
    position, touch_s = _grounded(t_s, path[:, :3], lift_s, lift_s + sink_s, ground_m)
    airborne = _ramp(t_s, lift_s, 0.3) * (1.0 - _ramp(t_s, touch_s - 0.02, 0.12))
    off_s = touch_s + between(random, (0.1, 0.8))
    motors = 0.5 * ((t_s >= motors_s) & (t_s < off_s)) + 0.5 * airborne
    yaw = path[:, 3] + _slip(traits, random, t_s, motors_s, lift_s)
    yaw = yaw + airborne * np.deg2rad(between(random, (0.2, 1.2))) * band_noise(random, len(t_s), 0.1, 0.8)
    quaternion = _attitude(random, t_s, position, yaw, airborne, motors)
    return Flown(_truth(t_s, position, quaternion, lift_s, touch_s), motors, ground_m, half)


# -- where it goes -----------------------------------------------------------------------------------------------
def _course(
    traits: Traits, random: np.random.Generator, ground_m: float, half: tuple[float, float]
) -> tuple[Array, Array, float]:
    """Instants from lift-off (k,), north, east, height [m] and yaw [rad] there (k, 4), and when it sinks."""
    low, high = traits.height_m
    climbed = between(random, (0.3, 0.5)) if traits.table else between(random, traits.height_m)
    place = np.array([0.0, 0.0, climbed])
    knots_s, knots = [0.0, climbed / between(random, traits.climb_m_s)], [np.zeros(4), np.append(place, 0.0)]
    flight_s, length_m, yaw = between(random, traits.flight_s), 0.0, 0.0
    while knots_s[-1] < flight_s and length_m < MOST_PATH_M:
        dwell_s = between(random, (0.0, 1.2))
        knots_s.append(knots_s[-1] + dwell_s)
        knots.append(np.append(place, yaw))
        there = np.append(random.uniform(-ROOM_M, ROOM_M, 2), ground_m + between(random, (low, high)))
        if len(knots) == 3 and traits.table:  # off the table at once
            aside = random.uniform(0.0, 2.0 * np.pi)
            there[:2] = (max(half) + between(random, (0.5, 1.2))) * np.array([np.cos(aside), np.sin(aside)])
            there[2] = max(there[2], climbed)
        leg_m = float(np.linalg.norm(there - place))
        leg_s = max(leg_m / between(random, traits.speed_m_s), 0.8)
        if random.random() < traits.turning:
            turn = random.choice([-1.0, 1.0]) * between(random, (0.6, 2.8))
            leg_s = max(leg_s, abs(turn) / traits.turn_rate_rad_s[1])
            turn_s = abs(turn) / between(random, traits.turn_rate_rad_s)
            leg_s = max(leg_s, turn_s)
            knots_s.append(knots_s[-1] + turn_s)
            knots.append(np.append(place + (there - place) * turn_s / leg_s, yaw + turn))
            leg_s, yaw = leg_s - turn_s, yaw + turn
        knots_s.append(knots_s[-1] + leg_s)
        knots.append(np.append(there, yaw))
        place, length_m = there, length_m + leg_m
    sink_s = knots_s[-1] + between(random, (0.8, 2.0))
    below = np.array([place[0], place[1], ground_m - 0.3, yaw])
    knots_s += [sink_s, sink_s + (place[2] - below[2]) / between(random, traits.sink_m_s)]
    knots += [np.append(place, yaw), below]
    return np.array(knots_s), np.array(knots), sink_s


def _smoothed(t_s: Array, knots_s: Array, knots: Array) -> Array:
    """The piecewise linear course at t_s, averaged over boxes: columns as the knots'."""
    path = np.column_stack([np.interp(t_s, knots_s, column) for column in knots.T])
    for width_s in SMOOTH_S:
        path = _boxed(path, width_s)
    return path


def _boxed(values: Array, width_s: float) -> Array:
    """A centred moving average of columns, the ends held."""
    half = round(0.5 * width_s * RATE_HZ)
    padded = np.concatenate([np.repeat(values[:1], half + 1, 0), values, np.repeat(values[-1:], half, 0)])
    summed = np.cumsum(padded - values[0], axis=0)
    return values[0] + (summed[2 * half + 1 :] - summed[: -2 * half - 1]) / (2 * half + 1)


def _wobble(traits: Traits, random: np.random.Generator, t_s: Array, lift_s: float) -> Array:
    """The sway of a held position, and the slide at lift-off: north, east and height [m] (n, 3)."""
    size_m = between(random, traits.wobble_m)
    swaying = np.column_stack([band_noise(random, len(t_s), 0.1, 0.7) for _ in range(3)])
    swaying *= size_m * np.array([1.0, 1.0, 0.6]) * _ramp(t_s, lift_s + 0.4, 1.5)[:, None]
    kick_m_s, towards = between(random, traits.kick_m_s), random.uniform(0.0, 2.0 * np.pi)
    sliding_s = between(random, (0.9, 1.6))
    phase = np.clip((t_s - lift_s - 0.15) / sliding_s, 0.0, 1.0)
    slid = kick_m_s * sliding_s * (0.5 * phase - np.sin(2.0 * np.pi * phase) / (4.0 * np.pi))
    back = 1.0 - _ramp(t_s, lift_s + 2.5, 2.5)
    swaying[:, 0] += slid * back * np.cos(towards)
    swaying[:, 1] += slid * back * np.sin(towards)
    return swaying


def _grounded(t_s: Array, path: Array, lift_s: float, sink_s: float, ground_m: float) -> tuple[Array, float]:
    """North, east, down [m] (n, 3) of a vehicle that the floor holds up, and when it touches down.

    It neither moves before lift-off nor goes through the floor; what sideways velocity is left, friction stops.
    """
    floor = np.where(t_s < sink_s, min(ground_m, 0.0), ground_m)
    touched = np.flatnonzero((t_s > sink_s) & (path[:, 2] <= ground_m))
    touch_s = float(t_s[touched[0]])
    height = np.where(t_s < lift_s, 0.0, np.where(t_s >= touch_s, ground_m, np.maximum(path[:, 2], floor)))
    height = _boxed(height[:, None], 0.014)[:, 0]
    free = _ramp(t_s, lift_s, 0.3) * (1.0 - _ramp(t_s, touch_s, 0.15))
    level = np.diff(path[:, :2], axis=0, prepend=path[:1, :2]) * free[:, None]
    return np.column_stack([np.cumsum(level, axis=0), -height]), touch_s


def _slip(traits: Traits, random: np.random.Generator, t_s: Array, motors_s: float, lift_s: float) -> Array:
    """The heading change by the motors on the floor as they spin up [rad] (n,): a few sticking steps."""
    whole = np.deg2rad(between(random, traits.slip_deg)) * random.choice([-1.0, 1.0])
    steps = int(random.integers(1, 4))
    share = random.dirichlet(np.ones(steps))
    begun_s = np.sort(random.uniform(motors_s + 0.05, max(lift_s - 0.2, motors_s + 0.06), steps))
    return whole * sum(part * _ramp(t_s, at_s, 0.12) for part, at_s in zip(share, begun_s, strict=True))


# -- how it lies in the air --------------------------------------------------------------------------------------
def _attitude(
    random: np.random.Generator, t_s: Array, position: Array, yaw: Array, airborne: Array, motors: Array
) -> Array:
    """Quaternions (n, 4): thrust where the acceleration and the rotors' drag ask for it, floor under it else."""
    velocity = np.gradient(position, STEP_S, axis=0)
    moving = _boxed(np.gradient(velocity, STEP_S, axis=0), 0.06)
    drag_per_s = between(random, (0.15, 0.5))
    thrust = moving + drag_per_s * velocity - np.array([0.0, 0.0, GRAVITY_M_S2])
    down = -thrust / np.linalg.norm(thrust, axis=1)[:, None]
    cos, sin = np.cos(yaw), np.sin(yaw)
    ahead, right = cos * down[:, 0] + sin * down[:, 1], -sin * down[:, 0] + cos * down[:, 1]
    floor = np.deg2rad(random.normal(0.0, 0.6, 2))
    ahead, right = airborne * ahead + (1.0 - airborne) * floor[0], airborne * right + (1.0 - airborne) * floor[1]
    tilted = _unit(np.column_stack([1.0 + np.sqrt(1.0 - ahead**2 - right**2), -right, ahead, np.zeros(len(yaw))]))
    turned = np.column_stack([np.cos(0.5 * yaw), np.zeros((len(yaw), 2)), np.sin(0.5 * yaw)])
    jitter = np.column_stack([band_noise(random, len(t_s), 1.5, 5.0) for _ in range(3)])
    jitter *= np.deg2rad(between(random, (0.05, 0.25))) * np.maximum(airborne, 0.03 * (motors > 0.0))[:, None]
    small = _unit(np.column_stack([np.ones(len(yaw)), 0.5 * jitter]))
    return product(product(turned, tilted), small)


def _truth(t_s: Array, position: Array, quaternion: Array, take_off_s: float, landing_s: float) -> Truth:
    """The motion with what perfect inertial sensors would show of it; their sums are the motion again."""
    velocity = np.diff(position, axis=0, append=position[-1:]) / STEP_S
    change = product(quaternion[:-1] * np.array([1.0, -1.0, -1.0, -1.0]), quaternion[1:])
    change *= np.sign(change[:, :1])
    sine = np.linalg.norm(change[:, 1:], axis=1)
    angle = 2.0 * np.arctan2(sine, change[:, 0])
    rate = change[:, 1:] * (angle / np.maximum(sine, 1e-12) / STEP_S)[:, None]
    middle = _unit(quaternion[:-1] + quaternion[1:])
    force = np.diff(velocity, axis=0) / STEP_S - np.array([0.0, 0.0, GRAVITY_M_S2])
    return Truth(t_s, position, velocity, quaternion, rate, into_body(middle, force), take_off_s, landing_s)


# -- small mathematics -------------------------------------------------------------------------------------------
def band_noise(random: np.random.Generator, count: int, low_hz: float, high_hz: float) -> Array:
    """Noise (count,) of unit variance between two frequencies, at RATE_HZ."""
    whole = WHOLE * -(-count // WHOLE)
    spectrum = np.fft.rfft(random.standard_normal(whole))
    hz = np.fft.rfftfreq(whole, STEP_S)
    shape = 1.0 / (1.0 + (hz / high_hz) ** 6) * (hz / low_hz) ** 2 / (1.0 + (hz / low_hz) ** 2)
    noise = np.fft.irfft(spectrum * shape, whole)[:count]
    return noise / noise.std()


def _ramp(t_s: Array, begin_s: float, length_s: float) -> Array:
    """0 before, 1 after, smooth between."""
    x = np.clip((t_s - begin_s) / length_s, 0.0, 1.0)
    return x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)


def _unit(rows: Array) -> Array:
    return rows / np.linalg.norm(rows, axis=1)[:, None]


def product(a: Array, b: Array) -> Array:
    """Hamilton's product of quaternions (n, 4)."""
    aw, ax, ay, az = a.T
    bw, bx, by, bz = b.T
    return np.column_stack([
        aw * bw - ax * bx - ay * by - az * bz, aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx, aw * bz + ax * by - ay * bx + az * bw,
    ])  # fmt: skip


def into_earth(quaternion: Array, vector: Array) -> Array:
    """Vectors of the body (n, 3) in the earth's axes."""
    return into_body(quaternion * np.array([1.0, -1.0, -1.0, -1.0]), vector)
