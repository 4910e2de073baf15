"""Made logs of what real flights do to a navigator: a biased gyro, a lying accelerometer, strays, a compass abroad."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flownav.core.compile import ONE_LANE
from flownav.core.measurement import EventQueue, Sensor, merge
from flownav.estimation.gating import Reason
from flownav.estimation.states import ATTITUDE, FLOW_SCALE, GYRO_BIAS
from flownav.navigation.feed import equipment_of
from flownav.navigation.loop import run, start_navigator
from flownav.navigation.memory import MEMORY
from flownav.navigation.motion_records import StandMemory
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.tape import new_tape
from flownav.navigation.windows import MOVES, RESTS, SHAKEN
from navigation_streams import FIELD_GAUSS, Flown, Navigated, body_axes, circle, fly, navigate, still

load_stand, _ = MEMORY.access(StandMemory)

OWN = (Sensor.IMU, Sensor.FLOW_RATE, Sensor.RANGE)  # a vehicle without GPS, compass and barometer
STANDS_S = 6.0


def noisy(flown: Flown, seed: int = 1) -> Flown:
    """White noise on IMU, flow and range."""
    random = np.random.default_rng(seed)
    sigmas = {Sensor.IMU: [0.003] * 3 + [0.05] * 3, Sensor.FLOW_RATE: [0.02] * 2, Sensor.RANGE: [0.005]}
    for sensor, sigma in sigmas.items():
        if sensor in flown.streams:
            value = flown.streams[sensor].value.copy()
            value[:, : len(sigma)] += random.normal(0.0, 1.0, (len(value), len(sigma))) * sigma
            flown = flown.changed(sensor, value=value)
    return flown


def added_to(flown: Flown, sensor: Sensor, offset: list[float], t0_s: float = -1.0, over_s: float = 1e-9) -> Flown:
    """An offset on a sensor's first values, from an instant on, full after over_s."""
    stream = flown.streams[sensor]
    value = stream.value.copy()
    value[:, : len(offset)] += np.clip((stream.t_s - t0_s) / over_s, 0.0, 1.0)[:, None] * offset
    return flown.changed(sensor, value=value)


# -- standing ------------------------------------------------------------------------------------------------
def from_the_ground(t_s: np.ndarray) -> np.ndarray:
    """On its skids, the sensors 0.1 m up, for 6 s; up to 2 m by 9 s; then laps."""
    up = np.clip((t_s - STANDS_S) / 3.0, 0.0, 1.0)
    laps = circle(t_s - 9.0)
    return np.column_stack([laps[:, 0], laps[:, 1], -0.1 - 1.9 * up**2 * (3.0 - 2.0 * up)])


def stood(motors: bool) -> Navigated:
    """A gyro with a bias of 0.6 deg/s; motors that run on the ground shake the IMU."""
    flown = noisy(fly(from_the_ground, STANDS_S + 33.0).only(*OWN))
    flown = added_to(flown, Sensor.IMU, [0.004, -0.003, 0.01])
    if motors:
        imu = flown.streams[Sensor.IMU]
        shaking = np.random.default_rng(9).normal(0.0, 1.0, imu.value.shape) * ([0.05] * 3 + [0.5] * 3)
        flown = flown.changed(Sensor.IMU, value=imu.value + np.where(imu.t_s[:, None] < STANDS_S, shaking, 0.0))
    return navigate(flown)


def test_a_vehicle_that_stands_6_s_with_a_biased_gyro_keeps_its_heading_for_30_s_of_flight():
    rested = stood(motors=False)
    assert np.abs(rested.yaw_error).max() < math.radians(1.0)
    assert rested.column(GYRO_BIAS, 3)[-1] == pytest.approx([0.004, -0.003, 0.01], abs=1e-3)
    events = rested.events("filter", "standing")
    assert events[:, 1].tolist() == [RESTS, MOVES]
    assert events[0, 0] < 2.0
    assert events[1, 0] == pytest.approx(STANDS_S + 0.5, abs=0.6)


