"""Made flights beside real ones: how their sensors and their motion look, by figures that need no model of either."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flownav.core.measurement import Sensor, Stream
from flownav.core.record import POSITION_NED
from flownav.logs.csv_folder import read_csv_folder
from flownav.logs.log import Log
from flownav.logs.open_log import open_flight
from flownav.replays.judged import airborne_of
from flownav.scoring.path import columns_of
from flownav.scoring.reference import velocity_of
from made.classes import make
from made.flight import Array, write

BANDS_HZ = ((0.5, 4.0), (4.0, 16.0), (16.0, 125.0))
ENDS_S = 3.0  # of a flight, left out where it is looked at as flight
REAL = ("quad-px4flow-mocap", "px4-voxl-indoor/voxl_two_flow_sensors.ulg")


class Look(NamedTuple):
    """How a flight looks; NaN where it cannot tell.

    gyro_rest_rad_s, accel_rest_m_s2: noise before the motors turn. gyro_rad_s, accel_m_s2 (3,): in flight, by BANDS_HZ,
    the median axis. flow_rad_s: what is rough about the flow in flight, from second differences. blind: share of
    readings without data. range_m: what is rough about the range. wild: share of ranges more than 0.15 m from their
    neighbours. speed_m_s: median in flight. slide_m_s: sideways, within 1.5 s of lift-off.
    """

    imu_hz: float
    gyro_rest_rad_s: float
    accel_rest_m_s2: float
    gyro_rad_s: tuple[float, ...]
    accel_m_s2: tuple[float, ...]
    flow_hz: float
    flow_rad_s: float
    blind: float
    range_hz: float
    range_m: float
    wild: float
    height_m: float
    speed_m_s: float
    slide_m_s: float


def look_of(log: Log) -> Look:
    """A log's."""
    window = airborne_of(log) or log.span_s
    inner = (window[0] + ENDS_S, window[1] - ENDS_S)
    gyro_rest, accel_rest, gyro, accel, imu_hz = _inertial(log.streams.get(Sensor.IMU), window, inner)
    flow = log.streams.get(Sensor.FLOW_RATE, log.streams.get(Sensor.FLOW_VELOCITY))
    distance = log.streams.get(Sensor.RANGE)
    height, speed, slide = _motion(log, window)
    flow_rad_s = _rough(flow, inner) if flow is not None and flow.sensor == Sensor.FLOW_RATE else np.nan
    blind = np.nan if flow is None else float(np.mean(flow.quality[_within(flow.t_s, inner)] == 0.0))
    return Look(
        imu_hz, gyro_rest, accel_rest, gyro, accel, _hz(flow), flow_rad_s, blind,
        _hz(distance), np.nan if distance is None else _rough(distance, inner), _wild(distance, inner),
        height, speed, slide,
    )  # fmt: skip


def _within(t_s: Array, window: tuple[float, float]) -> np.ndarray:
    return (t_s >= window[0]) & (t_s <= window[1])


def _hz(stream: Stream | None) -> float:
    return np.nan if stream is None or len(stream) < 2 else (len(stream) - 1) / float(stream.t_s[-1] - stream.t_s[0])


def _inertial(
    imu: Stream | None, window: tuple[float, float], inner: tuple[float, float]
) -> tuple[float, float, tuple[float, ...], tuple[float, ...], float]:
    """Noise at rest of gyro and accelerometer, rms by band in flight of either, and the rate."""
    nothing = (np.nan,) * len(BANDS_HZ)
    hz = _hz(imu)
    if imu is None or hz < 20.0:
        return np.nan, np.nan, nothing, nothing, hz
    each = max(round(0.2 * hz), 5)
    before = imu.value[imu.t_s < window[0]]
    windows = [before[k : k + each].std(axis=0) for k in range(0, len(before) - each, each)]
    quiet = np.min(windows, axis=0) if windows else np.full(6, np.nan)
    bands = _bands(imu.value[_within(imu.t_s, inner)], hz)
    gyro = tuple(np.median(bands[:, :3], axis=1).tolist())
    accel = tuple(np.median(bands[:, 3:], axis=1).tolist())
    return float(np.median(quiet[:3])), float(np.median(quiet[3:])), gyro, accel, hz


