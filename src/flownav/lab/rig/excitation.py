"""How the pendulum is moved: the paper's free swing, several rod lengths, a chirp, steps.

A free swing is a near-pure tone: it tells gain and latency, no more. Rods of several lengths give several tones;
the chirp and the steps, by a motor at the pivot, give a band.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.errors import InputError
from flownav.lab.rig.pendulum import GRAVITY_M_S2, STEP_S, driven, half_sine, push_for, swing

Array = NDArray[np.float64]
EXCITATIONS = ("swing", "lengths", "chirp", "steps")
DAMPING_1_S = 0.04
HAND_PUSH_S = 1.0
HAND_SPREAD = 0.05  # from run to run: strength of the push, and twice as much in its duration
REST_S = 1.0
CHIRP_HZ = (0.3, 4.0)
SERVO_RAD_S = 2.0 * np.pi * 8.0
STEP_HOLD_S = (0.3, 1.2)
LARGEST_ANGLE_RAD = 0.2
SHORTEST_ROD_M = 0.25


class Motion(NamedTuple):
    """The rod's motion: angle [rad] and rate [rad/s], one a step of STEP_S."""

    time_s: Array
    angle_rad: Array
    rate_rad_s: Array


def rod_length(excitation: str, pivot_height_m: float, height_m: float, run: int, runs: int) -> float:
    """Length of the rod in a run [m]: l0 - h; for `lengths` from there to SHORTEST_ROD_M, their tones evenly apart."""
    longest = pivot_height_m - height_m
    if excitation != "lengths" or runs < 2:
        return longest
    slow, fast = np.sqrt(GRAVITY_M_S2 / longest), np.sqrt(GRAVITY_M_S2 / min(SHORTEST_ROD_M, longest))
    return float(GRAVITY_M_S2 / (slow + (fast - slow) * (run - 1) / (runs - 1)) ** 2)


def move(
    excitation: str, length_m: float, start_angle_rad: float, duration_s: float, rng: np.random.Generator
) -> Motion:
    """The rod's motion for `duration_s`, from rest; peak speed about sqrt(g l) theta0 (equation 16) in every kind."""
    count = round(duration_s / STEP_S) + 1
    angle, rate = np.zeros(count), np.zeros(count)
    speed_m_s = np.sqrt(GRAVITY_M_S2 * length_m) * start_angle_rad
    if excitation in ("swing", "lengths"):
        strength = 1.0 + HAND_SPREAD * rng.uniform(-1.0, 1.0)
        push_s = HAND_PUSH_S * min(1.0, np.sqrt(length_m)) * (1.0 + 2.0 * HAND_SPREAD * rng.uniform(-1.0, 1.0))
        peak = push_for(strength * start_angle_rad, push_s, length_m)
        swing(half_sine(count, REST_S, push_s, peak), length_m, DAMPING_1_S, angle, rate)
    elif excitation == "chirp":
        driven(_chirp(count, speed_m_s / length_m), SERVO_RAD_S, angle, rate)
    elif excitation == "steps":
        driven(_steps(count, speed_m_s / length_m, rng), SERVO_RAD_S, angle, rate)
    else:
        raise InputError(f"excitation {excitation!r}: unknown; known are {', '.join(EXCITATIONS)}")
    return Motion(np.linspace(0.0, (count - 1) * STEP_S, count), angle, rate)


def _chirp(count: int, rate_rad_s: float) -> Array:
    """Angle whose rate is a cosine of constant height, its frequency rising evenly over CHIRP_HZ after the rest."""
    t = np.arange(count) * STEP_S
    moving = np.clip(t - REST_S, 0.0, None)
    low, high = CHIRP_HZ
    phase = 2.0 * np.pi * (low * moving + 0.5 * (high - low) * moving**2 / max(t[-1] - REST_S, STEP_S))
    return np.asarray(np.cumsum(np.where(t > REST_S, rate_rad_s * np.cos(phase), 0.0)) * STEP_S)


def _steps(count: int, rate_rad_s: float, rng: np.random.Generator) -> Array:
    """Angle at constant rates, forth and back: each held for a random time, turned where the angle grows large."""
    wanted = np.zeros(count)
    k, angle, sign = round(REST_S / STEP_S), 0.0, 1.0
    while k < count:
        level = rate_rad_s * rng.choice([0.0, 0.5, 1.0])
        room_s = (LARGEST_ANGLE_RAD - sign * angle) / level if level > 0.0 else STEP_HOLD_S[1]
        hold = max(round(min(rng.uniform(*STEP_HOLD_S), room_s) / STEP_S), 1)
        steps = np.arange(1, min(hold, count - k) + 1)
        wanted[k : k + len(steps)] = angle + sign * level * STEP_S * steps
        k, angle = k + len(steps), wanted[k + len(steps) - 1]
        sign = -np.sign(angle) if abs(angle) > 0.5 * LARGEST_ANGLE_RAD else rng.choice([-1.0, 1.0])
    return wanted
