"""The spectrum of the vibration as a picture of its own: its axis is frequency, and no instant moves it."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from flownav.core.measurement import COLUMNS, Array, Sensor
from flownav.core.record import Record, mapping
from flownav.report.panels import Panel, Still, listed, number
from flownav.report.series import track
from flownav.scoring.vibration import spectrum_of

WIDE_PX, NARROW_PX, HIGH_PX, LEFT_PX, GAP_PX = 1080, 380, 150, 58, 24  # narrow: on a phone
MARK_PX = 90  # of frequency between two labels, at least
LABEL_PX = 24  # from the edge, within which a label in the middle of its mark would be cut
MOTION_HZ = 5.0  # of a vehicle that flies; what is faster is vibration
ROWS = (("accel_m_s2_rt_hz", "accelerometer (m/s²/√Hz)", "m/s²"), ("gyro_deg_s_rt_hz", "gyro (°/s/√Hz)", "°/s"))


def spectrum(record: Record) -> list[Panel]:
    """Densities over frequency, with the largest line of each named; none without inertial readings."""
    found = mapping(record.manifest.get("vibration")) or _of_imu(record)
    frequency = _numbers(found, "frequency_hz")
    rows = [(title, unit, _numbers(found, key)) for key, title, unit in ROWS]
    if len(frequency) < 2 or any(len(values) != len(frequency) for _, _, values in rows):
        return []
    shaken = frequency >= MOTION_HZ
    peaks = [f"{title.split(' ')[0]} {frequency[shaken][np.argmax(values[shaken])]:.1f} Hz" for title, _, values in rows
             if shaken.any()]  # fmt: skip
    caption = (
        "How strongly each frequency shakes the IMU, all axes together, over the whole record. Strongest above "
        f"{MOTION_HZ:g} Hz, faster than the vehicle itself: {listed(peaks)}. A rotor's line stands at its turns "
        "a second, its blades' at a multiple."
    )
    high = len(rows) * (HIGH_PX + GAP_PX) + 4
    svg = "".join(
        f'<svg class="still {shown}" viewBox="0 0 {wide} {high}" aria-hidden="true">'
        f"{''.join(_row(k, title, frequency, values, wide) for k, (title, _, values) in enumerate(rows))}</svg>"
        for wide, shown in ((WIDE_PX, "on-wide"), (NARROW_PX, "on-narrow"))
    )
    alt = f"Vibration of the IMU over frequency, to {frequency[-1]:.0f} Hz. {caption}"
    return [Panel("vibration-spectrum", "Vibration by frequency", caption, alt, Still(svg), wide=True)]


def _of_imu(record: Record) -> Mapping[str, Any]:
    imu = track(record, "imu", COLUMNS[Sensor.IMU])
    return {} if imu is None else spectrum_of(imu.t_s, imu.value) or {}


def _numbers(found: Mapping[str, Any], key: str) -> Array:
    """Finite positive numbers of a manifest; none where it holds something else."""
    values = found.get(key)
    if not isinstance(values, list) or not all(isinstance(one, float) for one in values):
        return np.zeros(0)
    known: Array = np.maximum(np.nan_to_num(np.asarray(values, float), posinf=0.0), 1e-9)
    return known


def _row(place: int, title: str, frequency: Array, values: Array, wide_px: int) -> str:
    """One density, on a logarithmic scale of whole decades: the largest value of each half pixel."""
    top, right = place * (HIGH_PX + GAP_PX) + 20, wide_px - 8
    low, high = np.floor(np.log10(np.quantile(values, 0.02))), np.ceil(np.log10(values.max()))
    high = max(high, low + 1)

    def across(hz: Array | float) -> Any:
        return LEFT_PX + (right - LEFT_PX) * np.asarray(hz) / frequency[-1]

    def up(value: Array | float) -> Any:
        return top + HIGH_PX - 20 - (HIGH_PX - 20) * np.clip((np.log10(value) - low) / (high - low), 0.0, 1.0)

    def anchored(hz: float) -> str:
        side = "end" if across(hz) > wide_px - LABEL_PX else "middle"
        return f'text-anchor="{side}"'

    decades = "".join(
        f'<line x1="{LEFT_PX}" x2="{right}" y1="{up(10.0**k):.1f}" y2="{up(10.0**k):.1f}"/>'
        f'<text x="{LEFT_PX - 6}" y="{up(10.0**k) + 4:.1f}" text-anchor="end">{10.0**k:g}</text>'
        for k in np.arange(low, high + 1)
    )
    step = next(
        one for one in (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 10**9) if frequency[-1] / one <= wide_px / MARK_PX
    )
    marks = "".join(
        f'<line x1="{across(hz):.1f}" x2="{across(hz):.1f}" y1="{top}" y2="{up(10.0**low):.1f}"/>'
        f'<text x="{across(hz):.1f}" y="{up(10.0**low) + 16:.1f}" {anchored(hz)}>{number(float(hz), 0)}'
        f"{' Hz' if hz + step > frequency[-1] else ''}</text>"
        for hz in np.arange(0.0, frequency[-1], step)
    )
    starts = np.arange(0, len(values), -(-len(values) // (2 * wide_px)))
    largest = np.maximum.reduceat(values, starts)
    line = " ".join(f"{x:.1f},{y:.1f}" for x, y in zip(across(frequency[starts]), up(largest), strict=True))
    return f'{decades}{marks}<text x="4" y="{top - 10}">{title}</text><polyline points="{line}"/>'
