"""When a range is not the height: it repeats one value (at its ceiling, or stuck), or leaves the height of a witness.

A rangefinder beyond its reach repeats its greatest value, or one that it last had; every gain is then too small, and no
scale mends it. Two signs: one value to the last digit for far longer than any other is repeated, and a height of
another witness from which the range, right at take-off, goes away by a large share for seconds. A barometer
is one where it has not drifted by the end, and it names the seconds alone; what the reference contradicts is not used.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Array, Sensor
from flownav.logs.log import Log, attitude_at

REPEATED_S, REPEATED_READINGS, TIMES_THE_USUAL = 2.0, 20, 4.0
BROKEN_S = 0.5  # a gap ends a stretch
CEILING_M = 0.02  # below the greatest value
START_S, AWAY_S, WIDTH_S = 3.0, 2.0, 0.5
MOVES_M = 0.3  # up and down, by a witness that lives
BACK_M = 1.5  # of the range at landing: a barometer further off has drifted
# from which on a witness contradicts: metres, and share of the height. A barometer stands in the rotors' wash
WITNESSES = {"truth": (0.5, 0.3), "baro": (3.0, 0.5)}
LEAST_ROWS = 50
KEPT_M = 0.05  # up and down, by a truth of a vehicle that keeps its height: chosen

Flags = NDArray[np.bool_]
Witness = tuple[str, str, Array, Array]  # its kind, its name, its instants and heights


class Untrue(NamedTuple):
    """The ranges (n,) that are not the height, and what is wrong with them in words, one line each."""

    flags: Flags
    notes: tuple[str, ...]


def untrue(log: Log, flying: Flags) -> Untrue:
    """Of a log with ranges; flying (n,) of its readings."""
    stream = log.streams[Sensor.RANGE]
    t_s, range_m = stream.t_s - stream.delay_s, stream.value[:, 0]
    rows = np.flatnonzero(flying & (range_m > 0.0) & (stream.quality > 0.0))
    flags, notes = np.zeros(len(t_s), bool), []
    if len(rows) < LEAST_ROWS:
        return Untrue(flags, ())
    found = [_repeated(t_s[rows], range_m[rows], _height(log))]
    left = rows[~found[0].flags]
    flags[rows[found[0].flags]] = True
    if len(left) >= LEAST_ROWS:
        away = _away(log, t_s[left], range_m[left])
        flags[left[away.flags]] = True
        found.append(away)
    notes = [line for one in found for line in one.notes]
    return Untrue(flags, tuple(notes))


def _repeated(t_s: Array, range_m: Array, witness: Witness | None = None) -> Untrue:
    """One value to the last digit, but the lowest, for far longer than every other; not while a truth keeps its height
    as well, as in a steady hover.
    """
    edges = np.flatnonzero((np.diff(range_m) != 0.0) | (np.diff(t_s) > BROKEN_S)) + 1
    runs = list(pairwise([0, *edges.tolist(), len(t_s)]))
    lasts = np.array([0.0 if _keeps(witness, t_s[a], t_s[b - 1]) else t_s[b - 1] - t_s[a] for a, b in runs])
    value = range_m[runs[int(np.argmax(lasts))][0]]
    others = [last for last, (a, _) in zip(lasts, runs, strict=True) if range_m[a] != value]
    usual = float(np.max(others, initial=0.0))
    floor = value <= float(range_m.min()) + CEILING_M
    long = [
        (a, b)
        for last, (a, b) in zip(lasts, runs, strict=True)
        if range_m[a] == value and last >= max(REPEATED_S, TIMES_THE_USUAL * usual) and b - a >= REPEATED_READINGS
    ]
    flags = np.zeros(len(t_s), bool)
    if floor or not long:
        return Untrue(flags, ())
    ceiling = value >= float(range_m.max()) - CEILING_M
    for a, b in long:
        flags[a:b] = True
    if ceiling:
        flags |= range_m >= value
    seconds = sum(float(t_s[b - 1] - t_s[a]) for a, b in long)
    what = f"it stands at its ceiling of {value:.2f} m" if ceiling else f"it repeats {value:.2f} m"
    return Untrue(flags, (f"the range stopped being true at {t_s[long[0][0]]:.1f} s: {what} for {seconds:.0f} s",))


def _away(log: Log, t_s: Array, range_m: Array) -> Untrue:
    """Where the range, right at take-off, leaves the height of a witness for seconds."""
    nothing = Untrue(np.zeros(len(t_s), bool), ())
    witness = _height(log)
    if witness is None or Sensor.ATTITUDE not in log.streams:
        return nothing
    kind, name, times, height = witness
    inside = (t_s >= times[0]) & (t_s <= times[-1])
    _, x, y, _ = attitude_at(log.streams[Sensor.ATTITUDE], t_s).T
    upright = 1.0 - 2.0 * (x**2 + y**2)  # the cosine of the tilt
    apart = range_m * upright - np.interp(t_s, times, height)
    first = inside & (t_s <= t_s[0] + START_S)
    if first.sum() < 10 or _span(height, (times >= t_s[0]) & (times <= t_s[-1])) < MOVES_M:
        return nothing
    apart = apart - float(np.median(apart[first]))
    expected = np.maximum(range_m * upright - apart, 0.1)
    least_m, share = WITNESSES[kind]
    far = inside & (np.abs(apart) > np.maximum(least_m, share * expected))
    count = max(1, round(WIDTH_S / max(float(np.median(np.diff(t_s))), 1e-3)))
    far = np.convolve(far, np.ones(2 * count + 1), "same") > count  # an echo is no stretch
    edges = np.flatnonzero(np.diff(np.concatenate([[False], far, [False]]).astype(int))).reshape(-1, 2)
    long = [(a, b) for a, b in edges if t_s[b - 1] - t_s[a] >= AWAY_S]
    if not long:
        return nothing
    last = inside & (t_s >= t_s[-1] - START_S)
    if kind == "baro" and not abs(float(np.median(apart[last])) if last.any() else np.inf) < BACK_M:
        return nothing
    flags = np.zeros(len(t_s), bool)
    for a, b in long:
        flags[a:b] = True
    ratio = float(np.median(range_m[flags] * upright[flags] / expected[flags]))
    seconds = sum(float(t_s[b - 1] - t_s[a]) for a, b in long)
    note = f"the range stopped being true at {t_s[long[0][0]]:.1f} s: it reads {ratio:.2f} of the height of {name}"
    used = flags if kind == "truth" else np.zeros(len(t_s), bool)
    return Untrue(used, (f"{note} for {seconds:.0f} s, or the ground is another there",))


def _height(log: Log) -> Witness | None:
    """The best witness: its kind, its name, its instants and heights."""
    if log.truth is not None and "pos_d_m" in log.truth:
        return "truth", log.truth_name, np.asarray(log.truth["t_s"], float), -np.asarray(log.truth["pos_d_m"], float)
    baro = log.streams.get(Sensor.BARO)
    if baro is None or len(baro) < LEAST_ROWS:
        return None
    return "baro", "the barometer", baro.t_s - baro.delay_s, baro.value[:, 0]


def _keeps(witness: Witness | None, start_s: float, end_s: float) -> bool:
    """Whether the witness is a truth that stays at one height from start to end; a barometer is too noisy for that."""
    if witness is None or witness[0] != "truth":
        return False
    inside = (witness[2] >= start_s) & (witness[2] <= end_s)
    return bool(inside.any()) and _span(witness[3], inside) < KEPT_M


def _span(values: Array, flags: Flags) -> float:
    """From the least to the greatest of the values flagged; 0 of none."""
    return float(np.ptp(values[flags])) if flags.any() else 0.0
