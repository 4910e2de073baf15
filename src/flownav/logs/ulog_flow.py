"""Optical flow and range of a ULog: which of several sensors, and rates from what PX4 accumulates.

`pixel_flow` and its gyro are radians accumulated over the integration time, positive for a right-hand rotation of the
sensor about the body axis: divided by that time they are the rates of `Sensor.FLOW_RATE`. The old `optical_flow` is
the same under other names (its driver turned it into body axes); `sensor_optical_flow` is in the sensor's own axes,
which SENS_FLOW_ROT turns by eighths about z, as PX4's VehicleOpticalFlow does to make `vehicle_optical_flow`.
"""

from pathlib import Path

import numpy as np

from flownav.core.errors import InputError, arg
from flownav.core.measurement import Array, Sensor, Stream
from flownav.logs.assembly import possible_variance
from flownav.logs.ulog_topics import Topic, Topics

FLOW_TOPICS = ("vehicle_optical_flow", "optical_flow", "sensor_optical_flow")  # the first that saw enough
ENOUGH_SHARE = 0.5  # of what the best topic saw
FASTEST_RAD_S = 70.0
LONGEST_INTEGRATION_S = 1.0
DOWNWARD_ROTATION = 25.0  # MAV_SENSOR_ROTATION_PITCH_270
FARTHEST_M = 1000.0
EIGHTH_TURN_RAD = 0.25 * np.pi


def flow_topic(path: Path, topics: Topics, instance: int | None) -> Topic | None:
    """The flow sensor to read: of the asked instance, else the one that saw most; None without any.

    InputError where an instance is asked for that the log has not.
    """
    present = topics.of(*FLOW_TOPICS)
    asked = [topic for topic in present if instance is None or topic.instance == instance]
    if not asked:
        if instance is None:
            return None
        listed = ", ".join(topic.label for topic in present) or "no optical flow at all"
        raise InputError(f"{path}: {arg('flow_instance')} {instance} is not in the log; it has {listed}")
    most = max(map(_seen_s, asked))
    preferred = next(topic for topic in asked if _seen_s(topic) >= ENOUGH_SHARE * most).name
    return max((topic for topic in asked if topic.name == preferred), key=_seen_s)


def flow_stream(topics: Topics, topic: Topic) -> Stream:
    """Rates of the flow and of the sensor's gyro (NaN where it has none), with the age that PX4 states."""
    dt_s = _integration_s(topic)
    quality = np.nan_to_num(topic.columns.get("quality", np.full(len(topic), 255.0)))
    flow, gyro = _accumulated(topic)
    if topic.name == "sensor_optical_flow":
        turn = EIGHTH_TURN_RAD * topics.parameters.get("SENS_FLOW_ROT", 0.0)
        flow, gyro = _turned(flow, turn), _turned(gyro, turn)
    timed = (dt_s > 0) & (dt_s <= LONGEST_INTEGRATION_S)
    with np.errstate(divide="ignore", invalid="ignore"):
        rates = np.column_stack([flow, gyro]) / dt_s[:, None]
    blind = quality <= 0
    rates[blind & ~(timed & np.isfinite(rates[:, :2]).all(axis=1)), :2] = 0.0
    topic.columns |= dict(zip(("flow_x", "flow_y", "gyro_x", "gyro_y"), rates.T, strict=True)) | {"level": quality}
    topic.keep(timed | blind, "no_integration_time")
    topic.keep(np.isfinite(topic.matrix("flow_x", "flow_y")).all(axis=1), "not_finite")
    topic.keep((abs(topic.matrix("flow_x", "flow_y")) <= FASTEST_RAD_S).all(axis=1), "out_of_range")
    value = topic.matrix("flow_x", "flow_y", "gyro_x", "gyro_y")
    value[:, 2:][~(abs(value[:, 2:]) <= FASTEST_RAD_S).all(axis=1)] = np.nan
    age_s = topic.delay_s + 0.5 * (float(np.median(dt_s[timed])) if timed.any() else 0.0)
    return Stream.of(
        Sensor.FLOW_RATE, topic.t_s, value, quality=topic.columns["level"], delay_s=age_s, rejected=topic.rejected
    )