def test_one_whose_motors_run_meanwhile_is_known_to_stand_and_learns_the_gyro_s_bias_less_surely():
    """A turn of 0.05 rad over the whole stand may be a slip on the floor: of the heading's bias little is learnt."""
    shaken = stood(motors=True)
    assert shaken.events("filter", "standing")[:, 1].tolist() == [SHAKEN, MOVES]
    assert np.abs(shaken.yaw_error).max() < 4.0 * shaken.sigma(ATTITUDE + 2)
    learnt = shaken.column(GYRO_BIAS, 3)[np.searchsorted(shaken.t_s, STANDS_S)]
    assert learnt[:2] == pytest.approx([0.004, -0.003], abs=3e-3)
    assert 2e-3 < shaken.sigma(GYRO_BIAS + 2) <= NavigatorSettingsFile().gyro_bias_sigma_rad_s
    standing = (shaken.t_s > 2.0) & (shaken.t_s < STANDS_S)
    assert np.abs(shaken.velocity_error[standing]).max() < 0.1


def test_a_hover_is_never_taken_for_standing_however_still_it_is():
    for height_m in (0.5, 2.0, 20.0):
        flown = fly(lambda t, height_m=height_m: still(t) * height_m / 2.0, 8.0)
        assert len(navigate(flown.only(*OWN)).events("filter", "standing")) == 0


# -- an accelerometer that lies ------------------------------------------------------------------------------
def lying(axis: int, over_s: float, offset_m_s2: float = 3.0) -> Navigated:
    """A hover whose accelerometer comes to read too much."""
    offset = [0.0] * 6
    offset[3 + axis] = offset_m_s2
    return navigate(added_to(noisy(fly(still, 30.0).only(*OWN)), Sensor.IMU, offset, 10.0, over_s))


@pytest.mark.parametrize("axis", [0, 1])
def test_an_accelerometer_that_comes_to_read_3_too_much_does_not_carry_the_position_off(axis):
    """Within a second: 0.3 m; half a kilometre where its noise is held at the stated value. Few readings are
    refused.
    """
    flown = lying(axis, 1.0)
    assert np.abs(flown.error[:, :2]).max() < 0.35
    assert np.abs(flown.velocity_error[flown.t_s > 20.0]).max() < 0.2
    assert flown.reasons(Sensor.FLOW_RATE).get("innovation_gate", 0) <= 5


def test_one_that_reads_3_too_much_along_the_vertical_leaves_the_height_by_the_range():
    flown = lying(2, 2.0)
    assert np.abs(flown.error[:, 2] - flown.error[0, 2]).max() < 0.4  # the start is the origin
    assert len(flown.events("range", "reset")) == 0
    assert len(flown.events("imu", "doubted")) == 0


def test_an_accelerometer_that_reads_3_too_much_at_once_does_not_carry_the_position_off():
    assert np.abs(lying(0, 1e-9).error[:, :2]).max() < 5.0


def test_one_that_reads_6_too_much_along_the_vertical_at_once_leaves_the_height_by_the_range():
    flown = lying(2, 0.5, 6.0)
    assert np.abs(flown.error[:, 2] - flown.error[0, 2]).max() < 5.0


def lying_on_all_axes_at_once() -> Navigated:
    """A hover with all aids whose accelerometer reads 3 m/s2 too much on every axis from 10 s on."""
    return navigate(added_to(noisy(fly(still, 40.0)), Sensor.IMU, [0.0] * 3 + [3.0] * 3, 10.0))


def test_a_range_that_creeps_out_of_its_gate_makes_the_accelerometer_doubted_on_all_axes_and_no_new_ground():
    """3.0 m in height and 10.0 m level where it was a step of the ground, 20 m level where only down was doubted."""
    flown = lying_on_all_axes_at_once()
    assert len(flown.events("range", "reset")) == 0
    assert np.abs(flown.error[:, 2] - flown.error[0, 2]).max() < 0.2
    assert np.abs(flown.error[:, :2]).max() < 0.3


