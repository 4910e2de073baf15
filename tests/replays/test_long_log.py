"""Two hours at a kilohertz through `flownav replay`: memory and processor time, printed (`make long-log`)."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from flownav.core.measurement import merge, merged_parts
from flownav.logs.open_log import open_log
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.replays import prepare
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import replay
from long_logs import write_long_ulog

MOST_BYTES, MOST_CPU_S = 1.5e9, 20.0


def replayed(log: Path) -> tuple[dict, float, float]:
    """The output of `replay --json` on a log, its peak memory [bytes] and its processor time [s]."""
    command = [sys.executable, "-m", "flownav", "replay", str(log), "--json", "--out", str(log.with_suffix(".fnr"))]
    with log.with_suffix(".json").open("w+") as out, subprocess.Popen(command, stdout=out) as child:
        _, status, used = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        assert child.returncode == 0
        out.seek(0)
        return json.load(out), 1024.0 * used.ru_maxrss, used.ru_utime + used.ru_stime


@pytest.mark.slow
def test_two_hours_at_a_kilohertz(tmp_path):
    replayed(write_long_ulog(tmp_path / "short.ulg", 60.0))  # compiles what is not compiled yet
    facts, memory_bytes, cpu_s = replayed(write_long_ulog(tmp_path / "long.ulg"))
    print(f"\nreplay of {facts['duration_s']:.0f} s at 1 kHz: {memory_bytes / 1e9:.2f} GB, {cpu_s:.1f} s of CPU")
    assert facts["duration_s"] == pytest.approx(7200.0, abs=1.0)
    assert facts["velocity_rms_m_s"] < 0.1
    assert memory_bytes <= MOST_BYTES
    assert cpu_s <= MOST_CPU_S


def test_a_log_fed_in_parts_is_the_log_fed_at_once(tmp_path, monkeypatch):
    log = open_log(write_long_ulog(tmp_path / "x.ulg", 40.0, imu_hz=200.0))
    options = ReplayOptions(gps_outages_s=((10.0, 20.0),))
    whole = replay(log, options, NavigatorSettingsFile())
    monkeypatch.setattr(prepare, "KEPT_QUEUE", 100)
    monkeypatch.setattr(prepare, "MERGED_EVENTS", 777)
    parts = replay(log, options, NavigatorSettingsFile())
    assert parts.estimate.tobytes() == whole.estimate.tobytes()
    assert np.array_equal(parts.innovation, whole.innovation, equal_nan=True)
    assert parts.scores() == whole.scores()


def test_parts_of_a_queue_are_the_queue(tmp_path):
    log = open_log(write_long_ulog(tmp_path / "x.ulg", 20.0, imu_hz=50.0))
    streams = list(log.streams.values())
    whole, parts = merge(streams), list(merged_parts(streams, 100))
    assert max(len(part.t_s) for part in parts) == 100
    for name in whole._fields:
        joined = np.concatenate([getattr(part, name) for part in parts])
        assert np.array_equal(joined, getattr(whole, name), equal_nan=True)
    assert np.all(np.diff(whole.t_s) >= 0.0)
    assert len(next(merged_parts([], 10)).t_s) == 0
