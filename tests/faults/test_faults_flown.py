"""Faults in the closed loop: the law of a failed sensor, what becomes of the flights, the command."""

from __future__ import annotations

import json

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from flownav.campaigns.faults.catalogue import DOES, FAULTS, NOT_FLOWN, law_of
from flownav.campaigns.faults.flown import flown_table, scenario_flown, window_start
from flownav.cli import faults as faults_command
from flownav.core.compile import LANES
from flownav.core.errors import InputError
from flownav.core.measurement import COLUMNS, Sensor, Stream
from flownav.navigation.records import Reading
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.simulation.assemble import assemble
from flownav.simulation.engine import fly_written
from flownav.simulation.fault_injection import FaultNormals, failed, strikes
from flownav.simulation.truth import SOUND

BY_CHANCE = ("flow_garbage", "low_texture", "low_texture_unsaid", "range_spikes", "accel_vibration")
AHEAD = ("gps_clock", "flow_clock")  # a receiver does not feed what is stamped ahead of its clock
PERIOD_S, READINGS = 0.0201, 1000
T0_S, T1_S = 50 * PERIOD_S, 19.0
SHIPPED = NavigatorSettingsFile()
GPS_M = 2.45 * np.hypot(np.hypot(SHIPPED.gps_slow_sigma_m, SHIPPED.gps_fast_sigma_m), SHIPPED.gps_white_sigma_m)  # 95 %
NO_NORMALS = FaultNormals(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
SENSORS = (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY, Sensor.FLOW_RATE, Sensor.RANGE, Sensor.IMU, Sensor.BARO,
           Sensor.MAG, Sensor.PAD, Sensor.LANDED)  # fmt: skip


def stream(sensor):
    """Twenty seconds of anything, at 50 Hz."""
    t_s = PERIOD_S * np.arange(READINGS)
    width = len(COLUMNS[sensor])
    value = np.random.default_rng(int(sensor)).uniform(0.5, 1.5, (READINGS, width))
    return Stream.of(sensor, t_s, value, quality=np.full(READINGS, 180.0))


def by_law(name, given, normals=lambda k: NO_NORMALS, course_rad=0.0):
    """The stream as the flight's law has it, reading by reading; what is lost is left out."""
    law = law_of(FAULTS[name], T0_S, T1_S, course_rad, PERIOD_S)
    readings = []
    for k, row in enumerate(given.value):
        values = [*row[:6], *[0.0] * (6 - len(row[:6]))]
        readings.append(Reading(*values, np.nan, np.nan, np.nan, given.quality[k], 1.0, 0.0))
    held = given.value[49, 0]
    said = []
    for k, (t_s, read) in enumerate(zip(given.t_s, readings, strict=True)):
        on = T0_S <= t_s < T1_S and strikes(given.sensor, law)
        after = failed(read, readings[k - int(law.late_readings)], held, t_s - T0_S, normals(k), law) if on else read
        if after.arrived > 0.0:
            said.append([t_s, *after[: given.value.shape[1]], after.quality])
    return np.array(said)


@pytest.mark.parametrize("name", [name for name in DOES if name not in (*BY_CHANCE, *AHEAD)])
@pytest.mark.parametrize("sensor", SENSORS)
def test_a_failed_sensor_says_in_flight_what_the_injector_puts_into_a_log(name, sensor):
    given = stream(sensor)
    injected = FAULTS[name].inject(
        {sensor: given, **({} if sensor in FAULTS[name].sensors else alien(name))}, T0_S, T1_S
    )
    course_rad = 0.0
    if name in ("gps_jump", "gps_drift") and sensor == Sensor.GPS_POSITION:
        away = (injected[sensor].value - given.value)[900]
        course_rad = np.arctan2(away[1], away[0])
    said, want = by_law(name, given, course_rad=course_rad), injected[sensor]
    np.testing.assert_allclose(said[:, 0], want.t_s)
    np.testing.assert_allclose(said[:, 1:-1], want.value, atol=1e-12)
    np.testing.assert_array_equal(said[:, -1], want.quality)


def alien(name):
    """A stream that the fault does strike."""
    sensor = FAULTS[name].sensors[0]
    return {sensor: stream(sensor)}


@pytest.mark.parametrize("name", BY_CHANCE)
def test_chance_is_as_large_in_flight_as_in_a_log(name):
    sensor = next(s for s in FAULTS[name].sensors if s in SENSORS)
    given = stream(sensor)
    rng = np.random.default_rng(1)
    said = by_law(name, given, lambda k: FaultNormals(*rng.standard_normal(6)))
    want = FAULTS[name].inject({sensor: given}, T0_S, T1_S, seed=3)[sensor]
    struck = (given.t_s >= T0_S) & (given.t_s < T1_S)
    ours, theirs = (values[struck] - given.value[struck] for values in (said[:, 1:-1], want.value))
    np.testing.assert_allclose(ours.std(axis=0), theirs.std(axis=0), rtol=0.15, atol=1e-9)
    np.testing.assert_allclose(ours.mean(axis=0), theirs.mean(axis=0), atol=0.4)
    np.testing.assert_array_equal(said[:, -1], want.quality)
    np.testing.assert_array_equal(said[~struck, 1:-1], given.value[~struck])


def test_every_fault_is_flown_but_what_a_receivers_queue_sorts_out():
    assert set(DOES) | set(NOT_FLOWN) == set(FAULTS)
    assert NOT_FLOWN == ("duplicates", "out_of_order")
    for name in AHEAD:
        assert law_of(FAULTS[name], T0_S, T1_S).lost == 1.0


# -- flights -------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def flown():
    """Half a minute of flights on faulty estimates."""
    faults = [FAULTS[name] for name in ("gps_jump", "flow_sign", "silence")]
    return {(row.fault, row.duration_s): row for row in flown_table(faults, (1.5,), (20.0,))}


@pytest.fixture(scope="module")
def rows(flown):
    return {key: row.entry() for key, row in flown.items()}


def test_a_vehicle_without_a_fault_lands_and_nothing_is_said(rows):
    row = rows["none", 0.0]
    assert (row["landed"], row["crashed"]) == (16, 0)
    assert row["said"]["flights"] <= 1  # of 1002 clean flights 8 are suspected (integrity.md)
    assert row["largest_error_m"] < 1.5


def test_with_a_pad_camera_a_vehicle_without_a_fault_lands_as_the_demo_does(rows):
    led, alone = rows["none, pad camera", 0.0], rows["none", 0.0]
    assert (led["landed"], led["crashed"]) == (16, 0)
    assert led["off_pad_m"]["worst"] < 0.05
    assert led["off_pad_m"]["median"] < 0.25 * alone["off_pad_m"]["median"]


def test_a_jump_of_gps_is_noticed_and_the_pad_stays_where_flow_has_it(rows, flown):
    row = rows["gps_jump", 20.0]
    assert row["landed"] == 16
    assert (row["noticed"]["flights"], row["noticed"]["median_s"]) == (16, pytest.approx(0.4, abs=0.4))
    largest_m = sorted(flight.largest_m for flight in flown["gps_jump", 20.0].flights)
    assert largest_m[-2] < 2.0  # of 20; one flight may meet it while its flow is doubted, and then follows GPS


def test_flow_of_the_wrong_sign_is_told_or_the_vehicle_is_down_before_it_is_far(rows, flown):
    """A vehicle that hardly moves shows the sign late: one in some 400 has landed by then, no further off than GPS."""
    untold = [flight for flight in flown["flow_sign", 20.0].flights if flight.warned_s is None]
    assert len(untold) <= 1
    assert all(flight.verdict == "landed" and flight.largest_m < GPS_M for flight in untold)
    row = rows["flow_sign", 20.0]
    assert row["largest_error_m"] < 25.0  # 84 m where a refused GPS velocity had to wait for 7 s
    assert row["landed"] + row["went_around"] + row["crashed"] == 16


def test_without_any_sensor_for_five_seconds_nothing_lands(rows):
    row = rows["silence", 5.0]
    assert row["said"]["flights"] >= 12  # else it strikes the ground before the warning
    assert row["landed"] < 4


def test_sensors_that_do_not_fail_are_the_sensors_that_cannot():
    flight = assemble(scenario_flown(0.5)).flight
    flight = flight._replace(plan=flight.plan._replace(epochs=400))
    sound = fly_written(flight._replace(fails=True), 1, 0, LANES, faults=[SOUND] * len(LANES))
    plain = fly_written(flight, 1, 0, LANES)
    np.testing.assert_array_equal(sound.history, plain.history)
    np.testing.assert_array_equal(sound.fed, plain.fed)


def test_the_fault_begins_in_hover_and_the_landing_soon_after():
    flight = assemble(scenario_flown(3.0)).flight
    assert window_start(3.0) == pytest.approx(18.0)
    assert flight.plan.may_land_after_s == pytest.approx(23.0)
    assert flight.gains.go_around_height_m == 2.5


# -- the command ---------------------------------------------------------------------------------------------
def command(*arguments):
    app = typer.Typer()
    app.command()(faults_command.command)
    return CliRunner().invoke(app, list(arguments))


def test_json_has_what_became_of_the_flights():
    done = command("--faults", "gps_loss", "--heights", "1.5", "--durations", "5", "--flights", "3", "--json")
    assert done.exit_code == 0, done.output
    facts = json.loads(done.stdout)
    assert (facts["closed_loop"], facts["flights"], facts["truth_model"]) == (True, 3, "ensemble")
    assert [(row["fault"], row["duration_s"], row["flights"]) for row in facts["rows"]] == [
        ("none, pad camera", 0.0, 3),
        ("none", 0.0, 3),
        ("gps_loss", 5.0, 3),
    ]
    assert set(facts["rows"][2]) == {
        "fault", "height_m", "duration_s", "flights", "noticed", "said", "largest_error_unsaid_m", "largest_error_m",
        "landed", "went_around", "crashed", "unfinished", "off_pad_m",
    }  # fmt: skip


def test_the_table_says_landed_around_and_crashed():
    done = command("--faults", "gps_loss", "--heights", "1.5", "--durations", "5", "--flights", "3")
    assert done.exit_code == 0, done.output
    lines = [line for line in done.stdout.splitlines() if "gps_loss" in line]
    rows = [[cell.strip() for cell in line.strip("│ ").split("│")] for line in lines]
    assert all(row[:3] == ["gps_loss", "1.5", "5"] for row in rows)  # of each table where 80 columns do not hold one
    cells = [cell for row in rows for cell in row[3:]]
    assert cells[:2] == ["never", "never"]  # noticed, warned
    assert cells[4:7] == ["3", "0", "0"]  # landed, around, crashed
    assert "scenario pad_return, wind 4 m/s" in " ".join(done.stdout.split())
    assert not any("0: -" in line for line in done.stdout.splitlines())


def test_flow_is_as_late_at_another_rate():
    assert [law_of(FAULTS["flow_late"], T0_S, T1_S, 0.0, period).late_readings for period in (0.02, 0.1)] == [5.0, 1.0]


def test_what_is_of_the_closed_loop_alone_is_refused_offline():
    done = command("--offline", "--matched")
    assert isinstance(done.exception, InputError)
    assert "--flights, --matched: are of flights in the closed loop" in str(done.exception)


def test_what_cannot_be_flown_is_refused():
    done = command("--faults", "duplicates")
    assert isinstance(done.exception, InputError)
    assert "--faults duplicates: a receiver's queue sorts that out before its navigator; try --offline" in str(
        done.exception
    )
