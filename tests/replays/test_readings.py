"""Rejections in readings: a reading is one, however many components it has."""

from __future__ import annotations

import numpy as np

from flownav.core.measurement import Sensor, Stream
from flownav.estimation.gating import Reason
from flownav.replays.judged import reading_scores
from flownav.replays.session import Replay


def offers(*rows) -> np.ndarray:
    """Rows (t_s, sensor, component, reason) as the tape has them."""
    table = np.zeros((len(rows), 9))
    for row, (t_s, sensor, component, reason) in enumerate(rows):
        table[row, [0, 1, 2, 8]] = t_s, sensor, component, reason
    return table


def gps(rejected=None) -> dict[Sensor, Stream]:
    t_s = np.arange(4.0)
    return {Sensor.GPS_POSITION: Stream.of(Sensor.GPS_POSITION, t_s, np.zeros((4, 3)), rejected=rejected or {})}


def test_a_reading_with_three_components_refused_is_one():
    position, gate = Sensor.GPS_POSITION, Reason.INNOVATION_GATE
    rows = [(1.0, position, k, Reason.FUSED) for k in range(3)]
    rows += [(2.0, position, k, gate) for k in range(3)]
    rows += [(3.0, position, 0, Reason.FUSED), (3.0, position, 1, gate), (3.0, position, 2, Reason.FUSED)]
    assert reading_scores(offers(*rows), gps()) == {
        "gps_position": {"offered": 3, "read": 3, "fused": 1, "in_part": 1, "rejected": {"innovation_gate": 2}}
    }


def test_two_readings_at_one_instant_are_two():
    rows = [(1.0, Sensor.GPS_POSITION, k, Reason.OUTAGE) for k in (0, 1, 2, 0, 1, 2)]
    assert reading_scores(offers(*rows), gps())["gps_position"]["rejected"] == {"outage": 2}


def test_rows_that_the_reader_threw_away_are_added_to_the_filters():
    rows = [(1.0, Sensor.GPS_POSITION, k, Reason.OUT_OF_RANGE) for k in range(3)]
    found = reading_scores(offers(*rows), gps({"no_fix": 7, "out_of_range": 2}))["gps_position"]
    assert found == {"offered": 1, "read": 10, "fused": 0, "in_part": 0, "rejected": {"no_fix": 7, "out_of_range": 3}}


def test_components_keep_the_readers_count_of_the_same_reason():
    class Flown:
        innovation = offers(*[(1.0, Sensor.GPS_POSITION, k, Reason.OUT_OF_RANGE) for k in range(3)])

        class log:
            streams = gps({"out_of_range": 2})

    assert Replay.rejected(Flown()) == {"gps_position": {"out_of_range": 5}}


def test_a_vertical_velocity_that_gps_does_not_tell_is_no_rejection():
    """GPS_RAW_INT has none: its NaN means not stated. One in a component that must be there is a broken reading."""
    velocity, position = Sensor.GPS_VELOCITY, Sensor.GPS_POSITION
    rows = offers(
        (1.0, velocity, 0, Reason.FUSED), (1.0, velocity, 1, Reason.FUSED), (1.0, velocity, 2, Reason.NOT_FINITE),
        (2.0, velocity, 0, Reason.NOT_FINITE), (2.0, velocity, 1, Reason.FUSED), (2.0, velocity, 2, Reason.NOT_FINITE),
        (1.0, position, 2, Reason.NOT_FINITE),
    )  # fmt: skip
    rows[[2, 3, 5, 6], 3] = np.nan
    streams = {velocity: Stream.of(velocity, np.arange(2.0), np.zeros((2, 3))), **gps()}
    found = reading_scores(rows, streams)
    assert found["gps_velocity"] == {"offered": 2, "read": 2, "fused": 1, "in_part": 1, "rejected": {"not_finite": 1}}
    assert found["gps_position"]["rejected"] == {"not_finite": 1}

    class Flown:
        innovation = rows
        log = type("Log", (), {"streams": streams})

    assert Replay.rejected(Flown) == {"gps_velocity": {"not_finite": 1}, "gps_position": {"not_finite": 1}}


def test_a_velocity_of_which_nothing_is_told_is_broken():
    rows = offers(*[(1.0, Sensor.GPS_VELOCITY, k, Reason.NOT_FINITE) for k in range(3)])
    rows[:, 3] = np.nan
    streams = {Sensor.GPS_VELOCITY: Stream.of(Sensor.GPS_VELOCITY, np.arange(1.0), np.zeros((1, 3)))}

    class Flown:
        innovation = rows
        log = type("Log", (), {"streams": streams})

    assert Replay.rejected(Flown) == {"gps_velocity": {"not_finite": 3}}
