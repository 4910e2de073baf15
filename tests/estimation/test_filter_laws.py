"""The filter's measurement laws: each Jacobian is its own prediction's derivative, each sign the world's."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable
from typing import Any, NamedTuple, get_args, get_type_hints

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from filters import Filter, N, filter_at, filters, innovation_gradient, product, random_covariance
from flownav.core.compile import ONE_LANE
from flownav.core.frames import GRAVITY_M_S2, quaternion_from_euler, rotation_from_quaternion
from flownav.estimation import laws
from flownav.estimation.law import Observation, Parameter, Signature
from flownav.estimation.laws import LEAST_RANGE_M, lens_range
from flownav.estimation.laws.attitude import attitude, bridged_attitude, heading, level
from flownav.estimation.laws.flow import body_velocity, flow_rate, lagged_flow, lagged_flow_rate
from flownav.estimation.laws.gps import gps_position, gps_velocity
from flownav.estimation.laws.height import baro_altitude, range_along_boresight
from flownav.estimation.laws.pad import pad_fix, sight
from flownav.estimation.laws.still import gyro_at_rest, pad_below, position_itself, velocity_itself
from flownav.estimation.states import (
    ATTITUDE,
    BARO,
    COEFFICIENT,
    COMPASS,
    FLOW_SCALE,
    FORCE,
    GPS_VELOCITY,
    GROUND,
    GYRO_BIAS,
    GYRO_SHARE,
    INNOVATION,
    INS_ERROR,
    NOISE,
    OBSERVED,
    OFFERED,
    PAD,
    PLACES,
    POSITION,
    RATE,
    SHORT_NAMES,
    VECTORS,
    VELOCITY,
    VELOCITY_LAG,
)

LENS = {"forward_m": 0.31, "right_m": -0.12, "below_m": 0.1}
AXES, CHANNELS = (0, 1, 2), (0, 1)
EXAMPLES = settings(max_examples=15, deadline=None)


# -- Jacobians -----------------------------------------------------------------------------------------------
class Case(NamedTuple):
    """A law, its axes and scalars, and what must be read so that its Jacobian is exact."""

    law: Observation
    axes: tuple[int, ...] = (0,)
    scalars: dict[str, float] = {}  # noqa: RUF012
    prepare: Callable[[Filter], None] = lambda filter_: None
    complex_step: bool = True


def take_turning_off_by_the_gyro(filter_) -> None:
    filter_.work[GYRO_SHARE] = 1.0


def read_own_attitude(filter_: Filter) -> None:
    """The attitude reading that this filter expects of an INS without errors."""
    filter_.x[INS_ERROR : INS_ERROR + 3] = 0.0
    filter_.reading[:4] = filter_.q


def read_negative_attitude(filter_: Filter) -> None:
    """A quaternion and its negative are one attitude."""
    filter_.reading[:4] = -filter_.q


def read_own_pad(filter_: Filter) -> None:
    """The pad fix that this filter expects of a pad below it: the lever of its attitude is the measured one."""
    sight_m = np.array([0.4, -0.7, 1.0]) * 5.0
    lens = np.array(list(LENS.values()))
    filter_.x[PAD : PAD + 3] = filter_.x[:3] + filter_.rotation @ (sight_m + lens)
    filter_.reading[:3] = 0.4, -0.7, np.linalg.norm(sight_m)


CASES = {
    "gps position": Case(gps_position, AXES, LENS),
    "gps velocity": Case(gps_velocity, AXES, LENS),
    "flow rate": Case(flow_rate, CHANNELS, {**LENS, "lens_below_m": 0.17}),
    "flow rate with the gyro's bias": Case(
        flow_rate, CHANNELS, {**LENS, "lens_below_m": 0.17}, prepare=take_turning_off_by_the_gyro
    ),
    "body velocity": Case(body_velocity, AXES, LENS),
    "lagged flow": Case(lagged_flow, CHANNELS, {"gain": 196.9}),
    "lagged flow rate": Case(lagged_flow_rate, CHANNELS, {"gain": 196.9, "lens_below_m": 0.17}),
    "range": Case(range_along_boresight, (0,), LENS),
    "pressure altitude": Case(baro_altitude),
    "attitude": Case(attitude, AXES, prepare=read_own_attitude),
    "negative attitude": Case(bridged_attitude, AXES, prepare=read_negative_attitude),
    "level": Case(level, CHANNELS),
    "heading": Case(heading, complex_step=False),  # arctan2 takes no complex number
    "pad": Case(pad_fix, AXES, LENS, read_own_pad),
    "position": Case(position_itself, AXES),
    "velocity": Case(velocity_itself, AXES),
    "pad below": Case(pad_below, AXES),
    "gyro at rest": Case(gyro_at_rest, AXES),
}


def observing(law: Observation, axis: int, scalars: dict[str, float]) -> Callable[[Filter], None]:
    """A law as a function of the filter alone."""
    return lambda filter_: law(filter_.work, ONE_LANE, axis, **scalars)


def assert_jacobian(filter_: Filter, case: Case, axis: int, tolerance: float = 1e-11) -> None:
    run, observe = filter_.copy(), observing(case.law, axis, case.scalars)
    observe(run)
    theirs = innovation_gradient(filter_, observe, case.complex_step)
    scale = max(1.0, np.abs(theirs).max())
    named = {SHORT_NAMES[i]: (run.jacobian[i], theirs[i]) for i in np.flatnonzero(run.jacobian != theirs)}
    far = {name: pair for name, pair in named.items() if abs(pair[0] - pair[1]) > tolerance * scale}
    assert not far


@pytest.mark.parametrize("name", CASES)
@EXAMPLES
@given(filter_=filters())
def test_every_jacobian_is_the_derivative_of_its_law(name, filter_):
    case = CASES[name]
    case.prepare(filter_)
    for axis in case.axes:
        assert_jacobian(filter_, case, axis, 1e-11 if case.complex_step else 1e-9)


@EXAMPLES
@given(filters())
def test_the_jacobian_of_an_attitude_with_errors_is_right_to_their_size(filter_):
    """The law is that of small angles."""
    roll, pitch, turn = filter_.x[INS_ERROR : INS_ERROR + 3]
    error = filter_.rotation @ [roll, pitch, 0.0] + [0.0, 0.0, turn]
    read = product(np.concatenate([[1.0], 0.5 * error]), filter_.q)
    filter_.reading[:4] = read / np.linalg.norm(read)
    size = abs(roll) + abs(pitch) + abs(turn)
    for axis in AXES:
        assert_jacobian(filter_, Case(attitude), axis, 2.0 * size)
        run = filter_.copy()
        attitude(run.work, ONE_LANE, axis)
        assert abs(run.work[INNOVATION]) <= size**2


def every_law() -> list[Observation]:
    """The laws of all sensors' files."""
    found = []
    for module in pkgutil.iter_modules(laws.__path__, laws.__name__ + "."):
        members = vars(importlib.import_module(module.name)).items()
        found += [member for _, member in members if hasattr(member, "law") and member.__module__ == module.name]
    return found


