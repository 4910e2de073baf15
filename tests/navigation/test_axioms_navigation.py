"""Invariances of the navigator, law by law, as plain functions: time, north, energy and scale."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from flownav.core.compile import ONE_LANE
from flownav.core.frames import (
    GRAVITY_M_S2,
    quaternion_from_euler,
    rotation_from_quaternion,
    to_earth,
    turned_about_down,
)
from flownav.core.measurement import Sensor
from flownav.estimation.covariance import at
from flownav.estimation.hypotheses import HEADING_OFF, RANGE_OFFSET
from flownav.estimation.laws.gps import gps_position, gps_velocity
from flownav.estimation.named import Attitude, BodyRate, Lever
from flownav.estimation.states import HYPOTHESES, MOST_HYPOTHESES, POSITION, STATE, STATES
from flownav.navigation.course import judge_course, with_flow, with_gps
from flownav.navigation.flow_noise import (
    followed_agreement,
    followed_likeness,
    followed_quality,
    lasting_walk,
    wrong_since,
)
from flownav.navigation.gps import judge_rejections, squared_acceleration
from flownav.navigation.heading import heading_variance
from flownav.navigation.height import judge_ground, repeats
from flownav.navigation.inertial import SWING_S, paid, steady_force, turning_noise
from flownav.navigation.kernel_settings import NO_HEADING, Equipment
from flownav.navigation.loop import start_navigator
from flownav.navigation.memory import CLOCK, MEMORY, SCALE_DOUBT, new_work
from flownav.navigation.motion_records import (
    CourseMemory,
    ImuMemory,
    ImuWindow,
    SeenWindow,
    SpikeMemory,
    StandMemory,
    SteadyForce,
)
from flownav.navigation.now import NowState, coasted, moved_on
from flownav.navigation.pad import judge_pad
from flownav.navigation.protection import levels
from flownav.navigation.reasons import FUSED
from flownav.navigation.records import (
    FlowMemory,
    GpsMemory,
    GroundMemory,
    HeadingMemory,
    RangeMemory,
    Reading,
    StartMemory,
    SuspicionMemory,
    WitnessMemory,
)
from flownav.navigation.rings import Given, Rings, numbers_of
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.spikes import BURST_S, LONE_SHARE, MOST_DOUBT_M_S, doubt_of
from flownav.navigation.still import GYRO_FLOOR_RAD_S, offer_bias
from flownav.navigation.suspicion import HELD_S, judge_suspicion
from flownav.navigation.tape import empty_tape
from flownav.navigation.verdicts import AxisBias, Force, Height
from flownav.navigation.waiting_records import Sizes
from flownav.navigation.windows import RESTS, SHAKEN, with_imu

SEEDS = pytest.mark.parametrize("seed", range(6))
FITTED = Equipment(True, False, NO_HEADING, False, -math.inf)
TOLD = NavigatorSettingsFile().settings(FITTED)
LATER_S = 4096.0  # a shift by a power of two keeps every difference of such times to the bit


def floats(rng: np.random.Generator, count: int, size: float = 1.0) -> tuple[float, ...]:
    return tuple(float(x) for x in size * rng.normal(size=count))


def drawn_state(rng: np.random.Generator) -> NowState:
    q = quaternion_from_euler(*floats(rng, 2, 0.4), float(rng.uniform(-3.0, 3.0)))
    return NowState(*floats(rng, 6, 3.0), *(float(x) for x in q), *floats(rng, 3, 0.02), *floats(rng, 3, 0.2))


def about_down(pair, angle):
    cosine, sine = math.cos(angle), math.sin(angle)
    return cosine * pair[0] - sine * pair[1], sine * pair[0] + cosine * pair[1]


def turned(s: NowState, angle: float) -> NowState:
    """The state in a world that is turned about down; the biases are of the body."""
    (n, e), (vn, ve) = about_down((s.pos_n, s.pos_e), angle), about_down((s.vel_n, s.vel_e), angle)
    q = turned_about_down((s.qw, s.qx, s.qy, s.qz), angle)
    return s._replace(pos_n=n, pos_e=e, vel_n=vn, vel_e=ve, qw=q[0], qx=q[1], qy=q[2], qz=q[3])


# -- from the filter's instant to a later one --------------------------------------------------------------------
@SEEDS
def test_what_coasts_goes_straight_on_and_neither_turns_nor_learns(seed):
    s = drawn_state(np.random.default_rng(seed))
    found = coasted(s, 0.3)
    assert found[:3] == pytest.approx([p + 0.3 * v for p, v in zip(s[:3], s[3:6], strict=True)], rel=1e-15)
    assert found[3:] == s[3:]
    assert coasted(coasted(s, 0.1), 0.2) == pytest.approx(found, rel=1e-14)
    assert coasted(s, 0.0) == s
    assert coasted(coasted(s, 0.5), -0.5) == pytest.approx(s, rel=1e-14)
    assert coasted(s._replace(vel_d=0.0), 10.0).pos_d == s.pos_d  # what flies level does not climb


@SEEDS
def test_what_is_carried_gains_the_energy_that_its_force_has_along_its_way(seed):
    """Of a step in which a force is held: v^2/2 grows by a . dp, to the bit of a parabola, whatever it turns by."""
    rng = np.random.default_rng(seed)
    s, between = drawn_state(rng), floats(rng, 6, 2.0)
    for dt_s in (0.004, 0.1, -0.05):
        after = moved_on(s, between, dt_s)
        accel = np.subtract(after[3:6], s[3:6]) / dt_s
        way = np.subtract(after[:3], s[:3])
        assert accel @ way == pytest.approx(0.5 * (np.square(after[3:6]).sum() - np.square(s[3:6]).sum()), rel=1e-9)
        assert way == pytest.approx(dt_s * 0.5 * np.add(after[3:6], s[3:6]), rel=1e-9, abs=1e-12)
        felt = np.subtract(between[3:6], s[13:16])
        assert np.linalg.norm(accel - [0.0, 0.0, GRAVITY_M_S2]) == pytest.approx(np.linalg.norm(felt), rel=1e-9)


@SEEDS
def test_one_that_stands_is_carried_nowhere_in_any_attitude(seed):
    """A resting IMU reads its biases and what holds it against gravity."""
    s = drawn_state(np.random.default_rng(seed))._replace(vel_n=0.0, vel_e=0.0, vel_d=0.0)
    rotation = np.reshape(rotation_from_quaternion(*s[6:10]), (3, 3))
    weight = rotation.T @ [0.0, 0.0, -GRAVITY_M_S2]
    reads = (*s[10:13], *(float(x) for x in weight + s[13:16]))
    assert moved_on(s, reads, 0.5) == pytest.approx(s, abs=1e-12)


@SEEDS
def test_where_north_is_matters_to_nobody_who_is_carried(seed):
    rng = np.random.default_rng(seed)
    s, between, angle = drawn_state(rng), floats(rng, 6, 2.0), float(rng.uniform(-3.0, 3.0))
    assert moved_on(turned(s, angle), between, 0.2) == pytest.approx(turned(moved_on(s, between, 0.2), angle), rel=1e-9)
    assert coasted(turned(s, angle), 0.2) == pytest.approx(turned(coasted(s, 0.2), angle), rel=1e-9)


def test_the_state_of_an_instant_hangs_on_no_later_reading_and_on_no_zero_of_time():
    rng = np.random.default_rng(1)
    on = start_navigator(FITTED, NavigatorSettingsFile(), empty_tape(1, 1, 1))
    s = drawn_state(rng)
    for name, value in s._asdict().items():
        on.work[MEMORY.row(NowState, name)] = value
    kept = ImuMemory(read_s=8.0, gyro_x=0.1, gyro_y=-0.2, gyro_z=0.3, accel_x=0.4, accel_y=0.5, accel_z=-9.0)
    for name, value in kept._asdict().items():
        on.work[MEMORY.row(ImuMemory, name)] = value
    on.work[CLOCK] = 8.0
    imu = np.column_stack([8.0 + 0.0625 * np.arange(1, 9), rng.normal(size=(8, 6))])

    def told(imu, t_s, later_s=0.0):
        rings, work = Rings(Sizes(16.0, 1.0, 0.0, 64.0), 1), on.work.copy()
        work[CLOCK] += later_s
        for row in imu:
            rings.take(Given(row[0] + later_s, int(Sensor.IMU), numbers_of(row[1:])))
        now = rings.now(work, on.settings, t_s + later_s)
        return np.concatenate([now.pos_ned_m, now.vel_ned_m_s, now.quaternion, now.rate_frd_rad_s])

    for t_s in (8.125, 8.15, 8.25):
        found = told(imu, t_s)
        last = int(np.searchsorted(imu[:, 0], t_s)) + 1  # the first at or after it: what stands between the two
        np.testing.assert_array_equal(told(imu[:last], t_s)[:10], found[:10])
        np.testing.assert_allclose(told(imu, t_s, LATER_S), found, rtol=1e-9, atol=1e-11)
    before, after = (told(imu, t_s) for t_s in (8.25 - 1e-7, 8.25 + 1e-7))
    np.testing.assert_allclose(after[:10], before[:10], atol=1e-5)  # no jump at a reading


# -- the turn of north -----------------------------------------------------------------------------------------
@SEEDS
def test_levels_are_the_same_whichever_way_north_is(seed):
    """Covariance, position, a fault's effect and what GPS moved, all turned by a heading."""
    rng = np.random.default_rng(seed)
    factor = rng.normal(size=(2, 2))
    covariance = factor @ factor.T
    place, effect, moved = floats(rng, 2, 30.0), floats(rng, 2, 20.0), floats(rng, 2, 9.0)

    def level(angle: float, *, doubt: float, faults: float) -> tuple[float, ...]:
        work = new_work(ONE_LANE)
        turn = np.column_stack([about_down((1.0, 0.0), angle), about_down((0.0, 1.0), angle)])
        both = turn @ covariance @ turn.T
        for i in range(2):
            work[at(POSITION + i, POSITION + i)] = both[i, i]
            work[STATE + POSITION + i] = about_down(place, angle)[i]
            work[at(POSITION + i, STATES + HEADING_OFF)] = about_down(effect, angle)[i]
            work[MEMORY.row(GpsMemory, ("moved_n_m", "moved_e_m")[i])] = about_down(moved, angle)[i]
        work[at(POSITION, POSITION + 1)] = both[0, 1]
        work[at(POSITION + 2, STATES + RANGE_OFFSET)] = 3.0
        work[SCALE_DOUBT], work[HYPOTHESES] = doubt, faults
        return levels(work, ONE_LANE, 0)

    for doubt, faults in ((0.1, 0.0), (0.0, MOST_HYPOTHESES), (0.1, MOST_HYPOTHESES)):
        found = level(0.0, doubt=doubt, faults=faults)
        for angle in (0.5 * math.pi, 1.0, -2.0):
            assert level(angle, doubt=doubt, faults=faults) == pytest.approx(found, rel=1e-9)


