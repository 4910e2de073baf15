"""Invariances of dead reckoning by a flow sensor: north, time, mirrors and scale."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flownav.core.frames import quaternion_from_euler, rotation_from_quaternion, turned_about_down
from flownav.core.measurement import Sensor, Stream
from flownav.studies.compare.tracks import at, dead_reckoned, says

T_S = np.arange(0.0, 16.0, 0.0625)


def reckoned(shift_s: float = 0.0, turn: float = 0.0, size: float = 1.0, side: float = 1.0):
    """A wandering, leaning vehicle: later, turned, in a larger world, or in a mirror (side -1)."""
    t_s = T_S + shift_s
    lean = [(0.2 * math.sin(0.4 * t), 0.15 * math.cos(0.3 * t), 0.1 * t) for t in T_S]
    q = np.array(
        [turned_about_down(quaternion_from_euler(side * roll, pitch, side * yaw), turn) for roll, pitch, yaw in lean]
    )
    flow = np.column_stack([
        side * 0.3 * np.sin(0.5 * T_S), 0.4 + 0.1 * np.cos(T_S), side * 0.02 * np.ones(len(T_S)), 0.05 * np.sin(T_S)
    ])  # fmt: skip
    track = dead_reckoned(
        Stream.of(Sensor.FLOW_RATE, t_s, flow, delay_s=0.125),
        Stream.of(Sensor.RANGE, t_s, size * (2.0 + 0.3 * np.sin(T_S))[:, None]),
        Stream.of(Sensor.ATTITUDE, t_s, q, delay_s=0.0625),
    )
    assert track is not None
    return track


def test_dead_reckoning_knows_no_zero_of_time():
    now, later = reckoned(), reckoned(shift_s=4096.0)
    np.testing.assert_allclose(later.motion.position, now.motion.position, atol=1e-9)
    np.testing.assert_allclose(later.t_s - 4096.0, now.t_s)


@pytest.mark.parametrize("turn", [0.5 * math.pi, -2.2])
def test_dead_reckoning_turns_with_its_heading(turn):
    here, there = reckoned(), reckoned(turn=turn)
    c, s = math.cos(turn), math.sin(turn)
    rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(there.motion.position, here.motion.position @ rotation.T, atol=1e-9)
    np.testing.assert_allclose(there.velocity_ne, here.velocity_ne @ rotation[:2, :2].T, atol=1e-9)


def test_dead_reckoning_scales_with_the_range_and_is_mirrored_in_a_mirror():
    here, high, mirror = reckoned(), reckoned(size=5.0), reckoned(side=-1.0)
    np.testing.assert_allclose(high.motion.position, 5.0 * here.motion.position, atol=1e-9)
    np.testing.assert_allclose(mirror.motion.position, here.motion.position * [1.0, -1.0, 1.0], atol=1e-9)


def test_a_track_says_nothing_beyond_its_ends():
    track = reckoned()
    first, last = track.t_s[0], track.t_s[-1]
    instants = np.array([first - 0.01, first, 0.5 * (first + last), last, last + 0.01])
    assert says(track, instants).tolist() == [False, True, True, True, False]
    np.testing.assert_allclose(at(track, track.velocity_ne, track.t_s), track.velocity_ne)


@pytest.mark.parametrize("lean", [-0.3, 0.2])
def test_one_that_leans_to_the_side_moves_as_far_as_one_that_leans_ahead(lean):
    """Either moves level: what the lens sees is the part across its boresight, v cos(lean), on whichever axis."""

    def way(roll: float, pitch: float, flow) -> np.ndarray:
        q = np.tile(quaternion_from_euler(roll, pitch, 0.0), (len(T_S), 1))
        track = dead_reckoned(
            Stream.of(Sensor.FLOW_RATE, T_S, np.tile(flow, (len(T_S), 1))),
            Stream.of(Sensor.RANGE, T_S, np.full((len(T_S), 1), 2.0)),
            Stream.of(Sensor.ATTITUDE, T_S, q),
        )
        assert track is not None
        return track.motion.position[-1]

    ahead, aside = way(0.0, lean, [0.0, 0.25, 0.0, 0.0]), way(lean, 0.0, [-0.25, 0.0, 0.0, 0.0])
    assert ahead[0] == pytest.approx(0.5 * T_S[-1] / math.cos(lean))
    assert aside[[1, 0, 2]] == pytest.approx(ahead, abs=1e-9)
    both = way(lean, 0.25, [-0.2, 0.3, 0.0, 0.0])[:2] / T_S[-1]
    rotation = np.reshape(rotation_from_quaternion(*quaternion_from_euler(lean, 0.25, 0.0)), (3, 3))
    assert (rotation.T @ [*both, 0.0])[:2] == pytest.approx([0.6, 0.4])  # seen from the body it is what was seen
