"""The vehicle learnt in hover: a short stir of both cyclics, what the gyros make of it, and the gains that follow.

Both cyclics are stirred by sines of whole periods in STIR_S, each axis by its own (LINES), PERIODS times after a second
of settling, and as often again where gusts leave too much in doubt. Means over 20 ms of what was asked of the cyclics
and of what the gyros read, multiplied by each line's cosine and sine and summed, are Fourier coefficients of command
and rate: both are means over the same time, so that their ratio is the response, sampling and holding taken out (a stir
in straight lines has next to no images that would fold back), and what the loops answer is in the commands. Gusts are
not periodic.

The model is that of `learnt_model`. Slop of the servos is a share N of each error that they answer, of a random one as
large as the stir makes it (`answered`): it is not learnt, but as unsure as the file says. ln k of both axes, ln f, ln ω
and ln ζ are found by Gauss-Newton over all lines and periods (`solved`), from what the file says and no surer than it;
the scatter of the residuals says how sure they are.
(Klein and Morelli, Aircraft System Identification, 2nd ed., chapters 7 and 9: equation error in the frequency domain,
multisines.)

What follows for the gains is in `learnt_gains`. Where learning fails (broken off by the vehicle's leaving its place or
its tilt, too unsure, outside the table) the gains of the whole box stay.
"""

import math
from typing import NamedTuple

import numpy as np

from flownav.control.learnt_model import Line, NominalModel, Servo, answered, residual_of
from flownav.core.compile import Lanes, Work, equation, exp, procedure, replacing
from flownav.core.measurement import Array

EPOCH_S = 0.02
STIR_S, STIR_EPOCHS = 4.0, 200  # every line has whole periods in it
SETTLE_EPOCHS = 50
PERIODS = 3
MOST_PERIODS = 3 * PERIODS
# whole periods in STIR_S of each line: pitch's, roll's; between what gusts move (below 0.7 Hz) and where the servos end
PITCH_LINES, ROLL_LINES = (3, 5, 7, 11, 15), (4, 6, 8, 12, 16)
CYCLES = np.array([*PITCH_LINES, *ROLL_LINES], float)
AXIS = np.array([0] * len(PITCH_LINES) + [1] * len(ROLL_LINES))
LINES = len(CYCLES)
OMEGA_RAD_S = 2.0 * math.pi * CYCLES / STIR_S
# of cyclic, each line: chosen; 3 degrees of tilt together, several times the slop of the servos (control.md)
LINE_RAD = np.radians([0.20, 0.25, 0.30, 0.35, 0.40] * 2)
PHASES = np.array([math.pi * i * i / len(PITCH_LINES) for i in range(len(PITCH_LINES))] * 2)  # Schroeder: low peaks


def _turns() -> "np.ndarray[tuple[int, ...], np.dtype[np.float64]]":
    """Cosine and minus sine of each line at the middle of each epoch of a period, (STIR_EPOCHS, LINES, 2)."""
    angle = OMEGA_RAD_S * (np.arange(STIR_EPOCHS)[:, None] + 0.5) * EPOCH_S
    return np.ascontiguousarray(np.stack([np.cos(angle), -np.sin(angle)], axis=2))


TURNS = _turns()
# what is added to lon and lat at the beginning of each epoch of a period [rad], (STIR_EPOCHS, 2); straight in between
STIR = np.ascontiguousarray(
    [
        (LINE_RAD * np.cos(OMEGA_RAD_S * n * EPOCH_S + PHASES)) @ np.stack([AXIS == 0, AXIS == 1], axis=1)
        for n in range(STIR_EPOCHS)
    ]
)
SUMS = 6  # of a line in a period: own rate, the other axis' rate, command; real and imaginary parts
SPECTRA = MOST_PERIODS * LINES * SUMS  # rows of all
UNKNOWN = 6  # ln k of pitch and roll, ln f, ln of the servo's frequency, damping and answer, from the beliefs before
OWN = 5  # of which an axis has: its k and the other four
SCRATCH = UNKNOWN * UNKNOWN + 2 * UNKNOWN
ITERATIONS = 5
TRIES = 3
AGAIN_EPOCHS = 100  # after which a stir that was broken off begins anew
LONGEST_EPOCHS = 3000  # after which it is given up: a landing waits for it no longer
LOWEST_M = 1.0  # of the skids over a ground that is known: no stir below
PRIOR = (0.45, 0.45, 0.25, 0.25, 0.07)  # standard deviations of the unknown: wider than the box of the shipped sheet


def line_weights(w_rad_s: Array) -> Array:
    """Weights of lines' residuals (n,): gusts leave the more the slower they are (their spectrum falls as 1/w²)."""
    return np.clip(w_rad_s / 12.0, 0.4, 1.2)


WEIGHTS = line_weights(OMEGA_RAD_S)
FIRST_RESIDUAL_RAD = 3e-5  # standard deviation of a residual before any is known: a gust's of 4 m/s
STEEPEST = 0.26  # sine of the tilt beyond the commanded one at which the stir is broken off: 15 degrees