@SEEDS
def test_an_antenna_is_where_its_lever_is_whichever_way_north_is(seed):
    rng = np.random.default_rng(seed)
    pos, slow, fast, vel, force = (floats(rng, 3) for _ in range(5))
    q, rate, lever = quaternion_from_euler(0.2, -0.1, 0.7), BodyRate(*floats(rng, 3)), Lever(*floats(rng, 3, 0.3))

    def fix(angle: float):
        def around(vector):
            return (*about_down(vector, angle), vector[2])

        attitude = Attitude(*turned_about_down(q, angle))
        p, s, f, v, a = map(around, (pos, slow, fast, vel, force))
        places = [gps_position.law(i, p[i], s[i], f[i], attitude, lever=lever)[0] for i in range(3)]
        speeds = [gps_velocity.law(i, v[i], s[i], 0.15, a[i], attitude, rate, lever=lever)[0] for i in range(3)]
        return places, speeds, around

    places, speeds, _ = fix(0.0)
    for angle in (0.5 * math.pi, -1.2):
        others, quicker, around = fix(angle)
        assert others == pytest.approx(around(places), rel=1e-9)
        assert quicker == pytest.approx(around(speeds), rel=1e-9)
    rotation = rotation_from_quaternion(*q)
    assert places == pytest.approx(np.add(pos, np.add(slow, fast)) + to_earth(rotation, *lever))