def jacobian_of(law: Observation) -> Any:
    return get_args(get_type_hints(law.law)["return"])[1]


def test_every_law_stands_above():
    assert {id(case.law) for case in CASES.values()} == {id(law) for law in every_law()}


def test_what_no_law_reads_no_law_corrects_directly():
    """Accelerometer biases and the lag's rates have no coefficient anywhere: they are learnt through P alone."""
    read = set()
    for law in every_law():
        for field in jacobian_of(law)._fields:
            read |= {VECTORS[field] + axis for axis in AXES} if field in VECTORS else {PLACES[field]}
    unread = {name for name in SHORT_NAMES if PLACES[name] not in read}
    assert unread == {"accel_bias_x", "accel_bias_y", "accel_bias_z", "lag_u2", "lag_v2"}


@pytest.mark.parametrize("name", CASES)
def test_a_law_called_with_numbers_says_what_its_observation_does(name):
    """The scalar law by its parameters' names, beside what the generated code left in the rows."""
    case = CASES[name]
    filter_ = filter_at(3, 0.2, -0.3, 1.0, 4.0)
    case.prepare(filter_)
    axis = case.axes[-1]
    case.law(filter_.work, ONE_LANE, axis, **case.scalars)
    rows = {**{f"q{part}": filter_.q[i] for i, part in enumerate("wxyz")}, "axis": axis}
    rows |= {name: filter_.x[place] for name, place in PLACES.items()}
    rows |= {name: filter_.x[first + axis] for name, first in VECTORS.items()}
    rows |= {f"rate_{part}": filter_.work[RATE + i] for i, part in enumerate("xyz")}
    rows |= {f"measured_{i}": filter_.reading[i] for i in range(8)}
    rows |= {"measured": filter_.reading[0], "force": filter_.work[FORCE + axis]}
    rows |= {"gyro_share": filter_.work[GYRO_SHARE]}
    rows |= case.scalars
    takes = Signature.of(case.law.law)

    def told(parameter: Parameter) -> Any:
        numbers = [rows[name] for name in parameter.names if name in rows]  # the others have defaults
        return numbers[0] if parameter.record is None else parameter.record(*numbers)

    passed = {parameter.name: told(parameter) for parameter in takes.passed}
    found, jacobian = case.law.law(*map(told, takes.reads), **passed)
    reads = any(name.startswith("measured") for name in takes.names)
    assert filter_.work[INNOVATION] == (found if reads else filter_.reading[0] - found)
    count = int(filter_.work[OBSERVED])
    assert filter_.rows(COEFFICIENT, count).tolist() == list(jacobian)


