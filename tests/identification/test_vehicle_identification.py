"""A vehicle identified from its commands: the law's own parameters back, axioms, logs that show too little, a file."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.stats import binom, binomtest
from typer.testing import CliRunner

from flownav.cli import app
from flownav.control.design import nominal_model
from flownav.core.errors import InputError
from flownav.core.record import Record
from flownav.lab.identification.axis_fit import UNKNOWN, Axis, solved
from flownav.lab.identification.axis_laws import AxisResponse, body_left, rotor_left, servo_answer
from flownav.lab.identification.commanded import (
    MULTIROTOR,
    Commanded,
    Source,
    Timed,
    on_one_clock,
    read_commanded,
    source_of_record,
)
from flownav.lab.identification.excited import Spectra, overlap_factor, spectra
from flownav.lab.identification.vehicle_file import moved_entries, vehicle_entries
from flownav.lab.identification.vehicle_parameters import identify_vehicle
from flownav.vehicle.kinds import load_vehicle
from flownav.vehicle.trim import trim

VEHICLE = load_vehicle()
STATED = nominal_model(VEHICLE, trim(VEHICLE), -1)
QUAD = load_vehicle("quad-450")
STEP_S = 0.01


# -- the laws and their fit ---------------------------------------------------------------------------------------
def lines(seed=1, count=12):
    rng = np.random.default_rng(seed)
    w = np.linspace(5.0, 26.0, count)
    own, other = (rng.standard_normal(count) + 1j * rng.standard_normal(count) for _ in range(2))
    return AxisResponse(w, own, 0.1 * other, np.zeros(count, complex))


def seen_once(found):
    """Spectra of three windows that show these responses to a set-point of one, without noise."""
    signals = {name: np.tile(getattr(found, name), (3, 1)) for name in ("own", "other", "command")}
    return Spectra(found.w_rad_s, np.ones((3, len(found.w_rad_s)), complex), signals, 0.0)


def test_without_noise_the_rotors_parameters_come_back_exactly():
    true = np.array([0.3, -0.2, 0.15, -0.1, 0.0, 0.0, 0.0, 0.0, 0.0])
    axes = []
    for pitch in (False, True):
        quiet = lines(2 + pitch)
        needed = rotor_left(quiet, true, pitch, 0.9, STATED).rest
        shown = seen_once(quiet._replace(command=needed))
        axes.append(Axis(shown, lambda seen, x, pitch=pitch: rotor_left(seen, x, pitch, 0.9, STATED)))
    fit = solved(axes, (UNKNOWN,) * 4 + (0.0,) * 5)
    assert fit.x == pytest.approx(true, abs=1e-7)


def test_the_laws_derivatives_are_those_of_differences():
    seen, h = lines()._replace(command=lines(9).own), 1e-6
    x = np.array([0.1, -0.1, 0.2, 0.1, -0.05, 0.02, 0.3, -0.2, 0.001])
    for law, at in (
        (lambda x: rotor_left(seen, x, True, 0.8, STATED), x),
        (lambda x: rotor_left(seen, x, False, 0.8, STATED), x),
        (lambda x: body_left(seen, x, (60.0, 0.03)), np.array([0.2, -0.1, 0.7])),
    ):
        for k in range(len(at)):
            step = h * np.eye(len(at))[k]
            slope = (law(at + step).rest - law(at - step).rest) / (2.0 * h)
            assert slope == pytest.approx(law(at).slopes[:, k], rel=1e-5, abs=1e-6)


def test_a_servo_answers_all_without_slop_and_less_of_a_smaller_command():
    t = STEP_S * np.arange(800)
    command = 0.01 * np.sin(8.0 * t) + 0.01 * np.sin(17.0 * t)
    assert servo_answer(command, STEP_S, STATED, 0.0) == pytest.approx(1.0)
    large, small = (servo_answer(size * command, STEP_S, STATED, 0.0009) for size in (1.0, 0.3))
    assert 0.2 < small < large < 1.0


def test_windows_half_over_each_other_share_what_their_noise_shares():
    """The variance of an average against a tone, by many draws of white noise."""
    rng, t = np.random.default_rng(4), STEP_S * np.arange(2000)
    setpoint, ends = np.sin(2.0 * np.pi * 2.0 * t), []
    for _ in range(400):
        found = spectra(STEP_S, setpoint, {"noise": rng.standard_normal(len(t))}, 3.0)
        k = int(np.argmax(np.sum(np.abs(found.setpoint) ** 2, axis=0)))
        ends.append(np.sum(np.conj(found.setpoint) * found.signals["noise"], axis=0)[k])
    alone = np.sum(np.abs(found.setpoint[:, k]) ** 2) * np.sum(np.hanning(401)[:-1] ** 2)
    assert np.mean(np.abs(ends) ** 2) / alone == pytest.approx(overlap_factor(found)[k], rel=0.2)


# -- a multirotor in closed loop ----------------------------------------------------------------------------------
POWER, LAG_S = (80.0, 60.0), 0.04


def quad_flight(seed=1, gust=3.0, seconds=60.0, scale=1.0, mirror=1.0, moved=1.0):
    """A body that its motors turn late, under a rate loop that follows set-points, in coloured gusts."""
    rng, part = np.random.default_rng(seed), 5
    count, dt = round(seconds / STEP_S), STEP_S / part
    asked = np.zeros((count, 2))
    for axis in (0, 1):
        phases = rng.uniform(0.0, 2.0 * np.pi, 28)
        hz = 0.25 * np.arange(3, 31)
        asked[:, axis] = (
            moved * 0.25 * np.cos(2.0 * np.pi * np.outer(STEP_S * np.arange(count), hz) + phases).sum(axis=1)
        )
    rates, commands = np.zeros((count, 3)), np.zeros((count, 4))
    for axis in (0, 1):
        power = POWER[axis]
        a = np.array([[0.0, power, 1.0], [0.0, -1.0 / LAG_S, 0.0], [0.0, 0.0, -2.0]])
        whole = expm(np.block([[a, np.array([[0.0], [1.0 / LAG_S], [0.0]])], [np.zeros((1, 4))]]) * dt)
        x = np.zeros(3)
        for k in range(count):
            u, rates[k, axis] = 8.0 / power * (asked[k, axis] - x[0]), x[0]
            commands[k, axis] = u
            for _ in range(part):
                x = whole[:3, :3] @ x + whole[:3, 3] * u
                x[2] += gust * np.sqrt(4.0 * dt) * rng.standard_normal()
    commands[:, 2] = 0.5
    force = np.zeros((count, 3))
    force[:, 2] = -9.80665
    sides = np.array([mirror, 1.0])
    return Commanded(
        "a quad", MULTIROTOR, STEP_S, scale * commands * np.array([mirror, 1.0, 1.0, 1.0]),
        rates * np.array([mirror, 1.0, 1.0]), force, asked * sides, None, False, 8.0, "commands", "set", False,
        commands_late_s=-0.5 * STEP_S,
    )  # fmt: skip


def numbers(found):
    return {one.key: one.interval for one in found.found if one.interval is not None}


def test_without_gusts_a_quad_is_identified_as_it_is():
    found = numbers(identify_vehicle(quad_flight(gust=0.0), QUAD))
    for axis, power in zip(("roll", "pitch"), POWER, strict=True):
        assert found[f"{axis}_power_rad_s2"].value == pytest.approx(power, rel=0.02)
        assert found[f"{axis}_lag_s"].value == pytest.approx(LAG_S, rel=0.03)
    assert found["thrust_by_command_m_s2"].value == pytest.approx(2.0 * 9.80665)


def test_in_gusts_intervals_of_a_closed_loop_hold_the_truth():
    """Regression of command on rate would show the rate loop's gain; 24 flights, four numbers of each."""
    inside, count = 0, 24
    for seed in range(count):
        found = numbers(identify_vehicle(quad_flight(seed + 10, seconds=24.0), QUAD))
        for axis, power in zip(("roll", "pitch"), POWER, strict=True):
            for key, true in ((f"{axis}_power_rad_s2", power), (f"{axis}_lag_s", LAG_S)):
                inside += found[key].low <= true <= found[key].high
    assert binomtest(inside, 4 * count, 0.95, alternative="less").pvalue > 1e-6
    assert inside >= 0.85 * 4 * count


