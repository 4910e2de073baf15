"""The model of a rotor that is learnt in hover (`learning`): what it leaves of one spectral line's command.

Pitch (roll is its mirror) is a rotor on a spring under a servo:

    q' = k a1,   a1' = f (S lon + p/Ω + B u - a1) - q,   u' = -g θ,   S = ω²/(s² + 2ζω s + ω²)

k: the moment of tilted disc per inertia (hub spring, thrust and the hub's height), f = 1/τ_f: the rate at which a disc
follows, which is also the rate that a cyclic gives in the end; ω: the servo's. Written for the command, with 1/S = D,

    D·{[(1/f - w²/(k f)) + jw/k - B g/w²] q - p/Ω} - lon = 0,

which is linear in what noise is in. (Mettler, Identification Modeling and Characteristics of Miniature Rotorcraft.)
"""

from typing import NamedTuple

from flownav.core.compile import equation, exp, larger
from flownav.core.frames import GRAVITY_M_S2

LEAST_ANSWERED = 0.01  # of an error, though it is far inside the slop: what is divided by


class NominalModel(NamedTuple):
    """Beliefs about the vehicle before learning: k, f and the servo's (see above); blowback: B [rad per m/s].

    slop_rad: the dead band of servo and linkage, and slop_std_rad how sure that is.

    begins: the epoch in which the stir begins; below 0: it never does.
    """

    pitch_stiffness_1_s2: float
    roll_stiffness_1_s2: float
    flap_rate_1_s: float
    servo_rad_s: float
    servo_damping: float
    slop_rad: float
    slop_std_rad: float
    per_rotor_speed_s: float
    blowback: float
    begins: int


class Residual(NamedTuple):
    """Residual of the model for a line's command [rad]; derivatives by ln k, ln f, the servo's ln ω, ln ζ, ln N."""

    re: float
    im: float
    k_re: float
    k_im: float
    f_re: float
    f_im: float
    w_re: float
    w_im: float
    z_re: float
    z_im: float
    n_re: float
    n_im: float


class Servo(NamedTuple):
    """Frequency, damping, and what share of an error the servo answers through its slop."""

    servo_rad_s: float
    damping: float
    answers: float


class Line(NamedTuple):
    """Fourier coefficients of a line: rate of its own axis and of the other one [rad/s], command [rad].

    other: of p for pitch, of -q for roll, whose cyclic is lat.
    """

    rate_re: float
    rate_im: float
    other_re: float
    other_im: float
    command_re: float
    command_im: float


@equation
def residual_of(line: Line, w: float, k: float, f: float, servo: Servo, nominal: NominalModel) -> Residual:
    """D·{[(1/f - w²/(k f)) + jw/k - B g/w²] q - p/Ω} - lon, D = 1 + (2ζ s/ω + s²/ω²)/N."""
    per_f, per_k, per_servo, per_answer = 1.0 / f, 1.0 / k, 1.0 / servo.servo_rad_s, 1.0 / servo.answers
    stiff, damped = w * w * per_k * per_f, w * per_k
    drift = nominal.blowback * GRAVITY_M_S2 / (w * w)
    held, late = w * w * per_servo * per_servo * per_answer, 2.0 * servo.damping * w * per_servo * per_answer
    d_re, d_im = 1.0 - held, late
    real = per_f - stiff - drift
    x_re = real * line.rate_re - damped * line.rate_im - nominal.per_rotor_speed_s * line.other_re
    x_im = real * line.rate_im + damped * line.rate_re - nominal.per_rotor_speed_s * line.other_im
    by_k_re, by_k_im = stiff * line.rate_re + damped * line.rate_im, stiff * line.rate_im - damped * line.rate_re
    by_f_re, by_f_im = (stiff - per_f) * line.rate_re, (stiff - per_f) * line.rate_im
    return Residual(
        d_re * x_re - d_im * x_im - line.command_re,
        d_re * x_im + d_im * x_re - line.command_im,
        d_re * by_k_re - d_im * by_k_im,
        d_re * by_k_im + d_im * by_k_re,
        d_re * by_f_re - d_im * by_f_im,
        d_re * by_f_im + d_im * by_f_re,
        2.0 * held * x_re + late * x_im,
        2.0 * held * x_im - late * x_re,
        -late * x_im,
        late * x_re,
        held * x_re + late * x_im,
        held * x_im - late * x_re,
    )


@equation
def error_function(x: float) -> float:
    """erf(x) of x >= 0 within 2e-7 (Abramowitz and Stegun 7.1.26)."""
    t = 1.0 / (1.0 + 0.3275911 * x)
    series = t * (0.254829592 + t * (-0.284496736 + t * (1.421413741 + t * (-1.453152027 + t * 1.061405429))))
    return 1.0 - series * exp(-x * x)


@equation
def answered(slop_rad: float, error_rad: float) -> float:
    """N: what share of a random error of this standard deviation a servo answers whose dead band is slop_rad.

    The random-input describing function of a dead zone (Gelb and Vander Velde, Multiple-Input Describing Functions).
    """
    return larger(1.0 - error_function(slop_rad / (1.4142135623730951 * error_rad + 1e-12)), LEAST_ANSWERED)
