"""The spectrum of the vibration: known lines stand where and as high as they were made."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.scoring.vibration import SEGMENT, spectrum_of


def test_a_line_and_white_noise_stand_as_they_were_made():
    rate_hz, count = 250.0, 40_000
    random = np.random.default_rng(3)
    t_s = np.arange(count) / rate_hz + random.uniform(-2e-5, 2e-5, count)
    value = np.zeros((count, 6))
    value[:, 5] = -9.8 + 2.0 * np.sin(2.0 * np.pi * 40.0 * t_s)
    value[:, :3] = np.radians(0.5) * random.standard_normal((count, 3))
    found = spectrum_of(t_s, value)
    hz, accel, gyro = (np.array(found[name]) for name in ("frequency_hz", "accel_m_s2_rt_hz", "gyro_deg_s_rt_hz"))
    assert len(hz) == SEGMENT // 2
    assert hz[-1] == pytest.approx(0.5 * rate_hz, rel=1e-3)
    assert hz[np.argmax(accel)] == pytest.approx(40.0, abs=rate_hz / SEGMENT)
    near = np.abs(hz - 40.0) < 3.0
    assert np.sqrt(np.sum(accel[near] ** 2) * hz[0]) == pytest.approx(2.0 / np.sqrt(2.0), rel=0.02)  # its rms
    assert np.max(accel[~near]) < 0.01 * np.max(accel)
    level = 0.5 * np.sqrt(3.0) * np.sqrt(2.0 / rate_hz)  # three axes of 0.5 °/s
    assert np.median(gyro[10:-10]) == pytest.approx(level, rel=0.05)


def test_what_is_too_short_too_slow_or_full_of_holes_has_none():
    good = np.random.default_rng(1).standard_normal((2000, 6))
    assert spectrum_of(np.arange(2000) / 100.0, good) is not None
    assert spectrum_of(np.arange(400) / 100.0, good[:400]) is None
    assert spectrum_of(np.arange(2000) / 10.0, good) is None
    assert spectrum_of(np.zeros(2000), good) is None
    holed = np.arange(2000) / 100.0 + np.where(np.arange(2000) > 1000, 1e6, 0.0)
    assert spectrum_of(holed, good) is None
    assert spectrum_of(np.arange(2000) / 100.0, np.full((2000, 6), np.nan)) is None