def test_commands_in_another_unit_and_a_mirrored_flight_change_what_they_must():
    plain = numbers(identify_vehicle(quad_flight(), QUAD))
    scaled = numbers(identify_vehicle(quad_flight(scale=0.5), QUAD))
    assert scaled["roll_power_rad_s2"].value == pytest.approx(2.0 * plain["roll_power_rad_s2"].value, rel=1e-4)
    assert scaled["thrust_by_command_m_s2"].value == pytest.approx(2.0 * plain["thrust_by_command_m_s2"].value)
    assert scaled["roll_lag_s"].value == pytest.approx(plain["roll_lag_s"].value, rel=1e-4)
    mirrored = numbers(identify_vehicle(quad_flight(mirror=-1.0), QUAD))
    assert mirrored["roll_power_rad_s2"] == pytest.approx(plain["roll_power_rad_s2"], rel=1e-4)


def test_what_hardly_moves_has_no_number_and_says_so():
    found = identify_vehicle(quad_flight(moved=0.001), QUAD)
    none = {one.key: one.why for one in found.found if one.interval is None}
    assert none["roll_power_rad_s2"].startswith("too little excitation")
    assert none["drag_x_1_s"] == "no specific force beside a velocity"
    still = quad_flight()._replace(setpoint=None)
    assert "no set-point" in next(one.why for one in identify_vehicle(still, QUAD).found if one.key == "pitch_lag_s")


