"""The time span of each sensor's readings, and the sensors that were silent while the others sent readings."""

from collections.abc import Mapping

import numpy as np

from flownav.core.measurement import Array, Sensor, Stream

LEAST_SILENCE_S = 5.0
LEAST_SILENT_SHARE = 0.05  # of the log
MOST_SILENT_SHARE = 0.25  # of a short log
LONG_STEPS = 10.0  # a sensor's own steps that are no pause yet
LEAST_STREAMS = 3  # that can outvote one
SELDOM = (Sensor.LANDED, Sensor.PAD)  # these send readings only at events

Window = tuple[float, float]


def coverage_of(streams: Mapping[Sensor, Stream]) -> dict[str, Window]:
    """First and last reading [s] of every stream that has one, by the sensor's name."""
    return {
        sensor.name.lower(): (float(stream.t_s[0]), float(stream.t_s[-1]))
        for sensor, stream in streams.items()
        if len(stream)
    }


def silences(streams: Mapping[Sensor, Stream], span_s: Window) -> list[str]:
    """One line for each time that a stream is away from the log's main part for long (`_long`).

    It starts late, ends early, pauses, or goes on where all others are silent. span_s: the log's first and last
    instant, on its own clock.
    """
    arrivals = {s.name.lower(): stream.t_s for s, stream in streams.items() if len(stream) and s not in SELDOM}
    start, end = _main_part(list(arrivals.values()), span_s)
    allowed, notes = _long(end - start), []
    for name, t_s in arrivals.items():
        first, last = float(t_s[0]), float(t_s[-1])
        if first - start > allowed:
            notes.append(f"{name} starts at {first:.1f} s of {end:.1f} s")
        if end - last > allowed:
            notes.append(f"{name} ends at {last:.1f} s of {end:.1f} s")
        if start - first > allowed:
            notes.append(f"{name} starts at {first:.1f} s, and most others at {start:.1f} s")
        if last - end > allowed:
            notes.append(f"{name} goes on to {last:.1f} s, and most others end at {end:.1f} s")
        notes += _pauses(name, t_s, allowed)
    return notes


def _main_part(times: list[Array], span_s: Window) -> Window:
    """The span in which half of the streams have readings: the log's span, unless a few go far beyond the others."""
    if len(times) < LEAST_STREAMS:
        return span_s
    starts, ends = sorted(t[0] for t in times), sorted(t[-1] for t in times)
    start, end = float(starts[(len(starts) - 1) // 2]), float(ends[len(ends) // 2])
    if start >= end:
        return span_s
    allowed = _long(end - start)
    return (start if start - span_s[0] > allowed else span_s[0], end if span_s[1] - end > allowed else span_s[1])


def _long(lasts_s: float) -> float:
    """How long a silence is worth a word [s]."""
    return min(max(LEAST_SILENCE_S, LEAST_SILENT_SHARE * lasts_s), MOST_SILENT_SHARE * lasts_s)


def _pauses(name: str, t_s: Array, allowed_s: float) -> list[str]:
    """Gaps in a stream, in one line; of a slow sensor only those of many of its own steps."""
    steps = np.diff(t_s)
    if not len(steps):
        return []
    long = np.flatnonzero(steps > max(allowed_s, LONG_STEPS * float(np.median(steps))))
    if not len(long):
        return []
    longest = long[np.argmax(steps[long])]
    one = f"{name} has no usable reading for {steps[longest]:.1f} s from {t_s[longest]:.1f} s on"
    more = f" ({len(long)} such gaps, {steps[long].sum():.1f} s together)" if len(long) > 1 else ""
    return [one + more]