@EXAMPLES
@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
def test_the_sights_triad_is_orthonormal_and_right_handed(forward, right):
    triad = np.array([sight(forward, right, component) for component in AXES])
    assert np.allclose(triad @ triad.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(triad) == pytest.approx(1.0)
    assert np.allclose(triad[2] * np.sqrt(forward**2 + right**2 + 1.0), [forward, right, 1.0])


# -- signs and conventions, by hand ----------------------------------------------------------------------------
def predicted(filter_: Filter, law: Observation, axis: int = 0, **scalars: float) -> float:
    """The reading that a law predicts: the negative of its innovation where zero is read."""
    run = filter_.copy()
    run.reading[0] = 0.0
    law(run.work, ONE_LANE, axis, **scalars)
    return float(-run.work[INNOVATION])


def still_life(roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> Filter:
    filter_ = Filter()
    filter_.q[:] = quaternion_from_euler(roll, pitch, yaw)
    return filter_


NO_LEVER = {"forward_m": 0.0, "right_m": 0.0, "below_m": 0.0}


def test_range_is_measured_along_body_down_from_the_lens_to_level_ground():
    filter_ = still_life(roll=0.3, pitch=-0.4, yaw=2.0)
    filter_.x[POSITION + 2], filter_.x[GROUND] = -5.0, 1.0
    slant = 6.0 / (np.cos(0.3) * np.cos(0.4)) - 0.1
    assert predicted(filter_, range_along_boresight, below_m=0.1) == pytest.approx(slant, rel=1e-14)
    assert lens_range(rotation_from_quaternion(*filter_.q), 6.0, (0.0, 0.0, 0.1))[0] == pytest.approx(slant, rel=1e-14)


@EXAMPLES
@given(filters())
def test_a_range_ends_on_the_ground(filter_):
    """From the lens, wherever it is, along body down: the end has the ground's down coordinate."""
    found = predicted(filter_, range_along_boresight, **LENS)
    end = filter_.x[:3] + filter_.rotation @ [LENS["forward_m"], LENS["right_m"], LENS["below_m"] + found]
    assert end[2] == pytest.approx(filter_.x[GROUND], abs=1e-12)


def test_altitude_is_up_and_position_is_down():
    filter_ = still_life()
    filter_.x[POSITION + 2], filter_.x[BARO] = -5.0, 0.7
    assert predicted(filter_, baro_altitude) == pytest.approx(5.7)


def test_an_antenna_stands_where_its_lever_says_and_swings():
    """Nose east, antenna 2 m ahead and 1 m above: 2 m east, 1 m up; a turn to the right swings it south."""
    filter_ = still_life(yaw=0.5 * np.pi)
    lever = {"forward_m": 2.0, "right_m": 0.0, "below_m": -1.0}
    assert [predicted(filter_, gps_position, axis, **lever) for axis in AXES] == pytest.approx([0.0, 2.0, -1.0])
    filter_.work[RATE + 2], filter_.work[FORCE + 2] = 0.3, -GRAVITY_M_S2
    assert [predicted(filter_, gps_velocity, axis, **lever) for axis in AXES] == pytest.approx([-0.6, 0.0, 0.0])


def test_gps_velocity_lags_by_its_lag_times_the_acceleration():
    filter_ = still_life()
    filter_.x[VELOCITY : VELOCITY + 3], filter_.x[VELOCITY_LAG] = (5.0, 1.0, 0.5), 0.2
    filter_.x[GPS_VELOCITY : GPS_VELOCITY + 3] = 0.01, 0.02, 0.03
    filter_.rows(FORCE, 3)[:] = 3.0, -1.0, 2.0 - GRAVITY_M_S2
    found = [predicted(filter_, gps_velocity, axis, **NO_LEVER) for axis in AXES]
    assert found == pytest.approx([5.0 + 0.01 - 0.6, 1.0 + 0.02 + 0.2, 0.5 + 0.03 - 0.4])


def test_flow_has_px4s_signs():
    """Forward flight moves the picture about +y, flight to the right about -x; both slower from higher."""
    filter_ = still_life(yaw=0.5 * np.pi)  # nose east
    filter_.x[VELOCITY : VELOCITY + 2] = -2.0, 3.0  # to the right is south: 3 m/s forward, 2 m/s right
    filter_.x[POSITION + 2] = -4.0 - 0.1
    filter_.x[FLOW_SCALE] = 0.1
    flow = [predicted(filter_, flow_rate, c, **NO_LEVER, lens_below_m=0.1) for c in CHANNELS]
    assert flow == pytest.approx([-1.1 * 2.0 / 4.0, 1.1 * 3.0 / 4.0])
    body = [predicted(filter_, body_velocity, c, **NO_LEVER) for c in AXES]
    assert body == pytest.approx([3.3, 2.2, 0.0])


def test_the_lens_moves_with_its_lever():
    """A lens below goes forward when the nose goes up, and left when the vehicle rolls to the right."""
    filter_ = still_life()
    filter_.x[POSITION + 2] = -2.1
    filter_.work[RATE : RATE + 3] = 0.4, 0.5, 0.0
    lever = {"forward_m": 0.0, "right_m": 0.0, "below_m": 0.1}
    assert [predicted(filter_, body_velocity, c, **lever) for c in AXES] == pytest.approx([0.05, -0.04, 0.0])
    flow = [predicted(filter_, flow_rate, c, **lever, lens_below_m=0.1) for c in CHANNELS]
    assert flow == pytest.approx([0.04 / 2.0, 0.05 / 2.0])


def test_flow_on_the_ground_says_nothing_of_height():
    """Where the range is held at its least, only velocity and attitude explain flow."""
    filter_ = still_life(roll=0.1)
    filter_.x[VELOCITY : VELOCITY + 3] = 0.3, 0.2, 0.0
    case = Case(flow_rate, (0,), {**NO_LEVER, "lens_below_m": 0.1})
    assert_jacobian(filter_, case, 0)
    assert lens_range(rotation_from_quaternion(*filter_.q), 0.0, (0.0, 0.0, 0.1))[0] == LEAST_RANGE_M
    flow_rate(filter_.work, ONE_LANE, 0, **case.scalars)
    assert filter_.jacobian[[POSITION + 2, GROUND]] == pytest.approx(0.0)


def test_a_lagged_channel_reads_its_own_state():
    filter_ = still_life()
    filter_.x[[PLACES["lag_u1"], PLACES["lag_v1"]]] = 0.01, -0.02
    assert [predicted(filter_, lagged_flow, c, gain=200.0) for c in CHANNELS] == pytest.approx([2.0, -4.0])


def test_heading_is_clockwise_from_north_and_wraps():
    filter_ = still_life(roll=0.3, pitch=0.2, yaw=3.1)
    filter_.x[INS_ERROR + 2] = 0.02
    filter_.reading[0] = -3.1
    heading(filter_.work, ONE_LANE, 0)
    assert filter_.work[INNOVATION] == pytest.approx(2.0 * np.pi - 6.2 - 0.02, abs=1e-12)


def test_hard_iron_turns_with_the_vehicle():
    filter_ = still_life(yaw=0.5 * np.pi)
    filter_.x[COMPASS : COMPASS + 2] = 0.03, 0.05
    assert predicted(filter_, heading) == pytest.approx(0.5 * np.pi + 0.03)
    assert predicted(still_life(yaw=0.7), heading) == pytest.approx(0.7)


def test_a_heading_nose_up_still_has_a_jacobian():
    filter_ = still_life(pitch=0.5 * np.pi)
    heading(filter_.work, ONE_LANE, 0)
    assert np.all(np.isfinite(filter_.rows(COEFFICIENT, 6)))


def test_an_ins_error_in_roll_is_a_turn_about_the_nose():
    filter_ = still_life(yaw=0.5 * np.pi)  # nose east: roll is a turn about east
    filter_.x[INS_ERROR] = 0.01
    filter_.reading[:4] = quaternion_from_euler(0.01, 0.0, 0.5 * np.pi)
    for axis in AXES:
        attitude(filter_.work, ONE_LANE, axis)
        assert filter_.work[INNOVATION] == pytest.approx(0.0, abs=1e-6)


def test_pad_ahead_means_vehicle_behind():
    """Level, nose north, 10 m above and 2 m south of the pad, the pad's tangent forward is +0.2."""
    filter_ = still_life()
    filter_.x[PAD : PAD + 3] = 7.0, 3.0, 1.0
    filter_.x[:3] = 5.0, 3.0, 1.0 - 10.0 - 0.1
    filter_.reading[:3] = 0.2, 0.0, np.hypot(2.0, 10.0)
    for axis in AXES:
        pad_fix(filter_.work, ONE_LANE, axis, below_m=0.1)
        assert filter_.work[INNOVATION] == pytest.approx(0.0, abs=1e-14)
        assert np.array_equal(filter_.jacobian[PAD : PAD + 3], -filter_.jacobian[POSITION : POSITION + 3])


def test_a_pad_that_nobody_knows_leaves_the_vehicle_where_it_is():
    """Its first fix is news of the pad alone, and the next one, of the same, of neither."""
    filter_ = filter_at(1, 0.1, 0.1, 0.3, 8.0)
    p = np.zeros((N, N))
    p[:3, :3], p[PAD : PAD + 3, PAD : PAD + 3] = 4.0 * np.eye(3), 1e6 * np.eye(3)
    filter_.p = p
    filter_.reading[:3] = 0.1, 0.2, 8.0
    before = filter_.x[:3].copy()
    for axis in AXES:
        pad_fix(filter_.work, ONE_LANE, axis, below_m=0.1)
        filter_.work[[NOISE, OFFERED]] = 0.01, 1.0
        assert filter_.fuse()
    assert filter_.x[:3] == pytest.approx(before, abs=1e-3)
    assert np.diag(filter_.p)[:3] == pytest.approx(4.0, rel=1e-4)
    assert np.diag(filter_.p)[PAD : PAD + 3] == pytest.approx(4.0 + 0.01, rel=1e-4)


def test_a_vehicle_that_stands_on_its_pad_is_where_the_pad_is():
    filter_ = still_life()
    filter_.x[PAD : PAD + 3], filter_.x[:3] = (7.0, 3.0, 1.0), (5.0, 3.5, 1.0)
    assert [predicted(filter_, pad_below, axis) for axis in AXES] == pytest.approx([2.0, -0.5, 0.0])


def test_a_gyro_at_rest_reads_its_bias():
    filter_ = still_life()
    filter_.x[GYRO_BIAS : GYRO_BIAS + 3] = 0.01, -0.02, 0.03
    assert [predicted(filter_, gyro_at_rest, axis) for axis in AXES] == pytest.approx([0.01, -0.02, 0.03])


# -- one after the other -----------------------------------------------------------------------------------------
@EXAMPLES
@given(st.integers(0, 2**32 - 1))
def test_readings_one_after_the_other_are_the_joint_update(seed):
    """The second component does not correct again the part that the first has corrected."""
    after = filter_at(seed, 0.2, -0.3, 1.0, 6.0)
    after.p = random_covariance(np.random.default_rng(seed), 0.01)
    random = np.random.default_rng(seed)
    laws_of_fix = [observing(gps_position, axis, NO_LEVER) for axis in AXES]
    laws_of_fix += [observing(gps_velocity, axis, NO_LEVER) for axis in AXES]
    noise, read = random.uniform(0.001, 0.1, 6), np.zeros(6)
    h, nu = np.zeros((6, N)), np.zeros(6)
    for k, observe in enumerate(laws_of_fix):
        run = after.copy()
        run.reading[0] = 0.0
        observe(run)
        nu[k] = 0.003 * random.normal()
        read[k] = nu[k] - run.work[INNOVATION]
        h[k] = run.jacobian
    gain = after.p @ h.T @ np.linalg.inv(h @ after.p @ h.T + np.diag(noise))
    correction = gain @ nu
    p = (np.eye(N) - gain @ h) @ after.p
    q, x = after.q.copy(), after.x + correction
    for k, observe in enumerate(laws_of_fix):
        after.reading[0] = read[k]
        observe(after)
        after.work[[NOISE, OFFERED]] = noise[k], 1.0
        assert after.fuse()
    others = [i for i in range(N) if not ATTITUDE <= i < ATTITUDE + 3]
    assert np.allclose(after.x[others], x[others], rtol=0, atol=1e-11)
    assert np.allclose(after.p, p, rtol=0, atol=1e-10)
    turn = product(after.q, q * [1, -1, -1, -1])
    theta = correction[ATTITUDE : ATTITUDE + 3]
    assert np.allclose(2.0 * turn[1:] / turn[0], theta, rtol=0, atol=1e-5)


@EXAMPLES
@given(st.integers(0, 2**32 - 1))
def test_an_attitude_read_by_components_leaves_no_innovation_behind(seed):
    """A reading without noise is believed: afterwards every axis agrees with it, the first as well as the last."""
    filter_ = filter_at(seed, 0.2, -0.3, 1.0, 6.0)
    p = random_covariance(np.random.default_rng(seed), 0.01)
    filter_.x[INS_ERROR : INS_ERROR + 3] = 0.0
    p[INS_ERROR : INS_ERROR + 3], p[:, INS_ERROR : INS_ERROR + 3] = 0.0, 0.0
    filter_.p = p
    small = np.array([1.0, 1e-4, -2e-4, 1.5e-4])
    filter_.reading[:4] = product(small / np.linalg.norm(small), filter_.q)
    for law in (attitude, bridged_attitude):
        run = filter_.copy()
        for axis in AXES:
            law(run.work, ONE_LANE, axis)
            run.work[[NOISE, OFFERED]] = 1e-16, 1.0
            assert run.fuse()
        for axis in AXES:
            law(run.work, ONE_LANE, axis)
            assert run.work[INNOVATION] == pytest.approx(0.0, abs=1e-6)