def test_drag_is_the_slope_of_specific_force_by_speed():
    flight, rng = quad_flight(gust=0.0), np.random.default_rng(3)
    speed = np.column_stack([2.0 * np.sin(0.3 * STEP_S * np.arange(len(flight.rates)))] * 2)
    force = flight.force.copy()
    force[:, :2] = -0.3 * speed + 0.1 + 0.05 * rng.standard_normal(speed.shape)
    drag = numbers(identify_vehicle(flight._replace(force=force, velocity=speed), QUAD))["drag_x_1_s"]
    assert drag.value == pytest.approx(0.3, rel=0.02)
    assert drag.low < 0.3 < drag.high < 0.32


def test_a_file_of_another_kind_of_vehicle_is_refused():
    with pytest.raises(InputError, match="a multirotor's log, and the vehicle file is of another kind"):
        identify_vehicle(quad_flight(seconds=8.0), VEHICLE)


# -- the file -----------------------------------------------------------------------------------------------------
def test_the_file_is_a_vehicle_that_has_what_was_found():
    flight = quad_flight(gust=0.0)
    found = identify_vehicle(flight._replace(path=Path("a.ulg")), QUAD)
    contents = vehicle_entries(found, "quad-450", "mine")
    from flownav.control.design import control_powers
    from flownav.vehicle.kinds import flattened, hover_of, read_kind

    vehicle = flattened(read_kind(contents, "mine"))
    roll, pitch, _, heave = control_powers(vehicle, hover_of(vehicle))
    assert heave == pytest.approx(found.interval("thrust_by_command_m_s2").value, rel=0.04)  # the battery sags
    assert roll == pytest.approx(found.interval("roll_power_rad_s2").value, rel=0.04)
    assert pitch == pytest.approx(found.interval("pitch_power_rad_s2").value, rel=0.04)
    assert 1.0 / vehicle.motor_rate_1_s == pytest.approx(LAG_S, rel=0.03)
    keys = {entry.key for entry in moved_entries(found, "quad-450")}
    assert keys == {
        "body.inertia_xx_kg_m2",
        "body.inertia_yy_kg_m2",
        "motor.time_constant_s",
        "propeller.thrust_coefficient",
    }
    assert "identified: " in contents["body"]["inertia_xx_kg_m2"]["source"]


# -- logs ---------------------------------------------------------------------------------------------------------
def test_a_flight_is_its_longest_stretch_in_the_air_without_gaps():
    t = np.arange(0.0, 60.0, 0.02)
    t = t[(t < 20.0) | (t > 22.0)]
    signal = Timed(t, np.zeros((len(t), 4)))
    landed = Timed(np.array([0.0, 5.0, 50.0]), np.array([[1.0], [0.0], [1.0]]))
    source = Source(MULTIROTOR, signal, Timed(t, np.zeros((len(t), 3))), None, signal, None, landed, False, "c", "s")
    assert on_one_clock("a log", source).span_s == pytest.approx(28.0, abs=0.1)
    down = landed._replace(value=np.ones((3, 1)))
    with pytest.raises(InputError, match=r"a log: 0\.0 s in the air with commands and rates; 8 s are needed"):
        on_one_clock("a log", source._replace(landed=down))


