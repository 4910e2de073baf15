"""The least loss by 32-bit floats: a navigator whose state, covariance or both are rounded after each call."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flownav.core.measurement import Array, Sensor
from flownav.estimation.states import COVARIANCE, FILTER_ROWS, IMU, STATE
from flownav.export.onboard.board import Board
from flownav.export.onboard.interface import Rates
from flownav.navigation import progress
from flownav.navigation.now import NowRow
from flownav.navigation.rings import Given

KEPT = {"the state": np.r_[STATE:IMU], "its covariance": np.r_[COVARIANCE:FILTER_ROWS]}
EVERY = 10  # inertial readings
POSITIONS, VELOCITIES, ANGLES = [0, 6, 11], [0, 3, 5], [15, 18, 20]  # variances in a state's triangles


def apart(whole: NowRow[Array], narrow: NowRow[Array]) -> tuple[float, float, float]:
    """By how many standard deviations position, velocity and attitude differ, the worst axis of each."""
    position = np.abs(narrow.pos_ned_m - whole.pos_ned_m) / np.sqrt(whole.pose_covariance[POSITIONS])
    velocity = np.abs(narrow.vel_ned_m_s - whole.vel_ned_m_s) / np.sqrt(whole.vel_ned_covariance[VELOCITIES])
    angle = 2.0 * np.arccos(min(1.0, abs(float(whole.quaternion @ narrow.quaternion))))
    return float(position.max()), float(velocity.max()), angle / float(np.sqrt(whole.pose_covariance[ANGLES].min()))


def worst(settings: Array, rates: Rates, lag: bool, readings: Sequence[Given], kept: Sequence[str]) -> Array:
    """The worst of `apart` over a flight, with what is kept rounded to 32 bits after each call."""
    rows = np.concatenate([KEPT[name] for name in kept])
    whole, narrow = (Board(settings, rates.sizes, lag=lag) for _ in range(2))
    found, count = np.zeros(3), 0
    for given in readings:
        whole.take(given)
        narrow.take(given)
        narrow.work[rows] = narrow.work[rows].astype(np.float32)
        count += given.sensor == Sensor.IMU
        if given.sensor == Sensor.IMU and count % EVERY == 0:
            told = whole.now(given.t_s), narrow.now(given.t_s)
            if all(each.status == progress.STATE_GIVEN for each in told):
                found = np.fmax(found, apart(*told))
    return found