@SEEDS
def test_a_receiver_that_smooths_says_the_velocity_of_a_lag_ago(seed):
    """The shift of time: what a state carried back by the lag has is what the law expects."""
    rng = np.random.default_rng(seed)
    s, felt = drawn_state(rng)._replace(gyro_bias_x=0.0, gyro_bias_y=0.0, gyro_bias_z=0.0), floats(rng, 3, 2.0)
    between = (0.0, 0.0, 0.0, *felt)  # turning nowhere, a force is held in the earth's axes
    force = to_earth(rotation_from_quaternion(*s[6:10]), *np.subtract(felt, s[13:16]))
    earlier = moved_on(s, between, -0.2)
    none, still = Lever(0.0, 0.0, 0.0), BodyRate(0.0, 0.0, 0.0)
    for axis in range(3):
        expected, _ = gps_velocity.law(
            axis, s[3 + axis], 0.0, 0.2, float(force[axis]), Attitude(*s[6:10]), still, lever=none
        )
        assert expected == pytest.approx(earlier[3 + axis], rel=1e-9)


@pytest.mark.parametrize("angle", [0.3, 1.7, -2.5, math.pi - 0.01])
def test_the_course_finds_the_very_angle_by_which_a_heading_errs(angle):
    m, t_s = CourseMemory(), 10.0
    for k in range(200):
        t_s += 0.1
        v_n, v_e = 2.0 * math.cos(0.03 * k), 2.0 * math.sin(0.03 * k)
        w_n, w_e = about_down((v_n, v_e), -angle)
        m = with_flow(w_n, w_e, t_s, m)._replace(north_m_s=w_n, east_m_s=w_e)
        m = with_gps(Reading(v_n, v_e, 0.0, arrived=1.0), t_s, m)
    shown, error_rad = judge_course(m)
    assert shown
    assert error_rad == pytest.approx(angle, abs=1e-9)


