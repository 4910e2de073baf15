"""A rotor's vibration taken off the specific force: notches about the tone of its speed and that of its blades.

A tone at f integrates to a velocity that swings by A/(2 pi f): 1.5 m/s2 at 24 Hz are 10 mm/s, more than a flow sensor
errs by near the ground, and the same error at each reading. A notch is a phasor that turns with the tone and is drawn
towards what is read (an all-pass in a loop: Regalia, Mitra, Vaidyanathan, Proc. IEEE 76, 1988); a steady force passes
whole. Where the phasor is drawn backwards turn after turn, the rotor turns slower than stated: its speed is followed (a
phase-locked loop: Gardner, Phaselock Techniques, 3rd ed., chapter 2).

The rest shows how noisy the unit is in this vehicle, which datasheets do not state (0.16 to 0.24 m/s2 above 5 Hz in
real flights, where the shipped sheet leaves 0.01: docs/explanation/validation.md).
"""

import math
from typing import NamedTuple

from flownav.core.compile import clamp, cos, equation, exp, sin
from flownav.core.frames import turned_level, within_half_turn
from flownav.navigation.kernel_settings import ImuSettings
from flownav.navigation.motion_records import ToneMemory
from flownav.navigation.vibration import FOLLOWING_S

LEAST_NOTCH_HZ = 8.0  # chosen: a notch below would take the vehicle's own motion
WIDTH = 6.0  # f over the width at -3 dB; chosen: 2 and 4 take more of a touchdown's jolt (test_notch)
SPEED_S = 1.0  # chosen: the rotor's speed is found in seconds, and a governor moves it slower
MOST_OFF = 0.1  # chosen: a tone further off is another rotor's
LEAST_TONE_M_S2 = 0.1  # chosen: a weaker tone determines no speed
STEADY_S = 0.03  # chosen: 0.3 takes a sway of 1 m/s2 at 1 Hz for noise, three times too much (test_notch)
Force = tuple[float, float, float]  # specific force [m/s2], body FRD


class Turn(NamedTuple):
    """How far a tone turns in a step, how much of what is read draws its phasor, and how much of the phasor stays."""

    cosine: float
    sine: float
    share: float
    kept: float


class Tone(NamedTuple):
    """A phasor: the tone at hand, and that a quarter turn away."""

    real: float
    across: float


class Freed(NamedTuple):
    """The part that the notches take off a value, and the phasors after it; how far each tone is ahead of its phasor,
    times the phasor's square.
    """

    taken: float
    rotor: Tone
    blades: Tone
    rotor_ahead: float
    blades_ahead: float


@equation
def is_notched(s: ImuSettings) -> bool:
    """Whether the settings state a tone's frequency."""
    return s.notch_rotor_hz > 0.0 or s.notch_blades_hz > 0.0


@equation
def read_angle(tone_hz: float, dt_s: float) -> float:
    """How far a tone seems to turn between readings so far apart [rad], up to half a turn: it is read at its alias."""
    return abs(within_half_turn(2.0 * math.pi * tone_hz * dt_s))


@equation
def turn_of(tone_hz: float, dt_s: float) -> Turn:
    """A tone of 0 Hz is none: it takes nothing.

    Nor does one that readings so far apart show below LEAST_NOTCH_HZ, as a line of 50 readings a second shows 48 Hz at
    2 Hz: it is the vehicle's own motion, and at 0 Hz gravity. Its phasor turns on over a lost reading, and fades.
    """
    angle = 2.0 * math.pi * tone_hz * dt_s
    seen_angle = read_angle(tone_hz, dt_s)
    drawn = seen_angle >= 2.0 * math.pi * LEAST_NOTCH_HZ * dt_s
    share = 1.0 - exp(-seen_angle / WIDTH)
    return Turn(cos(angle), sin(angle), share if drawn else 0.0, 1.0 if drawn else SPEED_S / (SPEED_S + dt_s))


@equation
def turned(tone: Tone, by: Turn) -> Tone:
    """A phasor a step later."""
    real, across = turned_level(by.kept * tone.real, by.kept * tone.across, by.cosine, by.sine)
    return Tone(real, across)


