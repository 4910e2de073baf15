"""The same instants, the same reference, laid on in the same way."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flownav.core.frames import quaternion_from_euler
from flownav.core.measurement import Sensor, Stream
from flownav.logs.log import Log
from flownav.replays.judged import airborne_of
from flownav.scoring.reference import Motion
from flownav.studies.compare.tracks import Track, errors_of, of_table, reference_of, says, shared_by

NONE = np.zeros(0)
T_S = np.arange(0.0, 60.0, 0.1)
PATH = np.column_stack([8.0 * np.sin(0.3 * T_S), 5.0 * np.sin(0.2 * T_S), -1.5 * ((T_S > 10.0) & (T_S < 50.0))])
SPEED = np.column_stack([2.4 * np.cos(0.3 * T_S), np.cos(0.2 * T_S)])


def track(t_s=T_S, position=PATH, velocity=SPEED) -> Track:
    return Track(Motion(t_s, position, NONE, NONE), velocity)


def log_with(truth: bool = False, **streams: Stream) -> Log:
    table = {"t_s": T_S, "pos_n_m": PATH[:, 0], "pos_e_m": PATH[:, 1], "pos_d_m": PATH[:, 2]} if truth else None
    return Log(Path("log"), {stream.sensor: stream for stream in streams.values()}, truth=table)


def gps() -> dict[str, Stream]:
    moving = np.column_stack([SPEED, np.zeros(len(T_S))])
    return {"fixes": Stream.of(Sensor.GPS_POSITION, T_S + 0.2, PATH + np.array([100.0, 50.0, 3.0])),
            "speeds": Stream.of(Sensor.GPS_VELOCITY, T_S + 0.2, moving)}  # fmt: skip


def every(reference) -> tuple[np.ndarray, np.ndarray]:
    return np.ones(len(reference.position_t_s), bool), np.ones(len(reference.velocity_t_s), bool)


# -- who speaks when ---------------------------------------------------------------------------------------
def test_an_estimate_is_nobodys_between_rows_half_a_second_apart():
    t_s = np.array([1.0, 1.5, 2.1, 2.2])
    asked = np.array([0.9, 1.0, 1.2, 1.5, 1.6, 2.0, 2.15, 2.2, 2.3])
    assert says(track(t_s), asked).tolist() == [False, True, True, True, False, False, True, True, False]
    assert says(track(t_s[:1]), asked).tolist() == [False, True, *[False] * 7]
    assert not says(track(NONE), asked).any()


def test_instants_are_those_of_all_and_who_would_leave_none_is_left_out():
    late, away = track(T_S[300:]), track(T_S + 500.0)
    shared, kept = shared_by([track(), away, late], T_S)
    assert kept == [True, False, True]
    assert np.array_equal(shared, np.arange(len(T_S)) >= 300)


# -- how they are scored -----------------------------------------------------------------------------------
def test_truth_is_turned_and_shifted_onto_the_track():
    reference = reference_of(log_with(truth=True), 0.2)
    c, s = np.cos(2.0), np.sin(2.0)
    turn = np.array([[c, s], [-s, c]])
    elsewhere = np.column_stack([PATH[:, :2] @ turn + [4.0, -9.0], PATH[:, 2]])
    found = errors_of(track(position=elsewhere, velocity=SPEED @ turn), reference, *every(reference))
    assert found["horizontal_rms_m"] == pytest.approx(0.0, abs=1e-9)
    assert found["velocity_rms_m_s"] < 0.01  # truth has none: by differences
    assert found["samples"] == len(T_S)


def test_gps_is_shifted_and_its_delay_taken_off():
    reference = reference_of(log_with(**gps()), 0.2)
    wrong = PATH + np.column_stack([0.3 * np.sign(np.sin(9.0 * T_S)), 0.0 * T_S, 0.0 * T_S])
    found = errors_of(track(position=wrong, velocity=SPEED + np.array([0.2, 0.0])), reference, *every(reference))
    assert found["horizontal_rms_m"] == pytest.approx(0.3, rel=0.01)
    assert found["velocity_rms_m_s"] == pytest.approx(0.2, rel=0.01)
    assert reference.against == "gps"
    assert reference_of(log_with(truth=True, **gps()), 0.2).against == "truth"
    assert reference_of(log_with(), 0.2) is None


def test_the_flight_is_scored_apart():
    reference = reference_of(log_with(truth=True), 0.2)
    wrong = PATH + np.column_stack([2.0 * (T_S < 5.0), 0.0 * T_S, 0.0 * T_S])
    standing = errors_of(track(position=wrong), reference, *every(reference))
    flying = errors_of(track(position=wrong), reference, *every(reference), (10.0, 50.0))
    assert standing["horizontal_rms_m"] > 0.3
    assert flying["horizontal_rms_m"] == pytest.approx(0.0, abs=1e-9)
    assert flying["samples"] == 401


def test_too_few_instants_and_an_unknown_velocity_give_no_figure():
    reference = reference_of(log_with(truth=True), 0.2)
    found = errors_of(track(), reference, *every(reference), (10.0, 10.5))
    assert (found["horizontal_rms_m"], found["velocity_rms_m_s"]) == (None, None)
    unknown = errors_of(track(velocity=np.nan * SPEED), reference, *every(reference))
    assert unknown["velocity_rms_m_s"] is None
    assert unknown["horizontal_rms_m"] is not None


# -- when it flew ------------------------------------------------------------------------------------------
def test_who_says_when_it_flew():
    landed = Stream.of(Sensor.LANDED, np.array([0.0, 12.0, 30.0, 48.0]), [[1.0], [0.0], [0.0], [1.0]])
    distance = Stream.of(Sensor.RANGE, T_S, 0.1 - PATH[:, 2:])
    assert airborne_of(log_with(truth=True, landed=landed, distance=distance)) == (12.0, 48.0)
    assert airborne_of(log_with(truth=True)) == pytest.approx((10.1, 49.9))
    assert airborne_of(log_with(distance=distance)) == pytest.approx((10.1, 49.9))
    assert airborne_of(log_with(**gps())) is None
    down = Stream.of(Sensor.LANDED, landed.t_s, np.ones((4, 1)))
    assert airborne_of(log_with(landed=down, distance=distance)) == pytest.approx((10.1, 49.9))


def test_an_autopilots_table_becomes_a_track_and_may_lack_a_velocity():
    table = {"t_s": T_S, "pos_n_m": PATH[:, 0], "pos_e_m": PATH[:, 1], "pos_d_m": PATH[:, 2]}
    assert np.isnan(of_table(table).velocity_ne).all()
    quaternion = quaternion_from_euler(0.0, 0.0, np.pi / 2)
    table |= {name: np.full(len(T_S), part) for name, part in zip(("qw", "qx", "qy", "qz"), quaternion, strict=True)}
    table |= {"vel_u_m_s": 0.0 * T_S + 2.0, "vel_v_m_s": 0.0 * T_S, "vel_w_m_s": 0.0 * T_S}
    assert of_table(table).velocity_ne[7] == pytest.approx([0.0, 2.0], abs=1e-12)
    assert of_table(table).motion.heading_rad[7] == pytest.approx(np.pi / 2)