# -- the shift of time -----------------------------------------------------------------------------------------
def test_no_verdict_hangs_on_the_zero_of_time():
    """Each judge at t and at t + T, every time that it remembers shifted alike."""
    for t_s in (100.0, 103.5, 131.0):
        for since_s in (90.0, 99.75, 100.0):
            if since_s > t_s:
                continue
            shifted, T = since_s + LATER_S, t_s + LATER_S
            one, m = judge_rejections(2.0, True, False, t_s, WitnessMemory(times=7.0, since_s=since_s), TOLD.gps)
            other, after = judge_rejections(2.0, True, False, T, WitnessMemory(times=7.0, since_s=shifted), TOLD.gps)
            assert (one, m._replace(since_s=m.since_s + LATER_S)) == (other, after)
            suspected = [
                judge_suspicion(SuspicionMemory(2.0, since, since, 3.0), 1.0, 4, False, 0.5, 0.9, now)
                for now, since in ((t_s, since_s), (T, shifted))
            ]
            assert suspected[0].suspected == suspected[1].suspected
            assert suspected[0].left_over_m == suspected[1].left_over_m
            ground = [
                judge_ground(1.0, 2.0, now, False, GroundMemory(1.0, 1.0, since, 2.0, 3.0, 0.0))
                for now, since in ((t_s, since_s), (T, shifted))
            ]
            assert ground[0][0] == ground[1][0]
            told = [
                repeats(now, RangeMemory(taken_s=since, same_s=since, down_m=-2.0), Height(-2.5, 0.1, 1.0), False,
                        TOLD.height)
                for now, since in ((t_s, since_s), (T, shifted))
            ]  # fmt: skip
            assert told[0] == told[1]
            variances = [
                heading_variance(now, HeadingMemory(read_s=since), TOLD.attitude)
                for now, since in ((t_s, since_s), (T, shifted))
            ]
            assert variances[0] == variances[1]
            wrong = [wrong_since(now, 1.5, since) for now, since in ((t_s, since_s), (T, shifted))]
            assert wrong[0] + LATER_S == wrong[1]


