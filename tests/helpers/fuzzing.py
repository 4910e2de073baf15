"""Shared parts of fuzz tests: the number of mutants, and the promise of every reader about its result."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from flownav.core.errors import InputError
from flownav.core.measurement import COLUMNS, Sensor
from flownav.core.record import LATEST_S, LONGEST_S
from flownav.logs.log import Log

MUTANTS = int(os.environ.get("FLOWNAV_FUZZ", "200"))  # a sample; `make fuzz` asks for a hundred times as many
FIRST_SEED = int(os.environ.get("FLOWNAV_FUZZ_FIRST", "0"))
SECONDS_PER_MB, FLOOR_S = 1.0, 6.0  # the first read imports its library: 1.4 s on a busy machine
BYTES_PER_BYTE, FLOOR_BYTES = 60, 128 << 20
# what a sensor of a vehicle may say at most, in its own unit: beyond it a unit, a scale or a bit is wrong
MOST = {
    Sensor.GPS_POSITION: 1e6, Sensor.GPS_VELOCITY: 1e3, Sensor.FLOW_RATE: 1e3, Sensor.FLOW_VELOCITY: 1e3,
    Sensor.RANGE: 1e5, Sensor.IMU: 1e4, Sensor.ATTITUDE: 1.1, Sensor.BARO: 1e5, Sensor.MAG: 1e3, Sensor.POSE: 1e6,
    Sensor.YAW: 1e3, Sensor.PAD: 1e4, Sensor.LANDED: 1.0,
}  # fmt: skip


def assert_sound(log: Log, most: Mapping[Sensor, float] = MOST, longer: float = 0.1) -> None:
    """Assert the promise of every Log, however little of the file was left.

    most: of each sensor's values; longer: by how much a quaternion may be.
    """
    assert log.streams
    assert all("\n" not in note for note in log.notes)
    for sensor, stream in log.streams.items():
        count, width = len(stream.t_s), len(COLUMNS[sensor])
        assert stream.value.shape == stream.variance.shape == (count, width)
        assert stream.quality.shape == (count,)
        assert all(kept > 0 for kept in stream.rejected.values())
        assert_times(stream.t_s)
        size = np.abs(stream.value)
        assert not np.any(size > most[sensor]), (sensor, float(np.nanmax(size)))
        assert np.all((stream.quality >= 0.0) & (stream.quality <= 255.0))
        assert not np.any((stream.variance < 0.0) | np.isinf(stream.variance))
        assert np.isfinite(stream.delay_s)
        if sensor == Sensor.ATTITUDE:
            assert np.allclose(np.linalg.norm(stream.value, axis=1), 1.0, rtol=0.0, atol=longer)
    start, end = log.span_s if any(map(len, log.streams.values())) else (0.0, 0.0)
    assert end - start <= LONGEST_S
    for table in (log.truth, log.autopilot):
        if table is not None:
            assert len({len(column) for column in table.values()}) == 1
            assert_times(table["t_s"])
            assert not any(np.isinf(column).any() for column in table.values())
    assert log.origin_deg_m is None or (np.isfinite(log.origin_deg_m).all() and abs(log.origin_deg_m[0]) <= 90.0)


def assert_times(t_s: np.ndarray) -> None:
    """Finite seconds of one clock, in order, of two days at most."""
    assert np.all(np.isfinite(t_s))
    assert np.all(np.diff(t_s) >= 0.0)
    assert not len(t_s) or (t_s[-1] - t_s[0] <= LONGEST_S and max(-t_s[0], t_s[-1]) < LATEST_S)


def peak_bytes(anew: bool = False) -> int:
    """The most memory held since it was last asked anew; 0 where the system does not tell (Linux does)."""
    try:
        if anew:
            Path("/proc/self/clear_refs").write_text("5")
        status = Path("/proc/self/status").read_text()
    except OSError:
        return 0
    return 1024 * int(status.split("VmHWM:")[1].split()[0])


def assert_promise(
    read: Callable[[Path], Any], path: Path, size: int, what: str, check: Callable[[Any], None] = assert_sound
) -> bool:
    """An InputError of one line, or what passes the check; within time and memory that follow the size.

    Whether it was read.
    """
    before = peak_bytes(anew=True)
    begun = time.process_time()
    said = ""
    try:
        check(read(path))
    except InputError as error:
        said = str(error)
    except Exception as error:
        raise AssertionError(f"{what}: {type(error).__name__}: {error}") from error
    assert "\n" not in said, what
    assert time.process_time() - begun < FLOOR_S + SECONDS_PER_MB * size / 1e6, what
    assert peak_bytes() - before < FLOOR_BYTES + BYTES_PER_BYTE * size, what
    return not said