@equation
def freed(value: float, rotor: Tone, blades: Tone, turn: Turn, blades_turn: Turn) -> Freed:
    """One axis. What neither tone explains draws both phasors; half of that draught is taken besides, so that a steady
    value, at which a turning phasor answers by -1/2, passes whole.
    """
    r, b = turned(rotor, turn), turned(blades, blades_turn)
    left = value - r.real - b.real
    drawn, drawn_b = turn.share * left, blades_turn.share * left
    return Freed(
        r.real + b.real + 0.5 * (drawn + drawn_b), Tone(r.real + drawn, r.across), Tone(b.real + drawn_b, b.across),
        -drawn * r.across, -drawn_b * b.across,
    )  # fmt: skip


@equation
def followed_hz(tone_hz: float, off_hz: float, ahead: float, square: float) -> float:
    """The amount by which a tone is faster than stated [Hz]. ahead, square: of its phasors, over the axes.

    A tone that is faster by d runs 2 pi d dt ahead in each step, and its phasors are drawn forwards by as much.
    """
    ahead_rad = ahead / (square + LEAST_TONE_M_S2 * LEAST_TONE_M_S2)
    return clamp(off_hz + ahead_rad / (2.0 * math.pi * SPEED_S), -MOST_OFF * tone_hz, MOST_OFF * tone_hz)


@equation
def followed_density(power: float, change: float, before: float, dt_s: float) -> float:
    """The power density of white noise [m2/s3] by how changes between readings change: that has six times its variance,
    and little of the vehicle's motion.
    """
    bend = change - before
    return power + dt_s / (FOLLOWING_S + dt_s) * (bend * bend * dt_s / 6.0 - power)


@equation
def tracked_tones(force: Force, before: Force, m: ToneMemory, dt_s: float, s: ImuSettings) -> ToneMemory:
    """Both tones in the specific force (body FRD) of a reading, dt_s after the one before.

    before: what was left of the reading before. What is steady is no tone's, and would pull the frequencies. Of white
    noise the notches leave in its changes what they leave of an unsteady value at once. Frequencies and noise are read
    off the level axes: along the third the thrust itself is unsteady (`pad_return`: 0.02 m/s2/sqrt(Hz) at 20 Hz, and
    0.001 level).
    """
    turn, blades = turn_of(s.notch_rotor_hz + m.rotor_off_hz, dt_s), turn_of(s.notch_blades_hz + m.blades_off_hz, dt_s)
    steady = dt_s / (STEADY_S + dt_s)
    mean_x = m.mean_x + steady * (before[0] - m.mean_x)
    mean_y = m.mean_y + steady * (before[1] - m.mean_y)
    mean_z = m.mean_z + steady * (before[2] - m.mean_z)
    x = freed(force[0] - mean_x, Tone(m.rotor_x, m.rotor_x_across), Tone(m.blades_x, m.blades_x_across), turn, blades)
    y = freed(force[1] - mean_y, Tone(m.rotor_y, m.rotor_y_across), Tone(m.blades_y, m.blades_y_across), turn, blades)
    z = freed(force[2] - mean_z, Tone(m.rotor_z, m.rotor_z_across), Tone(m.blades_z, m.blades_z_across), turn, blades)
    per_left = 1.0 / (1.0 - 0.5 * (turn.share + blades.share))
    change_x = per_left * (force[0] - x.taken - before[0])
    change_y = per_left * (force[1] - y.taken - before[1])
    level = followed_density(m.noise_power, change_x, m.change_x, dt_s)
    return ToneMemory(
        x.rotor.real, x.rotor.across, y.rotor.real, y.rotor.across, z.rotor.real, z.rotor.across,
        x.blades.real, x.blades.across, y.blades.real, y.blades.across, z.blades.real, z.blades.across,
        x.taken, y.taken, z.taken,
        followed_hz(s.notch_rotor_hz, m.rotor_off_hz, x.rotor_ahead + y.rotor_ahead, square(x.rotor) + square(y.rotor)),
        followed_hz(
            s.notch_blades_hz, m.blades_off_hz, x.blades_ahead + y.blades_ahead, square(x.blades) + square(y.blades)
        ),
        followed_density(level, change_y, m.change_y, dt_s), change_x, change_y,
        mean_x, mean_y, mean_z,
    )  # fmt: skip


@equation
def square(tone: Tone) -> float:
    """The square of a phasor."""
    return tone.real * tone.real + tone.across * tone.across
