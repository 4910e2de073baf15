"""Generator B, the flight: the vehicle's commands, the room that it is in, and the resulting flight."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from made.flight import GRAVITY_M_S2, Array, Truth
from made.loop_dynamics import COLUMNS, EACH, FLY, HAND, IDLE, LAND, OFF, STEP_S, Told, Vehicle, fly
from made.loop_traits import Traits

TICK_S = EACH * STEP_S
SETTLING_S = 0.6  # before the log begins: its feet come to rest
AFTER_S = (2.5, 5.0)  # on the floor, after the last landing
ROOM_M = 2.0
MOST_PATH_M = 34.0


class Flown(NamedTuple):
    """The scene of the sensors: the truth, the thrust of each rotor over weight (n, 4), the room.

    boxes (k, 5): north from, to, east from, to, down [m], and the floor about them, down; from where the IMU stood.
    """

    truth: Truth
    thrust: Array
    boxes: Array
    ground_m: float


class Script(NamedTuple):
    """A flight's legs: where each ends, instant [s], place (3,) down and yaw, and its phase; the first is the begin."""

    at_s: list[float]
    phase: list[float]
    place: list[Array]
    yaw: list[float]


def between(random: np.random.Generator, pair: tuple[float, float]) -> float:
    """An even draw of a range."""
    return float(random.uniform(*pair))


