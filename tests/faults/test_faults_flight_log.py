"""A simulated flight's log says what its vehicle's own sensors read, when it arrived, and how old it was."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flownav.campaigns.faults.table import log_of
from flownav.campaigns.local import fly_recorded
from flownav.core.frames import rotation_from_quaternion
from flownav.core.measurement import COLUMNS, Sensor
from flownav.core.parameter_files import check
from flownav.core.record import POSITION_NED, QUATERNION, VELOCITY_BODY, Record
from flownav.simulation.assemble import assemble
from flownav.simulation.scenario import Scenario, load_scenario

FEWER = {Sensor.PAD}  # sensors that say nothing for most of the flight


@pytest.fixture(scope="module")
def flight():
    """A setup and its record: down from 4 m beside the middle of the pad, with pad fixes, on the truth."""
    entries = load_scenario("approach").model_dump(exclude_unset=True)
    entries["autopilot"] = {"feedback": "truth"}
    entries["flight"] = {
        "duration_s": 20.0, "start": "hover", "may_land_after_s": 5.0,
        "path": [
            {"t_s": 0.0, "height_m": 4.0, "north_m": 0.6, "east_m": -0.4},
            {"t_s": 5.0, "height_m": 2.5},
            {"t_s": 20.0, "height_m": -2.0},
        ],
    }  # fmt: skip
    setup = assemble(check(entries, Scenario, "test"))
    return setup, fly_recorded(setup, 3)


def true(record, columns, t_s):
    """Columns of the truth at other instants."""
    truth = record.tables["truth"]
    return np.column_stack([np.interp(t_s, truth["t_s"], truth[name]) for name in columns])


def test_the_log_holds_every_sensor_of_the_vehicle_at_its_rate_and_the_truth(flight):
    setup, record = flight
    log = log_of(record, setup)
    sheets = setup.fitted.sheets
    rates_hz = {
        Sensor.IMU: sheets.inertial.rate_hz, Sensor.GPS_POSITION: sheets.gps_receiver.rate_hz,
        Sensor.GPS_VELOCITY: sheets.gps_receiver.rate_hz, Sensor.FLOW_RATE: sheets.flow_camera.rate_hz,
        Sensor.RANGE: sheets.range_sensor.rate_hz, Sensor.BARO: sheets.barometer.rate_hz,
        Sensor.MAG: sheets.magnetometer.rate_hz, Sensor.PAD: sheets.pad_camera.rate_hz,
        Sensor.LANDED: sheets.skid_switch.rate_hz,
    }  # fmt: skip
    assert set(log.streams) == set(rates_hz)
    for sensor, stream in log.streams.items():
        assert sensor == stream.sensor
        assert np.median(np.diff(stream.t_s)) == pytest.approx(1.0 / rates_hz[sensor], rel=0.05), sensor
        assert len(stream) > 50
    assert log.truth is record.tables["truth"]
    assert log.autopilot is record.tables["flown"]
    assert log.limits["range_m"] == (float(sheets.range_sensor.floor_m), float(sheets.range_sensor.ceiling_m))


def test_streams_are_the_records_own_readings_at_their_arrival_with_the_age_that_the_navigator_takes_them_for(flight):
    setup, record = flight
    fed = record.tables["fed"]
    for sensor, stream in log_of(record, setup).streams.items():
        table = record.tables[sensor.name.lower()]
        np.testing.assert_array_equal(stream.t_s, table["t_s"])
        np.testing.assert_array_equal(stream.value, np.column_stack([table[name] for name in COLUMNS[sensor]]))
        mine = (fed["sensor"] == sensor) & (fed["arrived"] > 0.0)
        np.testing.assert_allclose(stream.t_s - stream.delay_s, fed["t_s"][mine], atol=1e-9)
        assert stream.delay_s == record.manifest["delays_s"][sensor.name.lower()]
        assert (np.diff(stream.t_s) > 0.0).all()


def test_a_receiver_describes_the_instant_that_its_delay_says(flight):
    """Of two shifts, the stated one leaves less of the velocity's error."""
    setup, record = flight
    stream = log_of(record, setup).streams[Sensor.GPS_VELOCITY]
    assert stream.delay_s > 0.05

    def spread(delay_s):
        t_s = stream.t_s - delay_s
        inside = t_s > 0.5
        rotation = rotation_from_quaternion(*true(record, QUATERNION, t_s[inside]).T)
        axes = np.array(rotation).T.reshape(-1, 3, 3)
        velocity = np.einsum("nij,nj->ni", axes, true(record, VELOCITY_BODY, t_s[inside]))
        return np.std((stream.value[inside] - velocity)[:, 2])

    assert spread(stream.delay_s) < spread(0.0)


def test_what_a_fix_states_is_kept_and_what_others_do_not_state_is_unknown(flight):
    setup, record = flight
    streams = log_of(record, setup).streams
    for sensor in (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY, Sensor.PAD):
        assert (streams[sensor].variance > 0.0).all()
    for sensor in (Sensor.IMU, Sensor.FLOW_RATE, Sensor.RANGE, Sensor.BARO, Sensor.MAG):
        assert np.isnan(streams[sensor].variance).all()


def test_ranges_and_pad_fixes_are_near_the_truth(flight):
    setup, record = flight
    streams = log_of(record, setup).streams
    ranges = streams[Sensor.RANGE]
    height = -true(record, POSITION_NED, ranges.t_s - ranges.delay_s)[:, 2]
    clear = height > 1.0
    assert abs(np.median(ranges.value[clear, 0] - height[clear])) < 0.3
    pad = streams[Sensor.PAD]
    then = true(record, POSITION_NED, pad.t_s - pad.delay_s)
    assert np.median(np.abs(pad.value[:, 2] - np.linalg.norm(then, axis=1))) < 0.2


def test_a_reading_that_never_arrived_is_not_in_the_log(flight):
    setup, record = flight
    fed = record.tables["fed"]
    due = int((fed["sensor"] == Sensor.FLOW_RATE).sum())
    assert len(log_of(record, setup).streams[Sensor.FLOW_RATE]) < due


def test_a_flight_on_the_papers_filter_is_refused(flight):
    setup, record = flight
    without = Record(record.manifest, {name: table for name, table in record.tables.items() if name != "fed"})
    with pytest.raises(ValueError, match="no sensors of its own; fly it on the navigator"):
        log_of(without, setup)
    with pytest.raises(ValueError, match="no sensors of its own"):
        log_of(record, replace(setup, fitted=None))


def test_the_log_survives_the_records_file(flight, tmp_path):
    setup, record = flight
    record.save(tmp_path / "flight.fnr")
    again = log_of(Record.load(tmp_path / "flight.fnr"), setup)
    for sensor, stream in log_of(record, setup).streams.items():
        np.testing.assert_array_equal(again.streams[sensor].value, stream.value)
