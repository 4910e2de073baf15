"""Recordings of real autopilots' simulators, played into a session: its notes, and what it sent beside the truth."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from flownav.core.frames import GRAVITY_M_S2
from flownav.live.filtering import Keeper
from flownav.logs.mavlink.framing import coder
from recorded_link import Arrival, arrivals, play

RAW_IMU = 27


class Notes(Keeper):
    """The happenings of a session."""

    def __init__(self):
        self.all = []

    def note(self, t_s, source, kind, detail, value=float("nan")):
        self.all.append((t_s, source, kind, detail))

    def when(self, kind):
        return [t_s for t_s, _, what, _ in self.all if what == kind]


def with_others(heard, truth, messages):
    """Beside each second RAW_IMU of a recording other sensors of the vehicle: what the simulator's truth would have an
    accelerometer feel, by the slope of its velocity, with a bias and noise of their own; the gyro as RAW_IMU tells it.
    """
    mav, chance, turns = coder(1, 1), np.random.default_rng(9), 0
    slope = CubicSpline(truth["boot_s"], np.column_stack([truth[f"vel_{a}_m_s"] for a in "ned"])).derivative()
    angles = CubicSpline(
        truth["boot_s"], np.unwrap(np.column_stack([truth[f"{n}_rad"] for n in ("roll", "pitch", "yaw")]), axis=0)
    )
    bias_m_s2 = chance.normal(0.0, 0.1, (len(messages), 3))
    for arrival in heard:
        yield arrival
        if arrival.message_id != RAW_IMU:
            continue
        turns += 1
        raw = mav.decode(bytearray(arrival.frame))
        t_s = raw.time_usec * 1e-6
        if turns % 2 or not truth["boot_s"][0] < t_s < truth["boot_s"][-1]:
            continue
        rotation = Rotation.from_euler("xyz", angles(t_s)).as_matrix()
        force = rotation.T @ (slope(t_s) - [0.0, 0.0, GRAVITY_M_S2])
        for number, message in enumerate(messages):
            felt = force + bias_m_s2[number] + chance.normal(0.0, 0.05, 3)
            milli_g = [round(value * 1e3 / GRAVITY_M_S2) for value in felt]
            encode = getattr(mav, f"{message.lower()}_encode")
            told = encode(round(t_s * 1e3), *milli_g, raw.xgyro, raw.ygyro, raw.zgyro, 0, 0, 0)
            yield Arrival(arrival.now_s, bytes(told.pack(mav)))


class Played:
    """A recording that was played: notes, and what was sent beside the truth."""

    def __init__(self, folder, until_s, others=(), beside=None):
        self.notes = Notes()
        truth = np.genfromtxt(folder / "truth.csv", delimiter=",", names=True)
        heard = arrivals(folder, until_s)
        heard = beside(heard, truth) if beside else with_others(heard, truth, others)
        self.session, self.sent = play(heard, keeper=self.notes)
        told = [message for _, message in self.sent if message.msgname == "ODOMETRY"]
        self.t_s = np.array([message.time_usec * 1e-6 for message in told])
        place = np.array([[message.x, message.y, message.z] for message in told]).reshape(-1, 3)
        true = np.column_stack([np.interp(self.t_s, truth["boot_s"], truth[f"pos_{a}_m"]) for a in "ned"])
        self.error_m = place - true
        self.resets = np.array([message.reset_counter for message in told])
        self.yaw_rad = np.array(
            [np.arctan2(2 * (m.q[0] * m.q[3] + m.q[1] * m.q[2]), 1 - 2 * (m.q[2] ** 2 + m.q[3] ** 2)) for m in told]
        )
        self.true_yaw_rad = np.interp(self.t_s, truth["boot_s"], np.unwrap(truth["yaw_rad"]))

    def between(self, since_s, until_s):
        return (self.t_s >= since_s) & (self.t_s < until_s)

    def longest_gap_s(self, since_s):
        later = self.t_s[self.t_s >= since_s]
        return max(b - a for a, b in pairwise(later))