def flown(traits: Traits, random: np.random.Generator) -> Flown:
    """One flight."""
    vehicle = _vehicle(random)
    boxes, ground_m = _room(traits, random)
    script, release_s = _script(traits, random, boxes, ground_m)
    count = round((script.at_s[-1] + SETTLING_S) / STEP_S)
    told = _told(traits, random, script, release_s, count // EACH + 1)
    leg_m = float(vehicle.leg_m.mean())
    begin = told.place[0].copy() if traits.start == "hand" else np.array([0.0, 0.0, -leg_m + 0.0008])
    yaw = told.yaw[0]
    out = np.zeros((count, COLUMNS))
    attitude = np.array([np.cos(0.5 * yaw), 0.0, 0.0, np.sin(0.5 * yaw)])
    fly(vehicle, told, boxes, ground_m, begin, attitude, out)
    return _cut(traits, out, boxes, ground_m, leg_m, release_s)


# -- who flies, and where ----------------------------------------------------------------------------------------
def _vehicle(random: np.random.Generator) -> Vehicle:
    """A quadrotor between a palm and a dinner plate across; nothing on it is quite in its middle."""
    arm_m = between(random, (0.035, 0.13))
    foot_m = arm_m * between(random, (0.7, 0.9))
    legs = max(0.02, foot_m * between(random, (0.3, 0.6))) + random.normal(0.0, 0.0006, 4)
    return Vehicle(
        arm_m=arm_m, foot_m=foot_m, leg_m=legs, most=between(random, (1.8, 2.4)), lag_s=between(random, (0.025, 0.06)),
        spread=1.0 + random.normal(0.0, 0.008, 4), gyration_m2=(0.75 * arm_m) ** 2, yaw_m=0.012 + 0.06 * arm_m,
        offset_m=arm_m * random.normal(0.0, 0.012, 2), drag_per_s=between(random, (0.15, 0.5)), rotor_m=0.6 * arm_m,
        friction=between(random, (0.3, 0.8)),
    )  # fmt: skip


def _room(traits: Traits, random: np.random.Generator) -> tuple[Array, float]:
    """Boxes and the floor, down: the start stands on a floor or a table at 0."""
    if traits.start != "table":
        return np.zeros((0, 5)), 0.0
    half = random.uniform(0.22, 0.45, 2)
    return np.array([[-half[0], half[0], -half[1], half[1], 0.0]]), between(random, (0.45, 0.8))


# -- the commands ------------------------------------------------------------------------------------------------
def _script(traits: Traits, random: np.random.Generator, boxes: Array, ground_m: float) -> tuple[Script, float]:
    """The legs of a flight, and when a hand lets go [s] (0 without)."""
    script, release_s = Script([0.0], [OFF], [np.zeros(3)], [0.0]), 0.0
    if traits.start == "hand":
        release_s = _thrown(traits, random, script)
    else:
        _to(script, between(random, traits.rest_s), OFF, script.place[-1])
        _to(script, between(random, traits.idle_s), IDLE, script.place[-1])
    flight_s, length_m, begun_s = between(random, traits.flight_s), 0.0, script.at_s[-1]
    if traits.start != "hand":
        up = np.array([0.0, 0.0, -between(random, (0.35, 0.7) if len(boxes) else traits.height_m)])
        _to(script, -up[2] / between(random, (0.35, 0.7)), FLY, up)
        if len(boxes):
            aside = random.uniform(0.0, 2.0 * np.pi)
            away = np.array([1.2 * np.cos(aside), 1.2 * np.sin(aside), up[2]])
            _to(script, 1.2 / between(random, (0.4, 0.8)), FLY, away)
    for landing in range(traits.landings):
        until_s = begun_s + flight_s * (landing + 1) / traits.landings
        while script.at_s[-1] < until_s and length_m < MOST_PATH_M * (landing + 1) / traits.landings:
            length_m += _leg(traits, random, script, ground_m)
        _down(traits, random, script, ground_m)
        if landing + 1 < traits.landings:
            _to(script, between(random, (1.0, 3.0)), IDLE, script.place[-1])
            up = script.place[-1].copy()
            up[2] = ground_m - between(random, traits.height_m)
            _to(script, between(random, (1.5, 3.0)), FLY, up)
    _to(script, between(random, (0.2, 0.6)), IDLE, script.place[-1])
    _to(script, between(random, AFTER_S), OFF, script.place[-1])
    return script, release_s


def _to(script: Script, spent_s: float, phase: float, place: Array, yaw: float | None = None) -> None:
    """A leg of a phase that ends at a place."""
    script.at_s.append(script.at_s[-1] + spent_s)
    script.phase.append(phase)
    script.place.append(np.asarray(place, float))
    script.yaw.append(script.yaw[-1] if yaw is None else yaw)


def _leg(traits: Traits, random: np.random.Generator, script: Script, ground_m: float) -> float:
    """A leg to somewhere, perhaps with a turn, and a rest there; how long it is [m]."""
    here = script.place[-1]
    there = np.append(random.uniform(-ROOM_M, ROOM_M, 2), ground_m - between(random, traits.height_m))
    leg_m = float(np.linalg.norm(there - here))
    spent_s, yaw = max(leg_m / between(random, traits.speed_m_s), 1.0), script.yaw[-1]
    if traits.turn_rate_rad_s[1] > 0.0 and random.random() < 0.8:
        turn = random.choice([-1.0, 1.0]) * between(random, (0.6, 3.0))
        yaw = yaw + turn
        spent_s = max(spent_s, 0.3)
        turn_s = abs(turn) / between(random, traits.turn_rate_rad_s)
        if turn_s < spent_s:
            _to(script, turn_s, FLY, here + (there - here) * turn_s / spent_s, yaw)
            spent_s -= turn_s
        else:
            spent_s = turn_s
    _to(script, spent_s, FLY, there, yaw)
    _to(script, between(random, (0.2, 1.2)), FLY, there)
    return leg_m


def _down(traits: Traits, random: np.random.Generator, script: Script, ground_m: float) -> None:
    """Over a place clear of the table, and down until the feet feel the floor."""
    here = script.place[-1].copy()
    _to(script, between(random, (0.5, 1.5)), FLY, here)
    below = np.array([here[0], here[1], ground_m + 0.35])
    _to(script, (below[2] - here[2]) / between(random, traits.sink_m_s) + 0.8, LAND, below)


def _thrown(traits: Traits, random: np.random.Generator, script: Script) -> float:
    """Held in a hand, swung and let go; when [s]."""
    held = np.array([0.0, 0.0, -between(random, (0.9, 1.4))])
    script.place[0] = held
    script.phase[0] = HAND
    _to(script, between(random, traits.rest_s), HAND, held)
    swing_s, aside = between(random, (0.35, 0.55)), random.uniform(0.0, 2.0 * np.pi)
    speed = between(random, (0.8, 1.8))
    over = np.array([speed * np.cos(aside), speed * np.sin(aside), -between(random, (0.8, 1.8))])
    _to(script, swing_s, HAND, held + 0.5 * over * swing_s)
    release_s = script.at_s[-1]
    _to(script, between(random, (0.08, 0.2)), OFF, held + over * 0.4)
    _to(script, between(random, (1.0, 2.0)), FLY, held + over * 0.5)
    return release_s


def _told(traits: Traits, random: np.random.Generator, script: Script, release_s: float, count: int) -> Told:
    """The script as rows, with the room's air and what the controller believes."""
    t_s = np.maximum(np.arange(count) * TICK_S - SETTLING_S, 0.0)
    row = np.clip(np.searchsorted(script.at_s, t_s, side="right"), 1, len(script.at_s) - 1)
    phase = np.array(script.phase)[row]
    place = np.column_stack([np.interp(t_s, script.at_s, column) for column in np.array(script.place).T])
    angle = np.zeros((count, 3))
    if traits.start == "hand":
        sway = np.column_stack([wandering(random, count, 0.6) for _ in range(6)])
        place += 0.008 * sway[:, :3] * (t_s < release_s)[:, None]
        angle = np.deg2rad([3.0, 3.0, 2.0]) * sway[:, 3:]
        swing = np.clip(1.0 - (release_s - t_s) / 0.4, 0.0, 1.0)
        angle += np.deg2rad(random.normal(0.0, 9.0, 3)) * (swing**2)[:, None]
        accelerated = np.array(script.place[2]) - script.place[1]
        begin_s = script.at_s[1]
        share = np.clip((t_s - begin_s) / (release_s - begin_s), 0.0, 1.0)
        place = np.where((phase == HAND)[:, None], place + np.outer(share**2 - share, accelerated), place)
    slip = np.zeros(count)
    idle = np.flatnonzero(phase == IDLE)
    if traits.slip_deg[1] > 0.0 and len(idle):
        slip = _slip(traits, random, t_s, t_s[idle[0]])
    wind = between(random, traits.wind_m_s) * np.column_stack([wandering(random, count, 1.5) for _ in range(3)])
    wrong = np.column_stack([wandering(random, count, tau) for tau in (2.0, 2.0, 1.0, 0.25, 0.25, 0.25, 0.8)])
    wrong *= np.array([0.04, 0.04, 0.02, 0.05, 0.05, 0.03, 0.015]) * between(random, (0.6, 1.4))
    wash = np.column_stack([wandering(random, count, 0.08) for _ in range(6)])
    yaw = np.interp(t_s, script.at_s, script.yaw)
    return Told(phase, place, yaw, angle, slip, wind * np.array([1.0, 1.0, 0.4]), wrong, wash)


def _slip(traits: Traits, random: np.random.Generator, t_s: Array, begun_s: float) -> Array:
    """Rates at which the motors turn it on the floor as they spin up [rad/s]: short slips that add up."""
    whole = np.deg2rad(between(random, traits.slip_deg)) * random.choice([-1.0, 1.0])
    rates = np.zeros(len(t_s))
    share = random.dirichlet(np.full(int(random.integers(1, 4)), 2.0))
    for part in share:
        slipping = np.flatnonzero(t_s >= begun_s + between(random, (0.05, 0.3)))[: int(random.integers(4, 12))]
        rates[slipping] += part * whole / (len(slipping) * TICK_S)
    return rates


def wandering(random: np.random.Generator, count: int, tau_s: float) -> Array:
    """A first-order Gauss-Markov process of unit variance (count,), a value a tick."""
    keep = np.exp(-TICK_S / tau_s)
    kicks = np.sqrt(1.0 - keep * keep) * random.standard_normal(count)
    kicks[0] = random.standard_normal()
    block = 256  # sums of a geometric series, a block at a time
    powers = keep ** np.arange(block)
    found, last = np.empty(count), 0.0
    for begin in range(0, count, block):
        part = kicks[begin : begin + block]
        found[begin : begin + block] = np.convolve(part, powers[: len(part)])[: len(part)]
        if begin:
            found[begin : begin + block] += last * keep * powers[: len(part)]
        last = found[begin + len(part) - 1]
    return found


# -- the result --------------------------------------------------------------------------------------------------
def _cut(traits: Traits, out: Array, boxes: Array, ground_m: float, leg_m: float, release_s: float) -> Flown:
    """The rows from the log's begin on, places from where the IMU was then."""
    out = out[round(SETTLING_S / STEP_S) :]
    t_s = np.arange(len(out)) * STEP_S
    origin = out[0, 0:3].copy()
    velocity, quaternion = out[:, 3:6], out[:, 6:10]
    middle = quaternion[:-1] + quaternion[1:]
    middle /= np.linalg.norm(middle, axis=1)[:, None]
    force = np.diff(velocity, axis=0) / STEP_S - np.array([0.0, 0.0, GRAVITY_M_S2])
    aloft = np.flatnonzero((out[:, 17] == 0.0) & (out[:, 18] >= FLY) & (out[:, 18] != HAND))
    take_off_s = release_s if traits.start == "hand" else float(t_s[aloft[0]])
    truth = Truth(
        t_s, out[:, 0:3] - origin, velocity, quaternion, out[1:, 10:13], in_body(middle, force),
        take_off_s, float(t_s[aloft[-1]]),
    )  # fmt: skip
    moved = boxes - np.array([origin[0], origin[0], origin[1], origin[1], origin[2]])
    return Flown(truth, out[:, 13:17], moved, ground_m - origin[2])


def in_body(quaternion: Array, vector: Array) -> Array:
    """Vectors of the earth (n, 3) in the body's axes: the rows of the rotation's transpose."""
    w, x, y, z = quaternion.T
    a, b, c = vector.T
    return np.column_stack([
        (1 - 2 * (y * y + z * z)) * a + 2 * (x * y + w * z) * b + 2 * (x * z - w * y) * c,
        2 * (x * y - w * z) * a + (1 - 2 * (x * x + z * z)) * b + 2 * (y * z + w * x) * c,
        2 * (x * z + w * y) * a + 2 * (y * z - w * x) * b + (1 - 2 * (x * x + y * y)) * c,
    ])  # fmt: skip