@pytest.mark.parametrize("slope_m_s", [0.02, 0.1, 0.3, 1.0])
def test_ground_that_slopes_below_does_not_make_the_accelerometer_doubted(slope_m_s):
    """The range alone tells of the slope, 1.5 m of it; the ground is a state that walks."""
    flown = noisy(fly(circle, 30.0))
    stream = flown.streams[Sensor.RANGE]
    slope_m = np.clip((stream.t_s - 10.0) * slope_m_s, 0.0, 1.5)
    run_ = navigate(flown.changed(Sensor.RANGE, value=stream.value + slope_m[:, None]))
    assert len(run_.events("imu", "doubted")) == 0


@pytest.mark.parametrize("step_m", [-1.0, 0.5, 1.0])
def test_a_step_of_the_ground_jumps_and_does_not_make_the_accelerometer_doubted(step_m):
    flown = noisy(fly(circle, 30.0))
    stream = flown.streams[Sensor.RANGE]
    stepped = stream.value + np.where(stream.t_s > 10.0, step_m, 0.0)[:, None]
    run_ = navigate(flown.changed(Sensor.RANGE, value=stepped))
    assert len(run_.events("imu", "doubted")) == 0


# -- ranges --------------------------------------------------------------------------------------------------
def test_a_range_of_which_every_other_reading_is_a_stray_keeps_the_height():
    flown = noisy(fly(circle, 30.0).only(*OWN))
    stream = flown.streams[Sensor.RANGE]
    stray = (np.arange(len(stream)) % 2 == 1) & (stream.t_s > 5.0)
    anywhere = np.random.default_rng(4).uniform(0.3, 6.0, (len(stream), 1))
    run_ = navigate(flown.changed(Sensor.RANGE, value=np.where(stray[:, None], anywhere, stream.value)))
    off = run_.error[:, 2] - np.median(run_.error[run_.t_s < 5.0, 2])
    assert np.abs(off).max() < 0.1
    assert len(run_.events("range", "reset")) == 0
    assert len(run_.events("imu", "doubted")) == 0


def echoing(lasts_s: float) -> Navigated:
    """Echoes at a third of the height, so long of every 4 s: the first may be strays, the others are refused."""
    flown = noisy(fly(circle, 30.0).only(*OWN, Sensor.BARO))
    stream = flown.streams[Sensor.RANGE]
    echo = (stream.t_s > 5.0) & (stream.t_s % 4.0 < lasts_s)
    return navigate(flown.changed(Sensor.RANGE, value=np.where(echo[:, None], stream.value / 3.0, stream.value)))


def test_a_refused_range_does_not_keep_the_flow_waiting():
    flown = echoing(1.0)
    assert flown.reasons(Sensor.RANGE)["innovation_gate"] > 50
    flow = (flown.offered.sensor == Sensor.FLOW_RATE) & (flown.offered.t_s > 1.0)
    assert set(flown.offered.reason[flow]) == {Reason.FUSED}
    assert np.abs(flown.error[:, :2]).max() < 1.0


def test_echoes_that_are_refused_do_not_move_the_height():
    flown = echoing(1.2)
    assert np.abs(flown.error[:, 2] - flown.error[0, 2]).max() < 0.3


def test_a_step_of_the_ground_below_a_range_that_is_alone_moves_the_height_by_no_more_than_itself():
    """Nothing tells a roof from a drop of 1.2 m; either way the vertical speed comes back to 0."""
    flown = fly(still, 20.0).only(*OWN)
    stream = flown.streams[Sensor.RANGE]
    value = np.where(stream.t_s[:, None] >= 10.0, stream.value - 1.2, stream.value)
    run_ = navigate(flown.changed(Sensor.RANGE, value=value))
    assert np.abs(run_.error[:, 2] - run_.error[0, 2]).max() < 2.5
    assert abs(run_.velocity_error[-1, 2]) < 0.1


