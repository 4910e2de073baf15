"""A flow sensor's own dynamics: when a delay stands for them, when they become states, and what each is worth.

`pytest -s tests/navigation/test_flow_dynamics.py` prints the table of docs/explanation/landing-filter.md.
"""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from flownav.core.compile import LANES, ONE_LANE, equation, unit
from flownav.core.errors import InputError
from flownav.core.measurement import Sensor
from flownav.core.parameter_files import shipped
from flownav.estimation import covariance
from flownav.estimation.lag import Lagged, LagLens, LagMove, lag_of_step, lag_over, move_lag
from flownav.estimation.named import Attitude, BodyRate, Height, VelocityNed
from flownav.estimation.states import FLOW_LAG, STATE
from flownav.logs.open_log import open_flight
from flownav.navigation.kernel_settings import FROM_MAG, Equipment
from flownav.navigation.loop import start_navigator
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.settings_of import settings_of
from flownav.navigation.smoother import smooth
from flownav.navigation.take import (
    navigate_lanes,
    navigate_lanes_with_lag,
    navigate_one,
    navigate_one_with_lag,
    navigator_unit,
)
from flownav.navigation.tape import new_tape
from flownav.replays.fed import as_fed
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import replay
from flownav.sensors.datasheet import (
    DEFAULT_SENSOR,
    DELAY_WITHIN_DEG,
    Dynamics,
    identified_flow,
    load_sensor,
    needs_lag_states,
    phase_off_delay_deg,
)
from flownav.simulation.assemble import assemble
from flownav.simulation.engine import buffers_of, fly_into, fly_one, fly_written
from flownav.simulation.fitting import Timing, refitted
from flownav.simulation.flight_record import record_of
from flownav.simulation.history import columns
from flownav.simulation.scenario import load_scenario
from navigation_streams import fly, navigate

SEED = 5
SETTLED = 500  # epochs
# m/s (docs/explanation/landing-filter.md): sixteen gusty landings, at the horizon and at present, with delay or states
IN_LANDINGS = {
    "2 Hz, damping 0.7": ((0.0205, 0.0224), (0.0207, 0.0225)),
    "2 Hz, damping 1.5": ((0.0217, 0.0306), (0.0216, 0.0235)),
    "0.5 Hz, damping 0.7": ((0.0261, 0.0351), (0.0232, 0.0250)),
}
SENSORS = {"2 Hz, damping 0.7": (2.0, 0.7), "2 Hz, damping 1.5": (2.0, 1.5), "0.5 Hz, damping 0.7": (0.5, 0.7)}


def dynamics(hz: float, damping: float) -> Dynamics:
    """Gain 1, this natural frequency and damping."""
    w = 2.0 * math.pi * hz
    return Dynamics(a_1_s2=w * w, b_1_s=2.0 * damping * w, c_1_s2=w * w)


def sensor_file(folder, name):
    """The shipped sensor with other dynamics, as a file."""
    text = shipped(DEFAULT_SENSOR).read_text()
    for key, value in dynamics(*SENSORS[name]).model_dump().items():
        text = re.sub(rf"^{key} = \{{.*$", f"{key} = {value}", text, count=1, flags=re.MULTILINE)
    path = folder / f"{name}.toml"
    path.write_text(text)
    return path


def setup_with(folder, name):
    """The gusty landing with such a sensor."""
    path = str(sensor_file(folder, name))
    return assemble(load_scenario("gusty").model_copy(update={"flow_sensor": path}))


def flight_with(setup, *, lagged):
    """The same vehicle, whose navigator takes the dynamics for a delay or carries them as states."""
    carried, flow = setup.fitted, setup.sensor.dynamics
    keys = {"flow_lag_b_1_s": flow.b_1_s, "flow_lag_c_1_s2": flow.c_1_s2} if lagged else {}
    settings = carried.given.settings.model_copy(update={"flow_lag_b_1_s": 0.0, "flow_lag_c_1_s2": 0.0} | keys)
    timing = carried.timing[Sensor.FLOW_RATE]
    stated = Timing(0.0 if lagged else flow.delay_s, timing.latency_s, timing.jitter_s)
    other = refitted(
        carried, setup.flight.plan.epochs, given=carried.given._replace(settings=settings),
        stated=carried.timing | {Sensor.FLOW_RATE: stated},
    )  # fmt: skip
    return setup.flight._replace(table=other.schedule, settings=other.settings)


