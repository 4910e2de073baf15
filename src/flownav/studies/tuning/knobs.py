"""The settings that may be tuned, each by a factor, and which windows of flights are fitted and which judge the fit.

Between two windows lies a gap, so that a lasting error in one is not found again in the next.
"""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from flownav.core.errors import InputError
from flownav.core.measurement import Array, Sensor
from flownav.logs.log import Log
from flownav.navigation.feed import imu_serves
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.replays.judged import Window, airborne_of

USUAL_SPREAD = math.log(3.0)  # a datasheet's noise is right to a factor of three
SCALE_SPREAD = 0.1  # as `flow_scale_sigma`
MOST_NOISE = math.log(10.0)
MOST_SCALE = 0.35
FLOW_GAIN = "flow gain"


LEAST_STARTS = 3  # a flight starts once: two do not show how starts differ


SHARES = {"flow_lasting_share": "share of the speed", "range_relative_sigma": "share of the range"}


class Knob(NamedTuple):
    """Settings that one factor moves together; spread: how far the factor's logarithm is expected to be from 0.

    start: how much is unknown before the first reading, of which a flight is one sample, however long it lasts.
    """

    name: str
    keys: tuple[str, ...]
    unit: str
    sensors: tuple[Sensor, ...]
    spread: float = USUAL_SPREAD
    most: float = MOST_NOISE
    start: bool = False

    def unit_of(self, key: str) -> str:
        """The unit of one of its settings; what is a share of something else has its own."""
        return SHARES.get(key, self.unit)


FLOWS = (Sensor.FLOW_RATE, Sensor.FLOW_VELOCITY)
MOVING = (Sensor.IMU, Sensor.ATTITUDE)
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
    Knob("gyro bias at the start", ("gyro_bias_sigma_rad_s",), "rad/s", (Sensor.IMU,), start=True),
    Knob("accelerometer bias at the start", ("accel_bias_sigma_m_s2",), "m/s2", (Sensor.IMU,), start=True),
    Knob("velocity at the start", ("start_velocity_sigma_m_s",), "m/s", (*MOVING, *FLOWS), start=True),
    Knob("flow scale at the start", ("flow_scale_sigma",), "share of the flow", FLOWS, start=True),
    Knob("compass deviation at the start", ("compass_sigma_rad",), "rad", (Sensor.MAG,), start=True),
    Knob("heading error at the start", ("ins_heading_sigma_rad",), "rad", (Sensor.MAG, Sensor.ATTITUDE), start=True),
    Knob("GPS velocity's lag at the start", ("gps_velocity_lag_sigma_s",), "s", (Sensor.GPS_VELOCITY,), start=True),
)


def knobs_of(log: Log, settings: NavigatorSettingsFile, *, starts: bool = False) -> list[Knob]:
    """Those whose sensor serves in a log and whose settings are not 0; a gain only where another sensor gives the
    speed.

    starts: those of the start too.
    """
    serving = {sensor for sensor, stream in log.streams.items() if len(stream)}
    serving.discard(Sensor.ATTITUDE if imu_serves(log.streams) else Sensor.IMU)
    scaled = log.truth is not None or bool(serving & {Sensor.GPS_POSITION, Sensor.POSE})
    return [
        knob for knob in KNOBS
        if serving & set(knob.sensors)
        and (starts or not knob.start)
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
    """A value to four digits, which no log exceeds in accuracy."""
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


# -- windows -----------------------------------------------------------------------------------------------------
LONGEST_S = 30.0  # half of it is no harder a GPS cut, twice of it leaves too few windows of a usual flight
USUAL_S = 5.0
SHORTEST_S = 3.0  # a shorter one holds too few readings of a 10 Hz sensor
LEAST_JUDGES = 6  # with fewer, chance alone puts all of them on one side more often than once in forty
GAP_SHARE = 0.1
EVERY_THIRD = 3  # of several logs, one in three is held out whole


class Split(NamedTuple):
    """A log's windows: those of the fit and those that judge it [s]; whole: the log is held out, nothing is fitted."""

    fit: tuple[Window, ...]
    held: tuple[Window, ...]
    whole: bool = False


def split_flight(log: Log) -> Split:
    """Alternate windows of the flight; of the whole log where the flight is not known.

    InputError where the flight is too short for LEAST_JUDGES of each kind.
    """
    first, last = _flight_of(log)
    length = _length(last - first)
    if why := too_short(log):
        raise InputError(f"{log.path}: {why}; give a log of {2 * LEAST_JUDGES * SHORTEST_S:g} s or more")
    count = int((last - first) / length + 1e-9)
    windows = [(first + k * length, first + (k + 1.0 - GAP_SHARE) * length) for k in range(count)]
    return Split(tuple(windows[::2]), tuple(windows[1::2]))


def too_short(log: Log) -> str | None:
    """Why a log cannot be cut into windows enough; None where it can."""
    first, last = _flight_of(log)
    if _length(last - first) >= SHORTEST_S:
        return None
    what = "the log" if airborne_of(log) is None else "the flight"
    return f"{what} lasts {last - first:.1f} s, too short for {2 * LEAST_JUDGES} windows of {SHORTEST_S:g} s"


def _flight_of(log: Log) -> Window:
    """From lift-off to touchdown; the whole log where these are not known."""
    return airborne_of(log) or log.span_s


def _length(flight_s: float) -> float:
    """Length of one window and the gap after it [s]: twice as many as are needed where that leaves USUAL_S to each."""
    return min(max(flight_s / (4 * LEAST_JUDGES), USUAL_S), flight_s / (2 * LEAST_JUDGES), LONGEST_S)


def split_flights(logs: Sequence[Log]) -> list[Split]:
    """Each log's windows; of several logs the second of every three has nothing fitted to it.

    InputError as `split_flight`.
    """
    splits = [split_flight(log) for log in logs]
    return [
        Split((), split.held, whole=True) if number % EVERY_THIRD == 1 else split for number, split in enumerate(splits)
    ]
