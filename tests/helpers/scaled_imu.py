"""PX4's SCALED_IMU beside a recording in which flownav did not ask for it, by the simulator's truth."""

from __future__ import annotations

import math

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from flownav.core.frames import GRAVITY_M_S2
from flownav.logs.mavlink.framing import coder
from recorded_link import Arrival

HIGHRES_IMU = 105
GYRO_BIAS_RAD_S = 0.002, -0.001, 0.001
HARD_IRON_GAUSS = (0.03, -0.04, 0.02)  # which the sensor's own field has, and its calibration takes off
OWN_FIELD_GAUSS = 0.48 * np.array([math.cos(1.1) * math.cos(0.06), math.cos(1.1) * math.sin(0.06), math.sin(1.1)])


def scaled_imu_beside(heard, truth):
    """A recording in which flownav asked for HIGHRES_IMU alone, with SCALED_IMU beside each: what the simulator's truth
    would have the vehicle's sensors feel, with noise, a gyro's bias and an uncalibrated field.
    """
    mav, chance, since_s = coder(1, 1), np.random.default_rng(9), truth["boot_s"]
    slope = CubicSpline(since_s, np.column_stack([truth[f"vel_{a}_m_s"] for a in "ned"])).derivative()
    angles = CubicSpline(
        since_s, np.unwrap(np.column_stack([truth[f"{n}_rad"] for n in ("roll", "pitch", "yaw")]), axis=0)
    )
    rates = angles.derivative()
    for arrival in heard:
        yield arrival
        if arrival.message_id != HIGHRES_IMU:
            continue
        t_s = mav.decode(bytearray(arrival.frame)).time_usec * 1e-6
        if not since_s[0] < t_s < since_s[-1]:
            continue
        roll, pitch, _ = angles(t_s)
        d_roll, d_pitch, d_yaw = rates(t_s)
        to_body = Rotation.from_euler("xyz", angles(t_s)).as_matrix().T
        turn = [
            d_roll - math.sin(pitch) * d_yaw,
            math.cos(roll) * d_pitch + math.sin(roll) * math.cos(pitch) * d_yaw,
            math.cos(roll) * math.cos(pitch) * d_yaw - math.sin(roll) * d_pitch,
        ]
        force = to_body @ (slope(t_s) - [0.0, 0.0, GRAVITY_M_S2]) + chance.normal(0.0, 0.05, 3)
        turn = np.add(turn, GYRO_BIAS_RAD_S) + chance.normal(0.0, 0.003, 3)
        field = to_body @ OWN_FIELD_GAUSS + HARD_IRON_GAUSS + chance.normal(0.0, 0.003, 3)
        numbers = [round(value * 1e3) for value in (*(force / GRAVITY_M_S2), *turn, *field)]
        mav.srcSystem, mav.seq = arrival.frame[5], arrival.frame[4]
        yield Arrival(arrival.now_s, bytes(mav.scaled_imu_encode(round(t_s * 1e3), *numbers).pack(mav)))
