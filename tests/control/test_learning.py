"""The vehicle learnt in hover: its stir, what spectra show of a vehicle that SciPy moves, its gains and margins."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.special import erf
from scipy.stats import binomtest

from flownav.control import learning
from flownav.control.design import gains_for, nominal_model
from flownav.control.learning import (
    AXIS,
    EPOCH_S,
    PERIODS,
    SCRATCH,
    SPECTRA,
    STIR,
    STIR_EPOCHS,
    Learnt,
    Stir,
    note_line,
    solved,
)
from flownav.control.learnt_gains import BEYOND, LEAST_SURE, LoopGains, gains_with, judged, loop_gains_of, shaped
from flownav.control.learnt_margins import margins_of_learnt
from flownav.control.learnt_model import Line, Servo, answered, error_function, residual_of
from flownav.control.learnt_shapes import (
    LAG_NODES,
    PITCH_NODES,
    PITCH_SHAPES,
    POSITION_1_S,
    ROLL_NODES,
    ROLL_SHAPES,
)
from flownav.control.margins import LEAST_GAIN_DB, LEAST_PHASE_DEG
from flownav.core.compile import ONE_LANE
from flownav.core.frames import GRAVITY_M_S2
from flownav.vehicle.kinds import load_vehicle
from flownav.vehicle.trim import trim

VEHICLE = load_vehicle()
HOVER = trim(VEHICLE)
TOLD = nominal_model(VEHICLE, HOVER, 0)
GAINS = gains_for(VEHICLE, HOVER, 0.0)
SUB = 5  # the attitude loop's steps in an epoch


# -- the stir -----------------------------------------------------------------------------------------------------
def test_the_stir_is_small_without_a_mean_and_each_axis_has_lines_of_its_own():
    assert STIR.shape == (STIR_EPOCHS, 2)
    assert abs(STIR.mean(axis=0)).max() < 1e-12
    assert np.degrees(abs(STIR).max()) < 1.4  # of cyclic: a fifth of its limit
    spectrum = np.abs(np.fft.rfft(STIR, axis=0)) / (0.5 * STIR_EPOCHS)
    for axis in (0, 1):
        lines = np.flatnonzero(spectrum[:, axis] > 1e-9)
        assert list(lines) == sorted(learning.CYCLES[axis == AXIS])
        assert spectrum[lines, axis] == pytest.approx(learning.LINE_RAD[axis == AXIS])


# -- the model ----------------------------------------------------------------------------------------------------
def truth_of(rng):
    """A vehicle drawn about the stated values with the prior's width: k of pitch and roll, f, the servo's frequency
    and damping.
    """
    return np.exp(np.array([0.25, 0.25, 0.15, 0.15, 0.05]) * rng.standard_normal(5))


def told_times(shares):
    """The stated parameters times these shares."""
    pitch, roll, flap, servo, damping = shares
    return TOLD._replace(
        pitch_stiffness_1_s2=TOLD.pitch_stiffness_1_s2 * pitch,
        roll_stiffness_1_s2=TOLD.roll_stiffness_1_s2 * roll,
        flap_rate_1_s=TOLD.flap_rate_1_s * flap,
        servo_rad_s=TOLD.servo_rad_s * servo,
        servo_damping=TOLD.servo_damping * damping,
    )


def rotor_on_a_spring(true):
    """dx/dt = A x + B (lon, lat) of both axes, x: q, a1, servo, its rate, nothing; p, b1, ...: written out anew."""
    a, b = np.zeros((10, 10)), np.zeros((10, 2))
    for axis, k in enumerate((true.pitch_stiffness_1_s2, true.roll_stiffness_1_s2)):
        i, other, sign = 5 * axis, 5 * (1 - axis), 1.0 if axis == 0 else -1.0
        a[i, i + 1] = k
        a[i + 1, i] = -1.0
        a[i + 1, i + 1] = -true.flap_rate_1_s
        a[i + 1, i + 2] = true.flap_rate_1_s
        a[i + 1, other] = sign * true.flap_rate_1_s * true.per_rotor_speed_s
        a[i + 2, i + 3] = 1.0
        a[i + 3, i + 2], a[i + 3, i + 3] = -(true.servo_rad_s**2), -2.0 * true.servo_damping * true.servo_rad_s
        b[i + 3, axis] = true.servo_rad_s**2
    return a, b


def flown_in_hover(true, rng, gust_rad_s2):
    """Sums of a stir of a vehicle with weak loops round it, SciPy's matrix exponential for its motion.

    gust_rad_s2: standard deviation of the angular acceleration of gusts, a Markov process of 0.5 s.
    """
    a, b = rotor_on_a_spring(true)
    step = EPOCH_S / SUB
    blown = np.zeros((10, 2))
    blown[0, 0] = blown[5, 1] = 1.0
    b = np.hstack([b, blown])
    whole = expm(np.block([[a, b, np.zeros((10, 10))], [np.zeros((4, 24))], [np.eye(10), np.zeros((10, 14))]]) * step)
    map_x, map_u = whole[:10, :10], whole[:10, 10:14]
    sum_x, sum_u = whole[14:, :10], whole[14:, 10:14]
    x, turned, gust, stays = np.zeros(10), np.zeros(2), np.zeros(2), math.exp(-step / 0.5)
    work = np.zeros(SPECTRA + SCRATCH)
    for epoch in range(-5 * STIR_EPOCHS, PERIODS * STIR_EPOCHS):
        begins, ends = STIR[epoch % STIR_EPOCHS], STIR[(epoch + 1) % STIR_EPOCHS]
        asked, rates = np.zeros(2), np.zeros(2)
        for part in range(SUB):
            stir = begins + (part + 0.5) / SUB * (ends - begins)
            gust = stays * gust + gust_rad_s2 * math.sqrt(1.0 - stays**2) * rng.standard_normal(2)
            u = np.concatenate([stir - 0.02 * x[[0, 5]] - 0.10 * turned, gust])
            mean = (sum_x @ x + sum_u @ u) / step
            x = map_x @ x + map_u @ u
            turned = turned + step * mean[[0, 5]]
            asked, rates = asked + u[:2] / SUB, rates + mean[[0, 5]] / SUB
        q, p = rates
        if epoch >= 0:
            note_line(work, ONE_LANE, 0, epoch, (p, q), 0, Stir(0.0, 0.0, 0.0, 0.0, *asked))
    return work


def numbers(told):
    return np.array([told.pitch_stiffness_1_s2, told.roll_stiffness_1_s2, told.flap_rate_1_s, told.servo_rad_s])


def lag_of(told):
    return 1.0 / told.flap_rate_1_s + 2.0 * told.servo_damping / told.servo_rad_s


SURE = TOLD._replace(slop_rad=0.0, slop_std_rad=0.0, blowback=0.0)


def test_the_model_leaves_nothing_of_a_vehicle_that_is_it():
    w, k, f, servo = 7.0, 300.0, 25.0, Servo(40.0, 0.7, 0.8)
    s = 1j * w
    x = s / servo.servo_rad_s
    answer = servo.answers / (servo.answers + 2.0 * servo.damping * x + x * x)
    p, q = 0.02 - 0.01j, 0.3 + 0.1j
    u = -GRAVITY_M_S2 / s * (q / s)  # u' = -g theta, theta' = q
    a1 = s * q / k
    lon = ((s * a1 + q) / f - p * TOLD.per_rotor_speed_s - TOLD.blowback * u + a1) / answer
    line = Line(q.real, q.imag, p.real, p.imag, lon.real, lon.imag)
    left = residual_of(line, w, k, f, servo, TOLD)
    assert abs(complex(left.re, left.im)) < 1e-12


def test_its_derivatives_are_those_of_a_complex_step():
    rng = np.random.default_rng(3)
    line = Line(*rng.standard_normal(6))
    at, h = (300.0, 25.0, 40.0, 0.7, 0.8), 1e-30

    def left(logarithms):
        k, f, w, z, n = (v * np.exp(x) for v, x in zip(at, logarithms, strict=True))
        found = residual_of(line, 9.0, k, f, Servo(w, z, n), TOLD)
        return np.array([found.re, found.im])

    told = residual_of(line, 9.0, at[0], at[1], Servo(*at[2:]), TOLD)[2:]
    for i in range(5):
        step = np.zeros(5, complex)
        step[i] = 1j * h
        assert left(step).imag / h == pytest.approx(told[2 * i : 2 * i + 2], rel=1e-9)


def test_the_error_function_is_scipys_and_slop_answers_less_of_a_small_error():
    x = np.linspace(0.0, 5.0, 101)
    assert max(abs(error_function(float(one)) - erf(one)) for one in x) < 2e-7
    rng = np.random.default_rng(5)
    error = 0.01 * rng.standard_normal(400_000)
    for slop in (0.0, 0.002, 0.01):
        left = np.sign(error) * np.maximum(np.abs(error) - slop, 0.0)  # what comes through a dead band
        assert answered(slop, 0.01) == pytest.approx(float((left * error).mean() / (error * error).mean()), abs=0.005)


def test_a_vehicle_that_is_the_model_is_learnt_as_it_is():
    rng = np.random.default_rng(1)
    for _ in range(4):
        true = told_times(truth_of(rng))._replace(slop_rad=0.0, slop_std_rad=0.0, blowback=0.0)
        learnt = solved(flown_in_hover(true, rng, 0.05), ONE_LANE, 0, SPECTRA, 0, SURE, PERIODS)
        found = np.array(learnt[3:7])
        assert np.log(found / numbers(true)) == pytest.approx(np.zeros(4), abs=0.03)
        assert learnt.lag_s == pytest.approx(lag_of(true), rel=0.02)


def test_its_intervals_hold_what_they_say():
    """95 % intervals of 60 vehicles in gusts, against what a binomial draw leaves."""
    rng, inside, count = np.random.default_rng(7), np.zeros(5), 60
    for _ in range(count):
        true = told_times(truth_of(rng))._replace(slop_rad=0.0, slop_std_rad=0.0, blowback=0.0)
        learnt = solved(flown_in_hover(true, rng, 0.3), ONE_LANE, 0, SPECTRA, 0, SURE, PERIODS)
        off = np.log(np.array(learnt[3:8]) / np.append(numbers(true), lag_of(true)))
        inside += np.abs(off) < 1.96 * np.array(learnt[8:13])
        assert learnt.residual_rad > 0.0
    for held in inside:
        assert binomtest(int(held), count, 0.95, alternative="less").pvalue > 0.005


def test_a_vehicle_that_says_nothing_is_not_learnt():
    silent = np.random.default_rng(2).normal(0.0, 1e-4, SPECTRA + SCRATCH)
    learnt = solved(silent, ONE_LANE, 0, SPECTRA, 0, TOLD, PERIODS)
    assert learnt.std_pitch_stiffness > LEAST_SURE
    assert judged(learnt).state == -1.0


# -- the verdict, the gains ---------------------------------------------------------------------------------------
def learnt_as(pitch=300.0, roll=720.0, lag_s=0.056, std=0.02, state=1.0):
    return Learnt(
        state,
        0.0,
        0.0,
        pitch,
        roll,
        TOLD.flap_rate_1_s * lag_of(TOLD) / lag_s,
        TOLD.servo_rad_s,
        lag_s,
        std,
        std,
        std,
        std,
        std,
        1e-4,
    )


def test_too_unsure_or_outside_the_table_is_no_vehicle_to_shape_gains_for():
    assert judged(learnt_as()).state == 1.0
    assert judged(learnt_as(std=1.01 * LEAST_SURE)).state == -1.0
    last = float(np.exp(PITCH_NODES[-1] + BEYOND))
    assert judged(learnt_as(pitch=0.99 * last)).state == 1.0
    assert judged(learnt_as(pitch=1.01 * last)).state == -3.0
    assert judged(learnt_as(roll=0.99 * float(np.exp(ROLL_NODES[0] - BEYOND)))).state == -3.0
    assert judged(learnt_as(lag_s=0.1)).state == -3.0
    before = loop_gains_of(GAINS)
    for state in (0.0, -1.0, -2.0, -3.0):
        assert shaped(before, learnt_as(state=state)) == before


def test_gains_are_those_of_the_table_at_its_nodes_and_between_them_in_between():
    for i, pitch in enumerate(np.exp(PITCH_NODES)):
        for m, lag in enumerate(np.exp(LAG_NODES)):
            found = shaped(loop_gains_of(GAINS), learnt_as(pitch=float(pitch), lag_s=float(lag)))
            tilt, integral, lead, velocity, distance, gust = np.exp(PITCH_SHAPES[i, m])
            assert found.pitch_gain == pytest.approx(tilt * lag / (TOLD.flap_rate_1_s * lag_of(TOLD)))
            assert found.pitch_integral == pytest.approx(found.pitch_gain * integral)
            assert found.pitch_damping == pytest.approx(found.pitch_gain * lead)
            assert found[:2] == pytest.approx((POSITION_1_S, velocity))
            assert found.forward_integral == pytest.approx(distance)
            assert found.gust_decay_forward == pytest.approx(math.exp(-EPOCH_S / gust))
    low, high = (float(np.exp(ROLL_SHAPES[k, 0, 3])) for k in (1, 2))
    middle = shaped(
        loop_gains_of(GAINS), learnt_as(roll=float(np.exp(0.5 * (ROLL_NODES[1] + ROLL_NODES[2]))), lag_s=0.045)
    )
    assert middle.right_gain == pytest.approx(math.sqrt(low * high))
    assert gains_with(GAINS, loop_gains_of(GAINS)) == GAINS
    changed = gains_with(GAINS, middle)
    assert LoopGains(*(getattr(changed, name) for name in LoopGains._fields)) == middle


@pytest.mark.parametrize(
    ("pitch", "roll", "lag_s"), [(200.0, 480.0, 0.052), (300.0, 720.0, 0.056), (380.0, 900.0, 0.065)]
)
def test_the_gains_keep_45_degrees_and_6_db_over_the_box_of_what_was_learnt(pitch, roll, lag_s):
    learnt = learnt_as(pitch, roll, lag_s, std=0.04)
    with_them = gains_with(GAINS, shaped(loop_gains_of(GAINS), learnt))
    box = margins_of_learnt(VEHICLE, HOVER, learnt, with_them)
    for row in box.rows:
        assert row.margins.phase_deg >= LEAST_PHASE_DEG - 0.5, row
        assert row.margins.gain_db >= LEAST_GAIN_DB - 0.1, row
    assert len({row.corner for row in box.rows}) == 11  # as learnt, each end of three intervals, two masses
    wrong = learnt_as(0.5 * pitch, 0.5 * roll, 1.4 * lag_s, std=0.04)  # it is that of this vehicle, not of any
    found = margins_of_learnt(VEHICLE, HOVER, wrong, with_them).rows
    assert min(row.margins.phase_deg for row in found) < LEAST_PHASE_DEG