def test_a_suspicion_keeps_growing_for_as_long_as_it_is_held_and_no_longer():
    for since_s, grows in ((0.0, True), (HELD_S - 0.1, True), (HELD_S + 0.1, False)):
        m = SuspicionMemory(0.0, 0.0, 50.0 - since_s, 10.0)
        left = judge_suspicion(m, 0.0, 0, False, 3.0, 0.5, 50.0).left_over_m
        assert left == pytest.approx(8.0 if grows else 5.0)


def test_a_range_that_was_fused_within_a_second_of_standing_still_has_served():
    """In a still hover it repeats itself for a moment and is right; one that never served has no such moment."""
    standing = Height(-2.0, 0.0, 1.0)
    lasting = TOLD.height.range_stuck_s
    for fused_before_s, believed in ((0.0, True), (0.9, True), (1.1, False), (30.0, False)):
        m = RangeMemory(taken_s=20.0 - fused_before_s, same_s=20.0, down_m=-2.0)
        assert repeats(20.0 + lasting, m, standing, False, TOLD.height) is not believed


# -- noise that lasts ------------------------------------------------------------------------------------------
def test_an_error_that_lasts_averages_out_as_slowly_as_its_correlation_says():
    """Of readings dt apart with an error sigma exp(-t/tau), the mean's variance is that of white ones of this size."""
    sigma, tau_s = TOLD.attitude.heading_noise_rad, TOLD.attitude.heading_time_s
    dt_s = 0.02 * tau_s
    lags = np.arange(-4000, 4001)
    summed = sigma**2 * np.exp(-abs(lags) * dt_s / tau_s).sum()  # N times the variance of a mean of N
    assert heading_variance(dt_s, HeadingMemory(read_s=0.0), TOLD.attitude) == pytest.approx(summed, rel=1e-3)
    assert heading_variance(1e4 * tau_s, HeadingMemory(read_s=0.0), TOLD.attitude) == pytest.approx(sigma**2)


def test_a_velocity_error_that_lasts_lets_the_position_walk_as_its_integral_does():
    """The variance of the integral over a long time T of an error e exp(-t/tau) is 2 e^2 tau T."""
    s = TOLD.flow
    error = s.flow_lasting_rad_s * 3.0
    step_s, steps = 0.02 * s.flow_lasting_s, 20_000
    ages = step_s * np.arange(1, steps)
    long_s = steps * step_s
    total = error**2 * step_s * (long_s + 2.0 * ((long_s - ages) * np.exp(-ages / s.flow_lasting_s)).sum())
    assert lasting_walk(3.0, 0.0, s) == pytest.approx(total / long_s, rel=0.01)
    assert lasting_walk(6.0, 0.0, s) == pytest.approx(4.0 * lasting_walk(3.0, 0.0, s))