def velocity_rms_m_s(flight):
    """Horizontal velocity error of sixteen flights: at the navigator's horizon, and at present, as the autopilot
    uses it.
    """
    buffers = buffers_of(flight, LANES, flight.plan.epochs, written=False)
    fly_into(flight, SEED, 0, LANES, buffers)
    names = ("vel_u_m_s", "vel_v_m_s")
    history = buffers.history[SETTLED:]
    then = history[:, columns("horizon", tuple(f"error_{name}" for name in names))]
    now = history[:, columns("estimate", names)] - history[:, columns("truth", names)]
    return tuple(float(np.sqrt(np.mean(np.sum(error**2, axis=1)))) for error in (then, now))


# -- which sensors need them ------------------------------------------------------------------------------------
def test_the_shipped_sensor_is_a_delay_to_the_navigator():
    sensor = load_sensor()
    assert phase_off_delay_deg(sensor.dynamics) == pytest.approx(3.62, abs=0.01)
    assert not needs_lag_states(sensor)
    told = settings_of(sensor).settings
    assert (told.flow_lag_b_1_s, told.flow_lag_c_1_s2) == (0.0, 0.0)
    assert identified_flow(sensor).latency_s == sensor.dynamics.delay_s


def test_a_sensor_of_2_hz_needs_states_where_it_is_damped_so_that_no_delay_follows_it():
    """At damping 0.7 the phase is as good as linear; at 1.5 it is a first-order lag of 0.2 s."""
    off = {name: phase_off_delay_deg(dynamics(*SENSORS[name])) for name in SENSORS}
    assert list(off.values()) == pytest.approx([2.92, 22.51, 23.45], abs=0.01)
    for name in SENSORS:
        sensor = load_sensor().model_copy(update={"dynamics": dynamics(*SENSORS[name])})
        lagged = off[name] > DELAY_WITHIN_DEG
        told = settings_of(sensor).settings
        assert needs_lag_states(sensor) is lagged
        assert told.flow_lag_c_1_s2 == (sensor.dynamics.c_1_s2 if lagged else 0.0)
        assert identified_flow(sensor).latency_s == (0.0 if lagged else sensor.dynamics.delay_s)


@pytest.mark.parametrize("dt_s", [1e-4, 0.001, 0.004, 0.01, 0.1])
@pytest.mark.parametrize("damping", [0.2, 0.7, 1.0, 1.5])
def test_the_dynamics_over_a_step_of_any_length_are_those_of_the_matrix_exponential(dt_s, damping):
    d = dynamics(2.0, damping)
    found = lag_of_step(d.b_1_s, d.c_1_s2, dt_s, 0.1, -0.2, 0.3)
    assert found[:11] == pytest.approx(lag_over(d.c_1_s2, d.b_1_s, d.c_1_s2, dt_s, 0.0, 0.3)[:11], rel=1e-9, abs=1e-12)
    assert found[11:] == (0.1, -0.2, 0.3)


def test_the_lens_swings_with_the_vehicle():
    """Level and heading north, a turn of 2 rad/s moves a lens 0.5 m ahead and 0.25 m to the right of the IMU."""
    moved = move_lag.law(
        Lagged(*(0.0,) * 4), VelocityNed(3.0, 4.0, 0.0), Height(-2.0, 0.0), Attitude(1.0, 0.0, 0.0, 0.0),
        BodyRate(0.0, 0.0, 2.0),
        move=LagMove(0.0, 0.0, 0.0, 0.0, 1.0, 0.0), lens=LagLens(0.0, 0.1, 0.5, 0.25, 0.1),
    )  # fmt: skip
    assert tuple(moved) == (3.0 - 2.0 * 0.25, 0.0, 4.0 + 2.0 * 0.5, 0.0)


def test_a_user_who_wants_no_states_gets_the_delay_back():
    """As the smoother asks for."""
    sensor = load_sensor().model_copy(update={"dynamics": dynamics(*SENSORS["2 Hz, damping 1.5"])})
    told = settings_of(sensor, stated=NavigatorSettingsFile(flow_lag_c_1_s2=0.0))
    assert not told.lag_states
    assert identified_flow(sensor, told.lag_states).latency_s == sensor.dynamics.delay_s


