"""What may be tuned: a few settings, each by a factor on the value that it starts from."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from flownav.core.measurement import Array, Sensor
from flownav.logs.log import Log
from flownav.navigation.feed import imu_serves
from flownav.navigation.settings import NavigatorSettingsFile

USUAL_SPREAD = math.log(3.0)  # a datasheet's noise is right to a factor of three
SCALE_SPREAD = 0.1  # as `flow_scale_sigma`
MOST_NOISE = math.log(10.0)
MOST_SCALE = 0.35
FLOW_GAIN = "flow gain"


SHARES = {"flow_lasting_share": "share of the speed", "range_relative_sigma": "share of the range"}


class Knob(NamedTuple):
    """Settings that one factor moves together; spread: how far the factor's logarithm is expected to be from 0."""

    name: str
    keys: tuple[str, ...]
    unit: str
    sensors: tuple[Sensor, ...]
    spread: float = USUAL_SPREAD
    most: float = MOST_NOISE

    def unit_of(self, key: str) -> str:
        """The unit of one of its settings; what is a share of something else has its own."""
        return SHARES.get(key, self.unit)


FLOWS = (Sensor.FLOW_RATE, Sensor.FLOW_VELOCITY)
KNOBS = (  # in the order in which they are sought: what moves the path most comes first
    Knob(FLOW_GAIN, ("flow_gain_x", "flow_gain_y"), "reported over true", FLOWS, SCALE_SPREAD, MOST_SCALE),
    Knob("gyro noise", ("gyro_noise_rad_s_rt_hz",), "rad/s per root hertz", (Sensor.IMU,)),
    Knob("accelerometer noise", ("accel_noise_m_s2_rt_hz",), "m/s2 per root hertz", (Sensor.IMU,)),
    Knob("GPS position noise", ("gps_white_sigma_m", "gps_white_sigma_down_m"), "m", (Sensor.GPS_POSITION,)),
    Knob(
        "GPS velocity noise", ("gps_velocity_white_m_s", "gps_velocity_white_down_m_s"), "m/s", (Sensor.GPS_VELOCITY,)
    ),
    Knob("flow noise", ("flow_sigma_rad_s", "flow_low_quality_sigma_rad_s"), "rad/s", FLOWS),
    Knob("flow's lasting error", ("flow_lasting_rad_s", "flow_lasting_share"), "rad/s", FLOWS),
    Knob("range noise", ("range_sigma_m", "range_relative_sigma"), "m", (Sensor.RANGE,)),
    Knob("barometer noise", ("baro_sigma_m",), "m", (Sensor.BARO,)),
    Knob("magnetometer and heading noise", ("heading_noise_rad",), "rad", (Sensor.MAG, Sensor.YAW)),
    Knob("attitude noise", ("ins_tilt_white_rad",), "rad", (Sensor.ATTITUDE,)),
    Knob("external position noise", ("pose_sigma_m",), "m", (Sensor.POSE,)),
)


def knobs_of(log: Log, settings: NavigatorSettingsFile) -> list[Knob]:
    """Those whose sensor serves in a log and whose settings are not 0; a gain only where something tells the speed."""
    serving = {sensor for sensor, stream in log.streams.items() if len(stream)}
    serving.discard(Sensor.ATTITUDE if imu_serves(log.streams) else Sensor.IMU)
    scaled = log.truth is not None or bool(serving & {Sensor.GPS_POSITION, Sensor.POSE})
    return [
        knob for knob in KNOBS
        if serving & set(knob.sensors)
        and all(getattr(settings, key) > 0.0 for key in knob.keys)
        and (scaled or knob.name != FLOW_GAIN)
    ]  # fmt: skip


def turned(settings: NavigatorSettingsFile, knobs: Iterable[Knob], log_factors: Iterable[float]) -> dict[str, float]:
    """The settings that the factors change, by key, to the digits that a file states."""
    return {
        key: rounded(float(getattr(settings, key)) * math.exp(log_factor))
        for knob, log_factor in zip(knobs, log_factors, strict=True)
        if log_factor != 0.0
        for key in knob.keys
    }


def rounded(value: float) -> float:
    """To four digits: no log tells more."""
    return float(f"{value:.4g}")


def limits_of(knob: Knob, settings: NavigatorSettingsFile) -> tuple[float, float]:
    """The lowest and the highest log factor that the schema of the settings allows, MOST on either side at most."""
    low, high = -knob.most, knob.most
    for key in knob.keys:
        value = float(getattr(settings, key))
        for bound in NavigatorSettingsFile.model_fields[key].metadata:
            least, greatest = getattr(bound, "ge", None) or 0.0, getattr(bound, "le", math.inf)
            low = max(low, math.log(least / value)) if least > 0.0 else low
            high = min(high, math.log(greatest / value)) if math.isfinite(greatest) else high
    return min(low, 0.0), max(high, 0.0)


def penalty(knobs: Sequence[Knob], log_factors: Array) -> float:
    """Minus the logarithm of the prior: what a log does not show stays as it was."""
    return 0.5 * sum((float(factor) / knob.spread) ** 2 for knob, factor in zip(knobs, log_factors, strict=True))