def _bands(values: Array, hz: float) -> Array:
    """Root mean square of columns (n, k) by band: (bands, k), NaN beyond half the rate."""
    window = np.hanning(len(values))[:, None]
    power = np.abs(np.fft.rfft((values - values.mean(axis=0)) * window, axis=0)) ** 2
    at = np.fft.rfftfreq(len(values), 1.0 / hz)
    scale = 2.0 / (len(values) * float(np.sum(window**2)))
    found = [np.sqrt(power[(at >= low) & (at < high)].sum(axis=0) * scale) for low, high in BANDS_HZ]
    return np.array([row if low < 0.5 * hz else np.full(values.shape[1], np.nan)
                     for row, (low, _) in zip(found, BANDS_HZ, strict=True)])  # fmt: skip


def _rough(stream: Stream, inner: tuple[float, float]) -> float:
    """The residual of a straight line between neighbours, robust: 1.4826 times the median size over root 6."""
    good = _within(stream.t_s, inner) & (stream.quality > 0)
    values = stream.value[good, : min(2, stream.value.shape[1])]
    bent = values[2:] - 2.0 * values[1:-1] + values[:-2]
    return float(1.4826 * np.median(np.abs(bent)) / np.sqrt(6.0)) if len(bent) else np.nan


def _wild(distance: Stream | None, inner: tuple[float, float]) -> float:
    if distance is None:
        return np.nan
    metres = distance.value[_within(distance.t_s, inner), 0]
    if len(metres) < 5:
        return np.nan
    beside = np.median(np.lib.stride_tricks.sliding_window_view(metres, 5), axis=1)
    return float(np.mean(np.abs(metres[2:-2] - beside) > 0.15))


def _motion(log: Log, window: tuple[float, float]) -> tuple[float, float, float]:
    """Height and speed in flight, medians, and how fast it slides at lift-off."""
    if log.truth is None:
        return np.nan, np.nan, np.nan
    t_s, place = np.asarray(log.truth["t_s"], float), columns_of(log.truth, POSITION_NED)
    speed = np.hypot(*velocity_of(t_s, place)[:, :2].T)
    inside, first = _within(t_s, window), _within(t_s, (window[0], window[0] + 1.5))
    height = float(np.median(place[0, 2] - place[inside, 2]))
    return height, float(np.median(speed[inside])), float(np.percentile(speed[first], 90.0))


# -- the table ---------------------------------------------------------------------------------------------------
HEADINGS = (
    "flights", "IMU [Hz]", "at rest: gyro [mrad/s]", "accel [mm/s²]",
    "in flight: gyro 0.5 to 4 Hz [mrad/s]", "4 to 16 Hz", "16 to 125 Hz",
    "accel 0.5 to 4 Hz [m/s²]", "4 to 16 Hz", "16 to 125 Hz",
    "flow [Hz]", "flow rough [mrad/s]", "no data [%]", "range [Hz]", "range rough [mm]", "wild [%]",
    "height [m]", "speed [m/s]", "slide at lift-off [m/s]",
)  # fmt: skip


def figures(look: Look) -> list[float]:
    """In the units of HEADINGS."""
    return [
        look.imu_hz, 1e3 * look.gyro_rest_rad_s, 1e3 * look.accel_rest_m_s2,
        *(1e3 * value for value in look.gyro_rad_s),
        *look.accel_m_s2, look.flow_hz, 1e3 * look.flow_rad_s, 100.0 * look.blind, look.range_hz, 1e3 * look.range_m,
        100.0 * look.wild, look.height_m, look.speed_m_s, look.slide_m_s,
    ]  # fmt: skip


def made_log(name: str, number: int) -> Log:
    """A made flight as its reader has it."""
    with tempfile.TemporaryDirectory() as folder:
        write(make(name, number), Path(folder))
        return read_csv_folder(Path(folder))


def compared(data: Path, names: Sequence[str], seeds: range) -> str:
    """Markdown: real flights and those of another generator a row each, made ones a class a row, medians of seeds."""
    paths = [data / name for name in REAL] + sorted((data / "indoor-made").glob("*"))
    rows = [(path.relative_to(data).as_posix(), figures(look_of(open_flight(path)))) for path in paths if path.exists()]
    for name in names:
        looks = np.array([figures(look_of(made_log(name, number))) for number in seeds])
        known = np.where(np.isnan(looks).all(axis=0), 0.0, looks)
        rows.append((name, np.where(np.isnan(looks).all(axis=0), np.nan, np.nanmedian(known, axis=0)).tolist()))
    lines = [HEADINGS, ("---", *["---:"] * (len(HEADINGS) - 1))]
    lines += [(name, *(f"{value:.3g}" if np.isfinite(value) else "-" for value in values)) for name, values in rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)