@pytest.mark.parametrize(("forward", "right"), [(0.0, 0.0), (0.8, 0.0), (0.0, -0.8), (0.9, 1.1)])
def test_a_tangent_is_as_sure_across_the_sight_wherever_in_the_picture_it_is(forward, right):
    """Noise s of the direction makes a tangent t uncertain by s^2 (1 + a^2 + b^2)(1 + t^2): here by a turned camera."""
    sigma, distance = 0.01, 7.0
    sight = np.array([forward, right, 1.0]) / math.hypot(forward, right, 1.0)
    for component, tangent in ((0, forward), (1, right)):
        plane = np.array([[1.0, 0.0, -forward], [0.0, 1.0, -right]]) * math.hypot(forward, right, 1.0)
        slope = plane[component] - (plane[component] @ sight) * sight  # of the tangent on the direction
        stated = (sigma * np.linalg.norm(slope)) ** 2
        variances = [math.nan] * 3
        variances[component] = stated
        reading = Reading(forward, right, distance, 0.0, 0.0, 0.0, *variances, 255.0, 1.0, 0.0)
        reason, variance = judge_pad(reading, component, 1.0, TOLD.place)
        assert reason == FUSED
        assert variance == pytest.approx((sigma * distance) ** 2, rel=1e-9), tangent


def test_a_burst_is_doubted_by_its_whole_length_however_many_readings_it_has():
    """The squares telescope: what a burst of n spikes adds is that of the last one, and of a lone one its share."""
    kept = ImuMemory()
    struck = Reading(0.0, 0.0, 0.0, 2.0, 0.0, 0.0, arrived=1.0)
    for step_s in (0.01, 0.02):
        count = int(0.5 * BURST_S / step_s)
        added = [
            doubt_of(struck, step_s * k, kept, SpikeMemory(refused=float(k), reach_s=step_s))
            for k in range(1, count + 1)
        ]
        assert added[0] == pytest.approx((LONE_SHARE * 2.0 * step_s) ** 2)
        assert sum(added) == pytest.approx((2.0 * step_s * count) ** 2, rel=1e-9)
        assert min(added) > 0.0
    huge = struck._replace(value_3=1e6)
    most = [doubt_of(huge, 0.01 * k, kept, SpikeMemory(refused=float(k), reach_s=0.01)) for k in range(1, 9)]
    assert sum(most) == pytest.approx(MOST_DOUBT_M_S**2)


def test_a_mean_of_more_readings_is_surer():
    rng = np.random.default_rng(5)
    offers = {}
    for count in (25, 100):
        window = ImuWindow()
        values = rng.normal(size=count)
        values = 0.005 * (values - values.mean()) / values.std()
        for value in values:
            window = with_imu(Reading(0.01 + float(value), arrived=1.0), window)
        offers[count] = offer_bias.law(
            StartMemory(started=1.0),
            window,
            SeenWindow(),
            StandMemory(does=RESTS, windows=3.0),
            AxisBias(0.01, 1e-4),
            axis=0,
        ).offer
        assert offers[count].measured == pytest.approx(0.01, rel=1e-9)
        assert offers[count].variance == pytest.approx(0.005**2 / count + GYRO_FLOOR_RAD_S**2, rel=1e-9)
        assert offers[count].reason == FUSED
    assert offers[100].variance < offers[25].variance
    shaken = offer_bias.law(
        StartMemory(started=1.0),
        window,
        SeenWindow(),
        StandMemory(does=SHAKEN),
        AxisBias(0.01, 1e-4),
        axis=0,
    ).offer
    assert shaken.reason != FUSED  # no ground was seen below it