# -- what is compiled -------------------------------------------------------------------------------------------
@equation
def mark(work, lanes, lag):
    """A branch that no compiler can type stands where only lagged lanes come."""
    if lag is not None:
        work[0] = lanes.no_such_thing
    else:
        work[0] = float(covariance.states_of(lanes))


def mark_lanes(work, lanes):
    mark(work, lanes, covariance.lagged(lanes))


@pytest.mark.parametrize("lanes", [ONE_LANE, LANES])
def test_what_only_lagged_lanes_need_is_dropped_before_it_is_compiled(lanes):
    """It would cost a fifth of a navigator's compile time."""
    work = np.zeros(1)
    unit(mark_lanes, "p", lanes=lanes)(work)
    assert work[0] == 36.0


def test_a_default_flight_compiles_no_unit_with_lag(monkeypatch):
    def compiled():
        raise AssertionError("a unit with lag was compiled")

    for built in (navigate_one_with_lag, navigate_lanes_with_lag):
        monkeypatch.setattr(built, "_compile", compiled)
        monkeypatch.setattr(built, "_entry", None)
    assert np.isfinite(fly_one(assemble(load_scenario("gusty")).flight, SEED)[SETTLED:]).any()
    chosen = [navigator_unit(lanes, lag) for lanes in (ONE_LANE, LANES) for lag in (False, True)]
    assert chosen == [navigate_one, navigate_one_with_lag, navigate_lanes, navigate_lanes_with_lag]


def test_a_smoother_refuses_the_states_that_it_does_not_know(tmp_path):
    told = NavigatorSettingsFile(flow_lag_b_1_s=20.0, flow_lag_c_1_s2=150.0)
    flown = fly_written(assemble(load_scenario("gusty")).flight, SEED)
    setup = assemble(load_scenario("gusty"))
    path = tmp_path / "flight.fnr"
    record_of(setup, flown, SEED, 0).save(path)
    queue = open_flight(path).fed[0].queue
    running = start_navigator(Equipment(True, False, FROM_MAG, True, 10.0), told, new_tape(queue))
    with pytest.raises(InputError, match="flow_lag_c_1_s2 = 0"):
        smooth(queue, running)


# -- what it is worth -------------------------------------------------------------------------------------------
def swaying(t_s):
    """2 m above ground, swaying at 0.5 and 0.9 Hz with some decimetres a second, from a soft start."""
    soft = 1.0 - np.exp(-(np.clip(t_s, 0.0, None) ** 2) / 8.0)
    north = soft * (0.1 * np.sin(2.0 * np.pi * 0.5 * t_s) + 0.03 * np.sin(2.0 * np.pi * 0.9 * t_s))
    return np.column_stack([north, soft * 0.1 * np.cos(2.0 * np.pi * 0.5 * t_s), 0.0 * t_s - 2.0])


def seen_through(flown, d):
    """The flight whose flow sensor has these dynamics: its readings at their own instants."""
    lag = lag_over(d.c_1_s2, d.b_1_s, d.c_1_s2, flown.t_s[1] - flown.t_s[0], 0.0, 0.0)
    matrix, start, end = np.array(lag[:4]).reshape(2, 2), np.array(lag[4:6]), np.array(lag[6:8])
    speed, state = flown.velocity[:, :2], np.zeros((2, 2))
    seen = np.zeros_like(speed)
    for k in range(1, len(speed)):
        state = matrix @ state + np.outer(start, speed[k - 1]) + np.outer(end, speed[k])
        seen[k] = d.c_1_s2 * state[0]
    stream = flown.streams[Sensor.FLOW_RATE]
    forward, right = flown.at(stream.t_s, seen).T
    value = stream.value.copy()
    value[:, 0], value[:, 1] = -right / 2.0, forward / 2.0
    return flown.changed(Sensor.FLOW_RATE, value=value)


