"""Servos: second order where nothing binds, and travel and rate limits that hold."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from flownav.vehicle.drive import Servo, acceleration, blade_angle

SERVO = Servo(50.0, 0.7, 1.2, -0.14, 0.14, 0.0)


def respond(command, servo=SERVO, until=0.5, start=(0.0, 0.0)):
    times = np.linspace(0.0, until, 501)
    solution = solve_ivp(
        lambda _t, y: [y[1], acceleration(y[0], y[1], command, servo)],
        (0.0, until),
        start,
        t_eval=times,
        rtol=1e-9,
        atol=1e-12,
        max_step=1e-3,
    )
    return times, solution.y


def test_a_small_step_is_the_second_order_response():
    step, (wn, zeta) = 0.01, (50.0, 0.7)
    times, (position, _) = respond(step)
    damped = wn * np.sqrt(1 - zeta**2)
    decay = np.exp(-zeta * wn * times)
    exact = step * (1 - decay * (np.cos(damped * times) + zeta * wn / damped * np.sin(damped * times)))
    assert np.abs(position - exact).max() < 1e-7


def test_the_rate_limit_holds_and_is_used():
    _, (_, rate) = respond(0.14)
    assert rate.max() <= SERVO.rate_limit_rad_s
    assert rate.max() > 0.98 * SERVO.rate_limit_rad_s


def test_a_command_beyond_the_travel_ends_at_the_stop():
    for command, stop in ((9.0, 0.14), (-9.0, -0.14)):
        _, (position, _) = respond(command, until=1.0)
        assert position[-1] == pytest.approx(stop, abs=1e-6)


def test_the_blade_never_passes_the_stop():
    assert blade_angle(0.15, SERVO) == 0.14
    assert blade_angle(-0.15, SERVO) == -0.14
    assert blade_angle(0.05, SERVO) == 0.05


def test_slop_leaves_an_error_within_its_band_and_answers_the_rest():
    slack = SERVO._replace(dead_band_rad=0.002)
    assert acceleration(0.01, 0.0, 0.0119, slack) == 0.0
    assert acceleration(0.01, 0.0, 0.0081, slack) == 0.0
    assert acceleration(0.01, 0.0, 0.0121, slack) == pytest.approx(acceleration(0.01, 0.0, 0.0101, SERVO))
    ends = [respond(0.05, slack, until=1.0, start=(start, 0.0))[1][0][-1] for start in (0.04, 0.06)]
    assert np.abs(np.array(ends) - 0.05).max() <= 0.002
    assert abs(ends[1] - ends[0]) > 0.001  # where it stops depends on where it comes from: play