class Stir(NamedTuple):
    """The stir added to the cyclics [rad], by how much it grows with each step of the attitude loop, and the mean
    command to them in this epoch, with the stir.
    """

    lon: float
    lat: float
    lon_step: float
    lat_step: float
    asked_lon: float
    asked_lat: float


class Learnt(NamedTuple):
    """Result of learning: state 0 nothing yet, 1 learnt, -1 too unsure, -2 broken off, -3 outside the table.

    Numbers as in `Told`; std: standard deviations of their logarithms; lag: 1/f and the servo's 2ζ/ω together.
    """

    state: float
    since: float  # epochs of this stir; below 0: until it begins anew
    tries: float  # that failed
    pitch_stiffness_1_s2: float
    roll_stiffness_1_s2: float
    flap_rate_1_s: float
    servo_rad_s: float
    lag_s: float
    std_pitch_stiffness: float
    std_roll_stiffness: float
    std_flap_rate: float
    std_servo: float
    std_lag: float
    residual_rad: float


VERDICTS = {0: "not finished", 1: "learnt", -1: "too unsure", -2: "broken off", -3: "outside the table"}
with_course = replacing(Learnt, "state", "since", "tries")


@procedure
def note_line(
    work: Work, lanes: Lanes, row: int, since: int, rates: tuple[float, float], lane: int, stir: Stir
) -> None:
    """One epoch, the `since`-th after settling, into every line's sums. row: the first of SPECTRA."""
    turn = since % STIR_EPOCHS
    share = 2.0 / STIR_EPOCHS
    p, q = rates
    for line in range(LINES):
        pitch = AXIS[line] == 0
        c, s = share * TURNS[turn, line, 0], share * TURNS[turn, line, 1]
        own, other, command = (q, p, stir.asked_lon) if pitch else (p, -q, stir.asked_lat)
        at = (row + ((since // STIR_EPOCHS) * LINES + line) * SUMS) * len(lanes) + lane
        work[at] += c * own
        work[at + len(lanes)] += s * own
        work[at + 2 * len(lanes)] += c * other
        work[at + 3 * len(lanes)] += s * other
        work[at + 4 * len(lanes)] += c * command
        work[at + 5 * len(lanes)] += s * command


@equation
def line_at(work: Work, lanes: Lanes, row: int, period: int, line: int, lane: int) -> Line:
    """A line's sums over one period."""
    at, apart = (row + (period * LINES + line) * SUMS) * len(lanes) + lane, len(lanes)
    return Line(
        work[at], work[at + apart], work[at + 2 * apart], work[at + 3 * apart], work[at + 4 * apart],
        work[at + 5 * apart],
    )  # fmt: skip


@procedure
def servo_error(work: Work, lanes: Lanes, row: int, lane: int, axis: int, nominal: NominalModel, periods: int) -> float:
    """Standard deviation of the angle by which an axis' servos are behind their command, by their stated model
    [rad].
    """
    answers, power = 1.0, 0.0
    for _ in range(2):
        power = 0.0
        for line in range(LINES):
            if AXIS[line] == axis:
                w = OMEGA_RAD_S[line] / nominal.servo_rad_s
                lag = 2.0 * nominal.servo_damping * w
                behind = (w * w * w * w + lag * lag) / ((answers - w * w) * (answers - w * w) + lag * lag)
                for period in range(periods):
                    asked = line_at(work, lanes, row, period, line, lane)
                    size = asked.command_re * asked.command_re + asked.command_im * asked.command_im
                    power += 0.5 * size * behind / periods
        answers = answered(nominal.slop_rad, np.sqrt(power))
    behind_rad: float = np.sqrt(power)
    return behind_rad


@procedure
def solved(work: Work, lanes: Lanes, row: int, scratch: int, lane: int, nominal: NominalModel, periods: int) -> Learnt:
    """Gauss-Newton estimate from the sums of the periods, with the beliefs in `told` as prior. scratch: rows to work
    in.
    """
    apart = len(lanes)
    normal = scratch * apart + lane
    slope, x = normal + UNKNOWN * UNKNOWN * apart, normal + (UNKNOWN + 1) * UNKNOWN * apart
    behind_lon = servo_error(work, lanes, row, lane, 0, nominal, periods)
    behind_lat = servo_error(work, lanes, row, lane, 1, nominal, periods)
    behind = behind_lon, behind_lat
    less = answered(nominal.slop_rad + nominal.slop_std_rad, 0.5 * (behind[0] + behind[1]))
    unsure = 1.0 - less / answered(nominal.slop_rad, 0.5 * (behind[0] + behind[1])) + 1e-6
    for i in range(UNKNOWN):
        work[x + i * apart] = 0.0
    variance = FIRST_RESIDUAL_RAD * FIRST_RESIDUAL_RAD
    for _ in range(ITERATIONS):
        for i in range(UNKNOWN):
            prior = PRIOR[i] if i < UNKNOWN - 1 else unsure
            before = variance / (prior * prior)
            work[slope + i * apart] = before * work[x + i * apart]
            for k in range(UNKNOWN):
                work[normal + (UNKNOWN * i + k) * apart] = before if i == k else 0.0
        scatter, misfit = 0.0, 0.0
        for line in range(LINES):
            axis = AXIS[line]
            nominal_k = nominal.pitch_stiffness_1_s2 if axis == 0 else nominal.roll_stiffness_1_s2
            stiff, flap = nominal_k * exp(work[x + axis * apart]), nominal.flap_rate_1_s * exp(work[x + 2 * apart])
            servo = Servo(
                nominal.servo_rad_s * exp(work[x + 3 * apart]), nominal.servo_damping * exp(work[x + 4 * apart]),
                answered(nominal.slop_rad, behind[0] if axis == 0 else behind[1]) * exp(work[x + 5 * apart]),
            )  # fmt: skip
            mean_re, mean_im = 0.0, 0.0
            for period in range(periods):
                line_seen = line_at(work, lanes, row, period, line, lane)
                r = residual_of(line_seen, OMEGA_RAD_S[line], stiff, flap, servo, nominal)
                weight = WEIGHTS[line] * WEIGHTS[line]
                mean_re, mean_im = mean_re + WEIGHTS[line] * r.re, mean_im + WEIGHTS[line] * r.im
                scatter += weight * (r.re * r.re + r.im * r.im)
                re, im = (r.k_re, r.f_re, r.w_re, r.z_re, r.n_re), (r.k_im, r.f_im, r.w_im, r.z_im, r.n_im)
                for a in range(OWN):
                    i = axis if a == 0 else a + 1
                    work[slope + i * apart] += weight * (re[a] * r.re + im[a] * r.im)
                    for b in range(OWN):
                        k = axis if b == 0 else b + 1
                        work[normal + (UNKNOWN * i + k) * apart] += weight * (re[a] * re[b] + im[a] * im[b])
            misfit += (mean_re * mean_re + mean_im * mean_im) / periods
        scatter, misfit = scatter / (2 * periods * LINES - UNKNOWN), misfit / (2 * LINES - UNKNOWN)
        variance = scatter if scatter > misfit else misfit
        invert(work, normal, apart)
        for i in range(UNKNOWN):
            step = 0.0
            for k in range(UNKNOWN):
                step += work[normal + (UNKNOWN * i + k) * apart] * work[slope + k * apart]
            work[x + i * apart] -= step
    return learnt_of(work, normal, x, apart, variance, nominal)


@procedure
def learnt_of(work: Work, normal: int, x: int, apart: int, variance: float, nominal: NominalModel) -> Learnt:
    """The solution in words; normal: the first of the inverse normal equations, x: of the unknown."""
    flap, servo = nominal.flap_rate_1_s * exp(work[x + 2 * apart]), nominal.servo_rad_s * exp(work[x + 3 * apart])
    by_flap = 1.0 / flap
    by_servo = 2.0 * nominal.servo_damping * exp(work[x + 4 * apart]) / servo
    lag = by_flap + by_servo
    slopes = (0.0, 0.0, -by_flap / lag, -by_servo / lag, by_servo / lag, 0.0)
    spread = 0.0
    for i in range(UNKNOWN):
        for k in range(UNKNOWN):
            spread += slopes[i] * slopes[k] * work[normal + (UNKNOWN * i + k) * apart]
    return Learnt(
        0.0,
        0.0,
        0.0,
        nominal.pitch_stiffness_1_s2 * exp(work[x]),
        nominal.roll_stiffness_1_s2 * exp(work[x + apart]),
        flap,
        servo,
        lag,
        np.sqrt(variance * work[normal]),
        np.sqrt(variance * work[normal + (UNKNOWN + 1) * apart]),
        np.sqrt(variance * work[normal + 2 * (UNKNOWN + 1) * apart]),
        np.sqrt(variance * work[normal + 3 * (UNKNOWN + 1) * apart]),
        np.sqrt(variance * spread),
        np.sqrt(variance),
    )


@procedure
def invert(work: Work, first: int, apart: int) -> None:
    """A symmetric positive matrix of UNKNOWN rows by its inverse (Gauss and Jordan, no pivots needed)."""
    for i in range(UNKNOWN):
        pivot = 1.0 / work[first + (UNKNOWN * i + i) * apart]
        work[first + (UNKNOWN * i + i) * apart] = 1.0
        for k in range(UNKNOWN):
            work[first + (UNKNOWN * i + k) * apart] *= pivot
        for other in range(UNKNOWN):
            if other != i:
                factor = work[first + (UNKNOWN * other + i) * apart]
                work[first + (UNKNOWN * other + i) * apart] = 0.0
                for k in range(UNKNOWN):
                    work[first + (UNKNOWN * other + k) * apart] -= factor * work[first + (UNKNOWN * i + k) * apart]