def _seen_s(topic: Topic) -> float:
    """Seconds of exposure, weighed by quality."""
    quality = np.nan_to_num(topic.columns.get("quality", np.full(len(topic), 255.0)))
    return float(np.sum(quality * np.clip(_integration_s(topic), 0.0, LONGEST_INTEGRATION_S)) / 255.0)


def _integration_s(topic: Topic) -> Array:
    name = "integration_timespan_us" if topic.has("integration_timespan_us") else "integration_timespan"
    return np.nan_to_num(1e-6 * topic.matrix(name)[:, 0])


def _accumulated(topic: Topic) -> tuple[Array, Array]:
    """Flow and gyro about x and y over the integration time [rad], (n, 2) each, under new names or old."""
    if not topic.has("pixel_flow[0]"):
        flow = topic.matrix("pixel_flow_x_integral", "pixel_flow_y_integral")
        return flow, topic.matrix("gyro_x_rate_integral", "gyro_y_rate_integral")
    gyro = topic.vector("delta_angle", 2)
    if topic.has("delta_angle_available"):
        gyro[topic.columns["delta_angle_available"] == 0] = np.nan
    return topic.vector("pixel_flow", 2), gyro


def _turned(about_xy: Array, angle_rad: float) -> Array:
    """Two components turned about z."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return np.asarray(about_xy @ np.array([[c, s], [-s, c]]))


# -- range -------------------------------------------------------------------------------------------------
def range_stream(topics: Topics, flow: Topic | None) -> Stream | None:
    """The downward rangefinder with most readings; without one, the distance that the flow sensor states."""
    best = None
    for topic in topics.of("distance_sensor"):
        _keep_downward(topic)
        if len(topic) and (best is None or len(topic) > len(best)):
            best = topic
    if best is not None:
        variance = possible_variance(best.matrix("variance"))
        return Stream.of(
            Sensor.RANGE, best.t_s, best.matrix("current_distance"), variance=variance, delay_s=best.delay_s,
            rejected=best.rejected,
        )  # fmt: skip
    if flow is None:
        return None
    distance_m = flow.matrix("distance_m" if flow.has("distance_m") else "ground_distance_m")
    stated = (distance_m[:, 0] > 0.0) & (distance_m[:, 0] < FARTHEST_M)
    return Stream.of(Sensor.RANGE, flow.t_s[stated], distance_m[stated]) if stated.any() else None


def _keep_downward(topic: Topic) -> None:
    """Leave the readings that look down and are valid.

    A signal quality of 0 means an invalid reading, but some drivers state no quality and write 0 throughout.
    """
    if topic.has("orientation"):
        topic.keep(topic.columns["orientation"] == DOWNWARD_ROTATION, "not_downward")
    distance_m = topic.matrix("current_distance")[:, 0]
    topic.keep(np.isfinite(distance_m), "not_finite")
    distance_m = topic.matrix("current_distance")[:, 0]
    topic.keep((distance_m > 0) & (distance_m < FARTHEST_M), "out_of_range")
    quality = topic.columns.get("signal_quality", np.zeros(0))
    if np.any(quality > 0):
        topic.keep(quality != 0, "invalid")


def reading_limits(topics: Topics, flow: Topic | None) -> dict[str, tuple[float, float]]:
    """The limits that rangefinder and flow sensor state of themselves; 0 and 0, or nonsense, is no statement."""
    ranges = [topic for topic in topics.of("distance_sensor") if len(topic)]
    limits = {}
    if ranges:
        limits["range_m"] = _stated(max(ranges, key=len), "min_distance", "max_distance")
    if flow is not None and len(flow):
        limits["flow_height_m"] = _stated(flow, "min_ground_distance", "max_ground_distance")
        highest = _stated(flow, "max_flow_rate", "max_flow_rate")[1]
        limits["flow_rad_s"] = (0.0, highest)
    return {name: (low, high) for name, (low, high) in limits.items() if 0.0 <= low < high < np.inf}


def _stated(topic: Topic, low: str, high: str) -> tuple[float, float]:
    values = topic.matrix(low, high)
    known = values[np.isfinite(values).all(axis=1)]
    return (float(np.median(known[:, 0])), float(np.median(known[:, 1]))) if len(known) else (np.nan, np.nan)