def test_a_log_without_commands_says_so_in_one_line(tmp_path):
    with pytest.raises(InputError, match="no commands are read from this kind of log"):
        read_commanded(tmp_path)
    with pytest.raises(InputError, match="the record holds no commands"):
        source_of_record("a.fnr", Record({}))


def test_the_real_helicopters_log_shows_its_simulators_drag(data_folder, tmp_path):
    """ArduPilot's helicopter brakes by 0.125 and 0.375 per second; 10 rows a second show no stiffness."""
    log, out = data_folder / "dataflash" / "heli_sitl_takeoff_square_land.bin", tmp_path / "v.toml"
    told = CliRunner().invoke(app, ["identify", "--vehicle", str(log), "--out", str(out), "--json"])
    facts = json.loads(told.stdout)
    rows = {row["key"]: row for row in facts["parameters"]}
    for key, true in (("drag_x_1_s", 0.125), ("drag_y_1_s", 0.375)):
        assert rows[key]["low"] <= true <= rows[key]["high"]
    assert 15.0 < rows["pitch_rate_by_cyclic_1_s"]["value"] < 30.0
    assert rows["roll_stiffness_1_s2"]["value"] is None
    assert "too little excitation" in rows["roll_stiffness_1_s2"]["why_none"]
    shown = CliRunner().invoke(app, ["identify", "--vehicle", str(log), "--out", str(out)])
    assert len(shown.stdout.splitlines()) <= 20
    assert not out.exists()  # nothing found moves an entry


def test_options_of_a_flow_sensor_are_refused(data_folder):
    log = data_folder / "dataflash" / "heli_sitl_takeoff_square_land.bin"
    told = CliRunner().invoke(app, ["identify", "--vehicle", str(log), "--order", "2"])
    assert told.exit_code != 0


# -- our own flights ----------------------------------------------------------------------------------------------
def test_intervals_of_flown_vehicles_hold_their_truth(tmp_path):
    """Sixteen drawn helicopters, four numbers of each; half as wide they fail (tools/vehicle_coverage.py)."""
    from flownav.simulation.assemble import assemble
    from flownav.simulation.scenario import load_scenario
    from vehicle_coverage import flights

    rows = [row for each in flights(assemble(load_scenario("approach")), 77, 16) for row in each.values()]
    value, low, high, true = np.array(rows).T
    inside = int(np.sum((low <= true) & (true <= high)))
    shown = int(np.sum(np.isfinite(value)))
    assert shown >= 0.9 * len(rows)
    assert binom.cdf(inside, shown, 0.95) > 1e-6
    halved = int(np.sum(np.abs(true - value) <= 0.25 * (high - low)))
    assert binom.cdf(halved, shown, 0.95) < 1e-3


def test_a_helicopters_file_has_the_stiffnesses_that_were_found():
    """A soft hub is no heavy body: both stiffnesses at 0.7 of the stated ones would make inertias that cannot be."""
    from flownav.lab.identification.quantities import Interval
    from flownav.lab.identification.vehicle_parameters import Found, Identified
    from flownav.vehicle.kinds import flattened, read_kind

    stated = {"pitch_stiffness_1_s2": STATED.pitch_stiffness_1_s2, "roll_stiffness_1_s2": STATED.roll_stiffness_1_s2}
    shares = {"pitch_stiffness_1_s2": 0.6, "roll_stiffness_1_s2": 0.9}
    rows = tuple(
        Found(key, key, "1/s2", Interval.of(shares[key] * value, 0.02 * value), "") for key, value in stated.items()
    )
    found = Identified(quad_flight(seconds=8.0)._replace(path=Path("a.fnr"), kind="helicopter", exact=True), rows, ())
    vehicle = flattened(read_kind(vehicle_entries(found, "maxi-joker-3", "mine"), "mine"))
    own = nominal_model(vehicle, trim(vehicle), -1)
    for key, value in stated.items():
        assert getattr(own, key) == pytest.approx(shares[key] * value, rel=1e-3)
