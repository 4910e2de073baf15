"""One short flight with every phase, and each of its sensors made to lie in one way during one phase."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from helpers.navigation_streams import Flown, Navigated, fly

from flownav.core.measurement import Sensor, Stream

SKID_M = 0.2  # of the lens over the ground of a vehicle that stands
PHASES = {  # [s]
    "standing, motors off": (4.0, 7.0), "standing, motors on": (7.0, 10.0), "lift-off": (10.0, 12.0),
    "climb": (12.0, 15.0), "hover": (15.0, 18.0), "flight": (18.0, 24.0), "descent": (24.0, 28.0),
    "touchdown": (28.0, 31.0),
}  # fmt: skip
END_S = 35.0
CUT_S = 9.0  # GPS, in the flight without it
LATE_S = 0.4
WHITE = {  # of honest sensors, and of one that lies "noise" NOISIER times as much
    Sensor.GPS_POSITION: 0.5, Sensor.GPS_VELOCITY: 0.1, Sensor.FLOW_RATE: 0.02, Sensor.RANGE: 0.02, Sensor.BARO: 0.2,
    Sensor.MAG: 0.003, Sensor.PAD: 0.005,
}  # fmt: skip
NOISIER = 10.0
BIAS = {
    Sensor.GPS_POSITION: 20.0, Sensor.GPS_VELOCITY: 3.0, Sensor.FLOW_RATE: 0.5, Sensor.RANGE: 2.0, Sensor.BARO: 10.0,
    Sensor.MAG: 0.3, Sensor.PAD: 0.5, Sensor.LANDED: 1.0, Sensor.IMU: 1.0,
}  # fmt: skip


def smooth(t_s: np.ndarray, start_s: float, end_s: float) -> np.ndarray:
    """From 0 to 1 between two times, with neither speed nor acceleration at its ends."""
    x = np.clip((t_s - start_s) / (end_s - start_s), 0.0, 1.0)
    return x**3 * (10.0 - 15.0 * x + 6.0 * x**2)


def mission(t_s: np.ndarray) -> np.ndarray:
    """Stands, lifts off to 0.8 m, climbs to 5 m, hovers, flies 12 m and back by 4 m, descends and touches down."""
    height = SKID_M + 0.6 * smooth(t_s, 10, 12) + 4.2 * smooth(t_s, 12, 15)
    height -= 4.4 * smooth(t_s, 24, 28) + 0.4 * smooth(t_s, 28, 30)
    return np.column_stack([12.0 * smooth(t_s, 18, 24), 4.0 * smooth(t_s, 19, 24), -height])


def honest() -> Flown:
    """The flight with sensors that are as noisy as they state, motors that shake from 7 s on, and reports of rest."""
    rng, flown = np.random.default_rng(3), fly(mission, END_S)
    flown = flown.without(Sensor.ATTITUDE)
    times = np.arange(0.0, END_S, 0.1)
    away = np.array([0.0, 0.0, 0.0]) - flown.position
    depth = np.maximum(away[:, 2], 0.05)
    seen = flown.at(times, np.column_stack([away[:, 0] / depth, away[:, 1] / depth, np.linalg.norm(away, axis=1)]))
    near = (seen[:, 2] > 0.5) & (np.abs(seen[:, 0]) < 1.0)
    on_ground = ((times < 10.5) | (times > 30.0)).astype(float)
    flown = flown.added(Stream.of(Sensor.PAD, times[near], seen[near]))
    flown = flown.added(Stream.of(Sensor.LANDED, times, on_ground[:, None]))
    for sensor, sigma in WHITE.items():
        value = flown.streams[sensor].value
        flown = flown.changed(sensor, value=value + sigma * rng.standard_normal(value.shape))
    imu = flown.streams[Sensor.IMU]
    shaken = np.where((imu.t_s > 7.0) & (imu.t_s < 31.0), 0.5, 0.02)[:, None] * [0.01, 0.01, 0.01, 1.0, 1.0, 1.0]
    return flown.changed(Sensor.IMU, value=imu.value + shaken * rng.standard_normal(imu.value.shape))


# -- lies: (the stream, which readings lie) -> the stream ---------------------------------------------------------
def biased(stream: Stream, at: np.ndarray) -> Stream:
    by = np.full(stream.value.shape[1], BIAS[stream.sensor])
    if stream.sensor == Sensor.IMU:
        by[:3] = 0.05
    if stream.sensor == Sensor.MAG:
        by[[0, 2]] = 0.0
    if stream.sensor == Sensor.FLOW_RATE:
        by[2:] = 0.0
    return replace(stream, value=stream.value + np.where(at[:, None], by, 0.0))


def scaled(stream: Stream, at: np.ndarray) -> Stream:
    return replace(stream, value=np.where(at[:, None], 1.5 * stream.value, stream.value))


def stuck(stream: Stream, at: np.ndarray) -> Stream:
    first = stream.value[np.argmax(at)]
    return replace(stream, value=np.where(at[:, None], first, stream.value))


def late(stream: Stream, at: np.ndarray) -> Stream:
    before = np.column_stack([np.interp(stream.t_s - LATE_S, stream.t_s, column) for column in stream.value.T])
    return replace(stream, value=np.where(at[:, None], before, stream.value))


def repeated(stream: Stream, at: np.ndarray) -> Stream:
    held = np.arange(len(stream.t_s)) // 10 * 10
    return replace(stream, value=np.where(at[:, None], stream.value[held], stream.value))


def reversed_sign(stream: Stream, at: np.ndarray) -> Stream:
    return replace(stream, value=np.where(at[:, None], -stream.value, stream.value))


def silent(stream: Stream, at: np.ndarray) -> Stream:
    kept = ~at
    return replace(
        stream, t_s=stream.t_s[kept], value=stream.value[kept], variance=stream.variance[kept],
        quality=stream.quality[kept],
    )  # fmt: skip


def noisy(stream: Stream, at: np.ndarray) -> Stream:
    rng = np.random.default_rng(5)
    sigma = NOISIER * WHITE.get(stream.sensor, 0.2)
    return replace(
        stream, value=stream.value + np.where(at[:, None], sigma, 0.0) * rng.standard_normal(stream.value.shape)
    )


LIES: dict[str, Callable[[Stream, np.ndarray], Stream]] = {
    "bias": biased, "scale": scaled, "stuck": stuck, "late": late, "repeated": repeated, "sign": reversed_sign,
    "silent": silent, "noise": noisy,
}  # fmt: skip


def lying(flown: Flown, sensor: Sensor, lie: str, phase: str) -> Flown:
    """The flight on which a sensor lies during a phase."""
    stream, (start_s, end_s) = flown.streams[sensor], PHASES[phase]
    at = (stream.t_s >= start_s) & (stream.t_s < end_s)
    return flown.added(LIES[lie](stream, at)) if at.any() else flown


def beyond(result: Navigated) -> tuple[float, float]:
    """The greatest error in terms of its protection level, horizontal and vertical, while nothing warns."""
    rows = result.estimate_rows
    error = result.error
    size = np.column_stack([np.hypot(error[:, 0], error[:, 1]), np.abs(error[:, 2])])
    warned = np.zeros(len(rows.t_s), bool)
    for begins, ends in (("suspects", "cleared"), ("dead_reckoning", "aided")):
        over = result.events("filter", ends)[:, 0]
        for t_s, _ in result.events("filter", begins):
            later = over[over > t_s]
            warned |= (rows.t_s >= t_s) & (rows.t_s < (later[0] if len(later) else np.inf))
    sure = np.isfinite(rows.t_s) & ~warned
    ratio = size[sure] / rows.protection_m[sure]
    horizontal, vertical = np.nanmax(ratio, axis=0)
    return float(horizontal), float(vertical)


def without_gps(flown: Flown) -> Flown:
    """The flight whose receiver is silent, and whose pad no camera sees, from before the lift-off on."""
    flown = flown.without(Sensor.PAD)
    for sensor in (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY):
        flown = flown.cut(sensor, CUT_S, END_S)
    return flown