@pytest.fixture(scope="module")
def swayed():
    """Horizontal velocity error in a sway of known truth, exact sensors, GPS gone: with the delay, and with states."""
    found = {}
    print("\n| flow sensor | with the delay, m/s | with states, m/s |\n|---|---|---|")
    for name in SENSORS:
        d = dynamics(*SENSORS[name])
        flown = seen_through(fly(swaying, 40.0), d)
        for gps in (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY):
            flown = flown.cut(gps, 3.0, 99.0)
        delayed = flown.changed(Sensor.FLOW_RATE, delay_s=d.delay_s)
        runs = (navigate(delayed), navigate(flown, flow_lag_b_1_s=d.b_1_s, flow_lag_c_1_s2=d.c_1_s2))
        found[name] = [
            float(np.sqrt(np.mean(np.sum(run.velocity_error[run.t_s > 10.0, :2] ** 2, axis=1)))) for run in runs
        ]
        print(f"| {name} | {found[name][0]:.4f} | {found[name][1]:.4f} |")
    return found


def test_states_leave_nothing_of_what_a_delay_gets_wrong(swayed):
    for delayed, lagged in swayed.values():
        assert lagged < 0.003
        assert lagged < delayed
    assert swayed["2 Hz, damping 1.5"][0] > 4.0 * swayed["2 Hz, damping 1.5"][1]


@pytest.fixture(scope="module")
def worth(tmp_path_factory):
    """Velocity errors of each sensor, with a delay and with states; printed as the docs have them."""
    folder = tmp_path_factory.mktemp("sensors")
    found = {}
    print("\n| flow sensor | phase off the delay | chosen | with the delay, m/s | with states, m/s |")
    print("|---|---|---|---|---|")
    for name in SENSORS:
        setup = setup_with(folder, name)
        found[name] = [velocity_rms_m_s(flight_with(setup, lagged=lagged)) for lagged in (False, True)]
        off, chosen = phase_off_delay_deg(setup.sensor.dynamics), needs_lag_states(setup.sensor)
        figures = " | ".join(f"{then:.4f}, at present {now:.4f}" for then, now in found[name])
        print(f"| {name} | {off:.1f}° | {'states' if chosen else 'delay'} | {figures} |")
    return found


def test_the_worth_of_each_in_a_landing_is_what_the_docs_say(worth):
    for name, figures in IN_LANDINGS.items():
        np.testing.assert_allclose(worth[name], figures, rtol=0.05)


def test_states_are_worth_something_where_a_delay_cannot_follow_and_nothing_where_it_can(worth):
    ratio = {name: np.divide(delayed, lagged) for name, (delayed, lagged) in worth.items()}
    assert ratio["2 Hz, damping 0.7"] == pytest.approx([1.0, 1.0], abs=0.03)
    assert ratio["2 Hz, damping 1.5"][0] == pytest.approx(1.0, abs=0.03)  # at the horizon
    assert ratio["2 Hz, damping 1.5"][1] > 1.2  # at present
    assert min(ratio["0.5 Hz, damping 0.7"]) > 1.1


def test_a_flight_with_lag_states_replays_to_the_same_bits_and_is_the_same_of_sixteen(tmp_path):
    setup = setup_with(tmp_path, "2 Hz, damping 1.5")
    alone = fly_written(setup.flight, SEED, 3)
    sixteen = fly_written(setup.flight, SEED, 0, LANES)
    np.testing.assert_array_equal(alone.history[:, :, 0], sixteen.history[:, :, 3])
    path = tmp_path / "flight.fnr"
    record_of(setup, alone, SEED, 3).save(path)
    log = open_flight(path)
    again = replay(log, *as_fed(log, ReplayOptions(), None))
    np.testing.assert_array_equal(again.estimate, alone.tape.estimates())
    np.testing.assert_array_equal(again.innovation, alone.tape.offers())


def test_the_carried_states_follow_the_velocity(tmp_path):
    """c x1 is the velocity of some 0.2 s ago."""
    setup = setup_with(tmp_path, "2 Hz, damping 1.5")
    buffers = buffers_of(setup.flight, ONE_LANE, setup.flight.plan.epochs, written=True)
    fly_into(setup.flight, SEED, 0, ONE_LANE, buffers)
    c = setup.sensor.dynamics.c_1_s2
    seen = c * buffers.nav[[STATE + FLOW_LAG, STATE + FLOW_LAG + 2]]
    truth = buffers.history[-40:, columns("truth", ("vel_u_m_s", "vel_v_m_s")), 0]
    assert np.all(seen > truth.min(axis=0) - 0.1)
    assert np.all(seen < truth.max(axis=0) + 0.1)
