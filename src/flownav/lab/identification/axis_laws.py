"""The laws that a vehicle's commands and rates obey in hover: what they leave of a command, and its derivatives.

A helicopter's is that of the vehicle learnt in hover (`control.learnt_model`), with one number more for a log whose
commands are not the blades' own angles: how much cyclic a command of one is. A multirotor's is a body that its motors
turn late,

    q' = E m - d q,   m' = (u - m)/τ,

E the angular acceleration by command, d the damping, τ the motors' lag, written for the command as the helicopter's is:
(jw + d)(1 + jw τ) q/E - u = 0, linear in what noise is in.
"""

from typing import Any, NamedTuple

import numpy as np

from flownav.control.learnt_model import Line, NominalModel, Servo, answered, residual_of
from flownav.core.measurement import Array
from flownav.lab.identification.excited import Complex

ROTOR = ("pitch_stiffness_1_s2", "roll_stiffness_1_s2", "flap_rate_1_s", "servo_rad_s", "servo_damping")
BODY_DAMPING_1_S = 1.0  # the size in which a multirotor's damping is sought; it may be of either sign


class Left(NamedTuple):
    """The rest that a law leaves of the commands (m,) and its derivatives by the unknown (m, n)."""

    rest: Complex
    slopes: Complex


class AxisResponse(NamedTuple):
    """One axis' lines (m,): own rate, the rate about the other axis as the rotor's law takes it, and command."""

    w_rad_s: Array
    own: Complex
    other: Complex
    command: Complex


def rotor_left(seen: AxisResponse, x: Array, pitch: bool, answers: float, nominal: NominalModel) -> Left:
    """The rotor's rest at x: logarithms of ROTOR over their stated values, of the answer N of the servos,
    and of the cyclic by a command in pitch and in roll; then by how much the commands' stamps are late [s].
    """
    k = (nominal.pitch_stiffness_1_s2 if pitch else nominal.roll_stiffness_1_s2) * np.exp(x[0 if pitch else 1])
    servo = Servo(nominal.servo_rad_s * np.exp(x[3]), nominal.servo_damping * np.exp(x[4]), answers * np.exp(x[5]))
    cyclic = seen.command * np.exp(x[6 if pitch else 7] + 1j * seen.w_rad_s * x[8])
    parts: tuple[Any, ...] = (
        seen.own.real, seen.own.imag, seen.other.real, seen.other.imag, cyclic.real, cyclic.imag
    )  # fmt: skip
    w: Any = seen.w_rad_s  # the law is one line's; arithmetic alone, it takes all lines at once
    found: Any = residual_of(Line(*parts), w, k, nominal.flap_rate_1_s * np.exp(x[2]), servo, nominal)
    slopes = np.zeros((len(seen.own), 9), complex)
    slopes[:, 0 if pitch else 1] = found.k_re + 1j * found.k_im
    slopes[:, 2] = found.f_re + 1j * found.f_im
    slopes[:, 3] = found.w_re + 1j * found.w_im
    slopes[:, 4] = found.z_re + 1j * found.z_im
    slopes[:, 5] = found.n_re + 1j * found.n_im
    slopes[:, 6 if pitch else 7] = -cyclic
    slopes[:, 8] = -1j * seen.w_rad_s * cyclic
    return Left(found.re + 1j * found.im, slopes)


def body_left(seen: AxisResponse, x: Array, stated: tuple[float, float]) -> Left:
    """The multirotor's rest at x: logarithms of E and τ over their stated values, and d/BODY_DAMPING_1_S."""
    s = 1j * seen.w_rad_s
    effect, lag = stated[0] * np.exp(x[0]), stated[1] * np.exp(x[1])
    damped, late = s + BODY_DAMPING_1_S * x[2], 1.0 + s * lag
    needed = damped * late * seen.own / effect
    slopes = np.column_stack(
        [-needed, damped * s * lag * seen.own / effect, BODY_DAMPING_1_S * late * seen.own / effect]
    )
    return Left(needed - seen.command, slopes)


def servo_answer(command: Array, step_s: float, nominal: NominalModel, slop_rad: float) -> float:
    """N, the share of an error that a servo answers through its slop, for a command (n,) sampled every step_s [rad]."""
    s = 2j * np.pi * np.fft.rfftfreq(len(command), step_s) / nominal.servo_rad_s
    moved, answers = np.fft.rfft(command - command.mean()), 1.0
    for _ in range(3):
        held = s * s + 2.0 * nominal.servo_damping * s
        behind = np.fft.irfft(moved * held / (answers + held), len(command))
        answers = float(answered(slop_rad, float(np.std(behind))))
    return answers