# -- what is followed, and what is paid --------------------------------------------------------------------------
@pytest.mark.parametrize("step_s", [0.0, 0.01, 0.3, 5.0, 1000.0])
def test_what_is_followed_lies_between_what_it_was_and_what_is_seen(step_s):
    """After no time as before, after any time not beyond; and later is nearer."""
    flow = FlowMemory(taken_s=50.0, ratio=2.0, likeness=2.0)
    for seen in (7.0, -3.0):
        found = {
            "agreement": followed_agreement(seen, 50.0 + step_s, flow),
            "likeness": followed_likeness(seen, 50.0 + step_s, flow),
            "quality": followed_quality(seen, step_s, 2.0),
            "force": steady_force.law(SteadyForce(2.0, 2.0, 2.0), Force(seen, seen, seen), dt_s=step_s).east_m_s2,
            "course": with_flow(seen, seen, 50.0 + step_s, CourseMemory(flow_s=50.0, east_m_s=2.0)).east_m_s,
        }
        for name, value in found.items():
            assert min(2.0, seen) <= value <= max(2.0, seen), name
            assert bool(value == 2.0) is (step_s == 0.0), name


@SEEDS
def test_north_may_be_anywhere_for_what_acceleration_does_to_a_receiver_and_either_turn_for_the_gyro(seed):
    rng = np.random.default_rng(seed)
    north, east, down, angle, turn = rng.normal(size=5)
    c, s = math.cos(angle), math.sin(angle)
    felt = squared_acceleration(SteadyForce(north, east, down))
    assert squared_acceleration(SteadyForce(c * north - s * east, s * north + c * east, down)) == pytest.approx(felt)
    assert squared_acceleration(SteadyForce(0.0, 0.0, -GRAVITY_M_S2)) == 0.0  # standing still
    assert squared_acceleration(SteadyForce(3.0, 4.0, -GRAVITY_M_S2 - 12.0)) == pytest.approx(13.0**2)
    told = NavigatorSettingsFile(gyro_noise_rad_s_rt_hz=0.01, gyro_scale_sigma=0.02)
    assert turning_noise(-turn, 0.0, told) == turning_noise(turn, 0.0, told)
    assert turning_noise(2.0 * turn, 0.0, told) - 1e-4 == pytest.approx(SWING_S * (0.04 * turn) ** 2)
    shown = turning_noise(2.0 * turn, 9e-4, told) - turning_noise(2.0 * turn, 0.0, told)  # its readings show more
    assert shown == pytest.approx(8e-4)
    tones = told.model_copy(update={"gyro_tones_rad_s_rt_hz": 0.01})
    assert turning_noise(0.0, 9e-4, tones) == pytest.approx(8e-4)  # but for the tones that turn nothing
    assert turning_noise(0.0, 1.5e-4, tones) == pytest.approx(1e-4)


@SEEDS
def test_of_each_inertial_period_as_much_is_paid_as_was_read(seed):
    """Momentum: however often other sensors stop the filter in between, the integral of what moves it is the IMU's."""
    rng = np.random.default_rng(seed)
    spent = owed = held = paid_out = read = 0.0
    for _ in range(60):
        period_s, between = float(rng.uniform(0.004, 0.02)), float(rng.normal())
        stops = np.sort(rng.uniform(0.0, period_s, rng.integers(0, 4)))
        edges = [0.0, *stops.tolist(), period_s]
        for k, (begin, end) in enumerate(pairwise(edges)):
            now = k == len(edges) - 2
            step = paid(between, held, spent, owed, end - begin, period_s, now, True)
            paid_out += step.value * (end - begin)
            spent, owed = step.spent, step.owed
        read += between * period_s
        held = between
        assert paid_out + owed == pytest.approx(read, abs=1e-12)
    assert spent == 0.0


def test_a_flow_of_another_motion_does_not_tell_the_course():
    """Older than a quarter of a second, whatever time it is."""
    for t_s in (10.0, 10.0 + LATER_S):
        for age_s, counts in ((0.0, True), (0.25, True), (0.26, False), (0.9, False)):
            m = CourseMemory(gps_s=t_s - 0.1, flow_s=t_s - age_s, north_m_s=2.0, east_m_s=0.0)
            after = with_gps(Reading(2.0, 0.0, 0.0, arrived=1.0), t_s, m)
            assert bool(after.travel_m > 0.0) is counts
