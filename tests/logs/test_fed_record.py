"""Records that say what a navigator was fed, read as a log: older ones too, silent and withheld readings in place."""

from __future__ import annotations

import numpy as np
import pytest

from fed_records import FLOWN, queue_of_flight, record_of
from flownav.core.errors import InputError
from flownav.core.measurement import Sensor, Stream, merge
from flownav.logs.open_log import open_flight
from flownav.logs.plausible import check_values
from flownav.replays.fed import as_fed
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import replay
from navigation_streams import navigate


def replayed(path, **options):
    log = open_flight(path)
    return log, replay(log, *as_fed(log, ReplayOptions(**options), None))


def test_what_was_fed_is_fed_again_bit_for_bit(tmp_path):
    queue = queue_of_flight()
    record_of(queue).save(tmp_path / "flight.fnr")
    log, again = replayed(tmp_path / "flight.fnr")
    first = navigate(FLOWN, queue)
    assert again.estimate.tobytes() == first.estimate.tobytes()
    assert np.array_equal(again.innovation, first.offers, equal_nan=True)
    assert again.rejected()["flow_rate"]["outage"] > 0
    assert "a simulated flight of 1 navigator" in log.notes[0]


def test_streams_hold_what_arrived_and_a_cut_finds_its_fixes(tmp_path):
    queue = queue_of_flight()
    record_of(queue).save(tmp_path / "flight.fnr")
    log, cut = replayed(tmp_path / "flight.fnr", gps_outages_s=((6.0, 9.0),))
    fixes = queue.sensor == Sensor.GPS_POSITION
    assert len(log.streams[Sensor.GPS_POSITION]) == np.count_nonzero(fixes & (queue.arrived > 0.0))
    inside = fixes & (queue.t_s >= 6.0) & (queue.t_s < 9.0) & (queue.arrived > 0.0)
    assert cut.rejected()["gps_position"]["outage"] == 3 * np.count_nonzero(inside)


def test_a_record_from_before_these_columns_is_read_as_it_was(tmp_path):
    queue = merge(FLOWN.streams.values())
    record_of(queue, "live", ("withheld", "arrived")).save(tmp_path / "old.fnr")
    log, again = replayed(tmp_path / "old.fnr")
    assert again.estimate.tobytes() == navigate(FLOWN, queue).estimate.tobytes()
    assert "a live session" in log.notes[0]


@pytest.mark.parametrize(("kind", "without"), [("replay", ()), ("fly", ("value_0",))])
def test_what_does_not_say_it_is_refused_in_one_line(tmp_path, kind, without):
    record_of(merge(FLOWN.streams.values()), kind, without).save(tmp_path / "other.fnr")
    with pytest.raises(InputError) as error:
        open_flight(tmp_path / "other.fnr")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("sensor", 99.0, "sensor that there is none"),
        ("sensor", np.nan, "sensor that there is none"),
        ("segment", 1.0, "segment that there is none"),
        ("segment", -1.0, "segment that there is none"),
        ("arrived", 0.5, "arrived that there is none"),
        ("t_s", np.nan, "which no clock shows"),
        ("arrival_s", np.inf, "without a time"),
    ],
)
def test_a_row_that_no_navigator_was_fed_is_one_line(tmp_path, name, value, said):
    record = record_of(queue_of_flight())
    record.tables["fed"][name] = record.tables["fed"][name].copy()
    record.tables["fed"][name][7] = value
    record.save(tmp_path / "x.fnr")
    with pytest.raises(InputError, match=said):
        open_flight(tmp_path / "x.fnr")


@pytest.mark.parametrize(("length", "sound"), [(1.09, True), (1.11, False), (0.89, False), (0.91, True)])
def test_a_quaternion_is_as_long_as_in_other_logs(tmp_path, length, sound):
    value = np.zeros((3, 4))
    value[:, 0] = 1.0, length, 1.0
    streams = {Sensor.ATTITUDE: Stream.of(Sensor.ATTITUDE, np.arange(3.0), value)}
    if sound:
        check_values(tmp_path, streams)
        return
    with pytest.raises(InputError, match="attitude: a quaternion whose length is far from 1"):
        check_values(tmp_path, streams)


@pytest.mark.parametrize(
    "manifest",
    [
        {"segments": [{"use_imu": True}]},
        {"segments": [{"use_imu": True, "wings": 2.0}]},
        {"parameters": {"gps_delay_s": 0.0}},
        {"parameters": {"filter": {}, "gps_delay_s": "soon"}},
        {"parameters": {"filter": {}, "gps_delay_s": 0.0, "flow_noise": {"a": 1.0}}},
        {"parameters": {"filter": {}, "gps_delay_s": 0.0, "flow_noise": "much"}},
        {"parameters": {"filter": {"no_such": 1.0}, "gps_delay_s": 0.0}},
    ],
)
def test_settings_that_are_none_are_one_line(tmp_path, manifest):
    record = record_of(queue_of_flight())
    record.manifest |= manifest
    record.save(tmp_path / "x.fnr")
    with pytest.raises(InputError):
        replayed(tmp_path / "x.fnr")
