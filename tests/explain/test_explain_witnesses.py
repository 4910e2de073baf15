"""Signs that ask more than one witness, or each as far as it knows: gains, steps of the ground, motors, drag."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flownav.core.measurement import Sensor, Stream
from flownav.logs.log import Log
from flownav.studies.explain import body_signs, flow_signs, height_signs, place_signs
from flownav.studies.explain.aloft import Own
from flownav.studies.explain.case import Case
from flownav.studies.explain.sign import Sign
from flownav.studies.explain.signals import Fit, lagged_fit

T_S = np.arange(0.0, 60.0, 0.05)


def case(streams: dict[Sensor, np.ndarray], **known: object) -> Case:
    """A log of streams at T_S, and what is worked out of it already."""
    found = Case(Log(Path("log"), {sensor: Stream.of(sensor, T_S, value) for sensor, value in streams.items()}))
    found.__dict__.update(known)
    return found


# -- the flow's gain -----------------------------------------------------------------------------------------------
@pytest.mark.parametrize("turn", [0.0, 0.5 * np.pi])
def test_a_gain_is_known_as_well_as_its_better_axis(turn):
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    sigma = np.array([[0.05, 0.20], [0.05, 0.20]])
    gain, error = flow_signs.gain_of(Fit(rotation @ np.diag([1.4, 1.3]), sigma, 0.0, 0.9))
    assert gain == pytest.approx((1.4 / 0.05**2 + 1.3 / 0.20**2) / (1.0 / 0.05**2 + 1.0 / 0.20**2))
    assert error == pytest.approx((1.0 / 0.05**2 + 1.0 / 0.20**2) ** -0.5)


def test_axes_that_contradict_each_other_make_no_gain_unless_they_are_known_to_differ():
    fit = Fit(np.diag([0.2, 0.8]), np.full((2, 2), 0.04), 0.0, 0.3)
    assert flow_signs.gain_of(fit)[1] > 5.0 * flow_signs.gain_of(fit, uneven=True)[1]
    sheared = Fit(np.array([[0.5, 0.3], [0.3, 0.5]]), np.full((2, 2), 0.04), 0.0, 0.3)
    assert flow_signs.gain_of(sheared, uneven=True)[1] > 0.15


@pytest.mark.parametrize("gain", [1.0, 0.5])
def test_noise_of_the_vehicles_gyro_is_no_slow_gyro_of_the_sensor(gain):
    chance = np.random.default_rng(3)
    turning = np.column_stack([np.sin(1.3 * T_S), np.cos(1.1 * T_S)])
    noisy = turning + 0.8 * chance.standard_normal(turning.shape)
    fit = lagged_fit(T_S, gain * turning, T_S, noisy, np.array([0.0]))
    assert np.diag(fit.matrix).max() < 0.7 * gain
    assert flow_signs._beyond(fit, np.eye(2)) == pytest.approx(1.0 - gain, abs=0.05)


# -- a step of the ground ------------------------------------------------------------------------------------------
def steps(moves: bool) -> Sign:
    """The range falls by 0.6 m at 30 s, with the vehicle, or without it while its own height follows the range."""
    range_m = np.where(T_S < 30.0, 2.0, 1.4) if not moves else 2.0 - np.clip(0.8 * (T_S - 30.0), 0.0, 0.6)
    range_m = range_m + 0.01 * np.sin(T_S)  # one value that is repeated would be no echo
    velocity = np.zeros((len(T_S), 3))
    velocity[:, 2] = np.where(moves & (T_S >= 30.0) & (T_S < 30.75), 0.8, 0.0)
    own = Own(T_S, np.column_stack([np.zeros((len(T_S), 2)), -range_m]), velocity, True)
    found = height_signs.terrain(case({Sensor.RANGE: range_m[:, None]}, own=own, flight_s=(5.0, 55.0)))
    assert isinstance(found, Sign)
    return found


def test_a_step_of_the_ground_is_one_to_the_vehicles_own_velocity():
    assert steps(moves=False).strength > 1.0
    assert steps(moves=True).strength == 0.0


# -- motors beside the compass -------------------------------------------------------------------------------------
def pushed(lands_pushed: bool) -> Sign:
    """A field that is half as strong in flight, from 15 to 45 s; where it lands, as it was or as it is."""
    aloft = (T_S > 15.0) & ((T_S < 45.0) | lands_pushed)
    field = np.where(aloft[:, None], [0.1, 0.0, 0.2], [0.2, 0.0, 0.4])
    level = np.zeros((len(T_S), 4))
    level[:, 0] = 1.0
    streams = {Sensor.MAG: field, Sensor.ATTITUDE: level}
    found = place_signs.motors(case(streams, flight_s=(15.0, 45.0), rates=(T_S, np.zeros((len(T_S), 3)))))
    assert isinstance(found, Sign)
    return found


def test_what_the_motors_push_is_gone_when_they_stop():
    assert pushed(lands_pushed=False).strength > 1.0
    assert pushed(lands_pushed=True).strength < 0.1


# -- drag ----------------------------------------------------------------------------------------------------------
def test_where_gps_ends_the_drag_goes_by_the_flows_speed():
    heard = T_S[T_S < 20.0]
    forward = np.where(T_S < 20.0, 0.0, 2.0)
    level = np.zeros((len(T_S), 4))
    level[:, 0] = 1.0
    known = {
        "gps_velocity": (heard, np.zeros((len(heard), 3))),
        "flow_velocity": (T_S, np.column_stack([forward, np.zeros(len(T_S))])),
    }
    speed = body_signs._body_speed(case({Sensor.ATTITUDE: level}, **known), T_S, 5)
    assert speed is not None
    assert np.abs(speed[T_S < 19.0]).max() == 0.0
    assert speed[T_S > 22.0, 0] == pytest.approx(2.0)
