"""From when to when each sensor spoke, and which fell silent long before the log did."""

from __future__ import annotations

from collections.abc import Mapping

from flownav.measurement import Sensor, Stream

LEAST_SILENCE_S = 5.0
LEAST_SILENT_SHARE = 0.05  # of the log
SELDOM = (Sensor.LANDED, Sensor.PAD)  # these speak when there is something to say

Window = tuple[float, float]


def coverage_of(streams: Mapping[Sensor, Stream]) -> dict[str, Window]:
    """First and last reading [s] of every stream that has one, by the sensor's name."""
    return {
        sensor.name.lower(): (float(stream.t_s[0]), float(stream.t_s[-1]))
        for sensor, stream in streams.items()
        if len(stream)
    }


def silences(streams: Mapping[Sensor, Stream], span_s: Window) -> list[str]:
    """One line for each stream that starts late or ends early: by LEAST_SILENCE_S, and LEAST_SILENT_SHARE of the log.

    span_s: the log's first and last instant, on its own clock.
    """
    start, end = span_s
    allowed = max(LEAST_SILENCE_S, LEAST_SILENT_SHARE * (end - start))
    seldom, said = {sensor.name.lower() for sensor in SELDOM}, []
    for name, (first, last) in coverage_of(streams).items():
        if name not in seldom and first - start > allowed:
            said.append(f"{name} starts at {first:.1f} s of {end:.1f} s")
        if name not in seldom and end - last > allowed:
            said.append(f"{name} ends at {last:.1f} s of {end:.1f} s")
    return said