# -- a compass -----------------------------------------------------------------------------------------------
def abroad(origin_deg_m: tuple[float, float, float] | None, declination_deg: float) -> Navigated:
    """A hover whose compass points so far from true north, navigated by one who knows the place, or does not."""
    flown = fly(still, 15.0, 0.2).without(Sensor.ATTITUDE)
    d = math.radians(declination_deg)
    level = FIELD_GAUSS[0] * np.array([math.cos(d), math.sin(d)])
    t_s = flown.streams[Sensor.MAG].t_s
    yaw = np.interp(t_s, flown.t_s, flown.yaw)
    field = body_axes(yaw, np.tile([*level, FIELD_GAUSS[2]], (len(t_s), 1)))
    flown = flown.changed(Sensor.MAG, value=field)
    queue: EventQueue = merge(flown.streams.values())
    told = NavigatorSettingsFile()
    on = start_navigator(equipment_of(flown.streams, 0.0, False, told, origin_deg_m), told, new_tape(queue))
    run(queue, on)
    return Navigated(on, flown)


def test_a_compass_of_12_deg_declination_heads_true_north():
    known, unknown = abroad((59.9, 30.3, 0.0), 12.1), abroad(None, 12.1)
    assert np.abs(known.yaw_error).max() < math.radians(1.0)
    assert unknown.yaw_error[0] == pytest.approx(-math.radians(12.1), abs=math.radians(1.0))


# -- a flow scale that nothing tells -------------------------------------------------------------------------
def away(t_s: np.ndarray) -> np.ndarray:
    """North at up to 2 m/s, from 3 s on; 2 m high."""
    t = np.clip(t_s - 3.0, 0.0, None)
    return np.column_stack([2.0 * t**2 / (t + 2.0), 0 * t, 0 * t - 2.0])


def test_without_a_fix_the_doubt_of_the_flows_scale_is_stated_by_the_way_from_the_start():
    flown = fly(away, 20.0)
    alone = navigate(flown.only(*OWN))
    way_m = alone.estimate_rows.pos_ned_m[:, 0]
    scale = alone.column(FLOW_SCALE)
    assert scale.max() == scale.min() == 0.0
    assert alone.sigma(FLOW_SCALE) == 0.0
    assert way_m[-1] > 25.0
    stated = alone.estimate_rows.std_pos_ned_m[:, 0]
    assert np.all(stated >= 0.1 * way_m)
    assert stated[-1] == pytest.approx(math.hypot(0.1 * way_m[-1], alone.sigma(0)), rel=1e-5)
    assert alone.estimate_rows.std_pos_ned_m[-1, 1] == pytest.approx(alone.sigma(1), abs=0.01)  # east it did not go
    fixed = navigate(flown)
    assert fixed.estimate_rows.std_pos_ned_m[-1, 0] == pytest.approx(fixed.sigma(0), rel=1e-3)
    assert 0.0 < fixed.sigma(FLOW_SCALE) < 0.1


def test_the_scales_doubt_covers_a_lens_that_scales_wrongly():
    flown = fly(away, 20.0).only(*OWN)
    stream = flown.streams[Sensor.FLOW_RATE]
    run_ = navigate(flown.changed(Sensor.FLOW_RATE, value=stream.value * [1.1, 1.1, 1.0, 1.0, 1.0, 1.0]))
    off = np.abs(run_.error[:, 0] - run_.error[0, 0])
    assert off[-1] > 2.0
    assert np.all(off < 2.0 * run_.estimate_rows.std_pos_ned_m[:, 0])


def test_a_hover_that_a_low_range_takes_for_the_ground_teaches_no_gyro_and_holds_no_velocity():
    """0.3 m up, where a sonar reads its least: steady, and a flow of swapped axes shows little motion."""
    flown = noisy(fly(lambda t: np.column_stack([0.05 * t, 0.0 * t, 0.0 * t - 0.3]), 20.0).only(*OWN))
    imu = flown.streams[Sensor.IMU]
    shaking = np.random.default_rng(9).normal(0.0, 1.0, imu.value.shape) * ([0.05] * 3 + [0.5] * 3)
    found = navigate(flown.changed(Sensor.IMU, value=imu.value + shaking))
    assert SHAKEN in found.events("filter", "standing")[:, 1]
    assert np.isnan(load_stand(found.on.work, ONE_LANE, 0).contact_m)
    assert found.sigma(GYRO_BIAS + 2) > 0.95 * NavigatorSettingsFile().gyro_bias_sigma_rad_s
