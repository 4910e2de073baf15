"""A blackbox log's frames as columns of numbers, in a compiled loop: main frames (I, P), GPS (G), home (H).

A frame counts only where another begins, or the log ends, behind it; else reading goes on a byte after its start, and
main frames wait for the next whole one (I). betaflight/blackbox-log-viewer, src/flightlog_parser.js does the same.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import kernel
from flownav.logs.blackbox.format import AT_MOST, Bytes, Header, Numbers, packed, signed_vb, unsigned_vb

FRAME_I, FRAME_P, FRAME_S, FRAME_G, FRAME_H, FRAME_E = 73, 80, 83, 71, 72, 69
LONGEST_FRAME = 1024
LEAST_FRAME = 8  # bytes of a main or a GPS frame, on average, at the least
SYNC_BEEP, ADJUSTMENT, RESUME, DISARM, FLIGHT_MODE, LOG_END = 0, 13, 14, 15, 30, 255
ENDED = -2  # the log ends here
MIN_THROTTLE, BATTERY, MIN_MOTOR = 0, 1, 2  # places in `levels`


class Coding(NamedTuple):
    """How the fields of one kind of frame are predicted and written."""

    predictors: Numbers
    encodings: Numbers


class Kinds(NamedTuple):
    """Kinds of frames: main ones, whole and by difference, slow ones, GPS and home."""

    i: Coding
    p: Coding
    s: Coding
    g: Coding
    h: Coding


class Places(NamedTuple):
    """Fields among those of their frame; -1: there is none."""

    time: int
    motor: int
    gps_time: int


class Earlier(NamedTuple):
    """The frame before one, and the one before that."""

    last: Numbers
    before: Numbers


class Base(NamedTuple):
    """The other bases of values: the header's levels, home, the main frames' clock. part: scratch."""

    levels: Numbers
    home: Numbers
    clock: int
    part: Numbers


class Memory(NamedTuple):
    """The main frames at hand, last and before that; the last slow frame, fix and home."""

    last: Numbers
    before: Numbers
    now: Numbers
    slow: Numbers
    fix: Numbers
    place: Numbers


class Kept(NamedTuple):
    """The rows that are kept: main (most, fields taken) int32, clocks (most,) of the main frames' times, unwrapped, and
    gps (most, fields + 1) with the time last.
    """

    main: NDArray[np.int32]
    clocks: Numbers
    gps: Numbers


@dataclass(frozen=True)
class Frames:
    """Columns by name (n,), and how many bytes belong to no whole frame. GPS frames have `time` too."""

    main: dict[str, NDArray[np.int64]]
    gps: dict[str, NDArray[np.int64]]
    damaged_bytes: int


def read_frames(content: Bytes, header: Header, wanted: frozenset[str]) -> Frames:
    """The wanted fields of every sound frame of one log. content: the file's bytes."""
    kinds = [header.frames[letter] for letter in "IPSGH"]
    taken = np.array([k for k, name in enumerate(kinds[0].names) if name in wanted], np.int64)
    most = (header.end_byte - header.first_byte) // LEAST_FRAME + 64
    main = np.empty((most, len(taken)), np.int32)
    clock = np.empty(most, np.int64)
    gps = np.empty((most if len(kinds[3].names) else 0, len(kinds[3].names) + 1), np.int64)
    motor = header.settings.get("motorOutput", "").split(",")[0].strip()
    levels = np.array([
        int(header.number("minthrottle", 1000.0)), int(header.number("vbatref", 0.0)),
        int(motor) if motor.isdigit() and len(motor) < 6 else 0,
    ], np.int64)  # fmt: skip
    i, _, _, g, _ = kinds
    codings = Kinds(*(Coding(kind.predictors, kind.encodings) for kind in kinds))
    places = Places(i.place("time"), i.place("motor[0]"), g.place("time"))
    rows, fixes, damaged = decode(
        content, header.first_byte, header.end_byte, codings, places, levels, taken, Kept(main, clock, gps)
    )
    columns = {kinds[0].names[k]: main[:rows, place].astype(np.int64) for place, k in enumerate(taken.tolist())}
    columns["time"] = clock[:rows].copy()
    fixed = {name: gps[:fixes, k].copy() for k, name in enumerate(kinds[3].names)}
    return Frames(columns, fixed | {"time": gps[:fixes, -1].copy()}, int(damaged))


@kernel
def frame_values(
    content: Bytes, pos: int, end: int, coding: Coding, earlier: Earlier, base: Base, motor: int, out: Numbers
) -> int:
    """The values of one frame into `out`; the place after it, -1 where its bytes end before."""
    predictors, encodings = coding
    last, before = earlier
    levels, home, clock, part = base
    k, fields = 0, len(predictors)
    end = min(end, pos + LONGEST_FRAME)
    while k < fields:
        group = 1
        while k + group < fields and encodings[k + group] == encodings[k]:
            group += 1
        count, pos = packed(content, pos, end, encodings[k], group, part)
        if pos < 0:
            return -1
        for j in range(min(count, fields - k)):
            predictor = predictors[k]
            value = part[j]
            if predictor == 1:
                value += last[k]
            elif predictor == 2:
                value += 2 * last[k] - before[k]
            elif predictor == 3:
                both = last[k] + before[k]
                value += both // 2 if both >= 0 else -((-both) // 2)
            elif predictor == 4:
                value += levels[MIN_THROTTLE]
            elif predictor == 5 and motor >= 0:
                value += out[motor]
            elif predictor == 6:
                value += last[k] + 1
            elif predictor == 7:
                value += home[0]
            elif predictor == 12:
                value += home[1]
            elif predictor == 8:
                value += 1500
            elif predictor == 9:
                value += levels[BATTERY]
            elif predictor == 10:
                value += clock
            elif predictor == 11:
                value += levels[MIN_MOTOR]
            out[k] = ((value + 0x80000000) & 0xFFFFFFFF) - 0x80000000  # 32 bits, as the firmware's
            k += 1
    return pos


@kernel
def event_end(content: Bytes, pos: int, end: int) -> int:
    """The place after an event; -1 of one that is cut off or unknown, -2 where the log ends."""
    if pos >= end:
        return -1
    kind = int(content[pos])
    pos += 1
    numbers = 0
    if kind in (SYNC_BEEP, DISARM):
        numbers = 1
    elif kind in (RESUME, FLIGHT_MODE):
        numbers = 2
    elif kind == ADJUSTMENT:
        if pos >= end:
            return -1
        if content[pos] >= 128:
            return pos + 5 if pos + 5 <= end else -1
        _, pos = signed_vb(content, pos + 1, end)
        return pos
    elif kind == LOG_END:
        return ENDED
    else:
        return -1
    for _ in range(numbers):
        if pos >= 0:
            _, pos = unsigned_vb(content, pos, end)
    return pos


@kernel
def frame_end(content: Bytes, pos: int, end: int, kinds: Kinds, m: Memory, base: Base, motor: int) -> int:
    """Where the frame at `pos` ends, with its values in the memory; -1 where it is none, ENDED where the log ends."""
    kind, pos = int(content[pos]), pos + 1
    if kind == FRAME_I:
        return frame_values(content, pos, end, kinds.i, Earlier(m.last, m.before), base, motor, m.now)
    if kind == FRAME_P:
        return frame_values(content, pos, end, kinds.p, Earlier(m.last, m.before), base, motor, m.now)
    if kind == FRAME_S and len(kinds.s.predictors):
        return frame_values(content, pos, end, kinds.s, Earlier(m.slow, m.slow), base, -1, m.slow)
    if kind == FRAME_G and len(kinds.g.predictors):
        return frame_values(content, pos, end, kinds.g, Earlier(m.fix, m.fix), base, -1, m.fix)
    if kind == FRAME_H and len(kinds.h.predictors):
        return frame_values(content, pos, end, kinds.h, Earlier(m.place, m.place), base, -1, m.place)
    return event_end(content, pos, end) if kind == FRAME_E else -1


@kernel
def blank_memory(kinds: Kinds) -> Memory:
    """A memory of zeros."""
    fields = len(kinds.i.predictors)
    return Memory(
        np.zeros(fields, np.int64),
        np.zeros(fields, np.int64),
        np.zeros(fields, np.int64),
        np.zeros(max(len(kinds.s.predictors), 1), np.int64),
        np.zeros(max(len(kinds.g.predictors), 1), np.int64),
        np.zeros(max(len(kinds.h.predictors), 2), np.int64),
    )


@kernel
def put_behind(m: Memory, whole: bool) -> None:
    """The main frame at hand becomes the last one, and that the one before; whole: it stands for both."""
    for k in range(len(m.now)):
        m.before[k] = m.now[k] if whole else m.last[k]
        m.last[k] = m.now[k]


@kernel
def decode(
    content: Bytes, start: int, end: int, kinds: Kinds, places: Places, levels: Numbers, taken: Numbers, kept: Kept
) -> tuple[int, int, int]:
    """All frames from `start` to `end`: how many main rows, GPS rows, and bytes of no frame; taken: fields to keep."""
    m, fixed = blank_memory(kinds), len(kinds.g.predictors)
    home, part = np.zeros(2, np.int64), np.zeros(AT_MOST, np.int64)
    rows, fixes, damaged = 0, 0, 0
    sound, homed = False, True
    for k in range(fixed):  # positions relative to a home that is not known yet are none
        homed = homed and kinds.g.predictors[k] != 7 and kinds.g.predictors[k] != 12
    clock, high = 0, 0  # the last main frame's time as it is written, and what its 32 bits have lost
    pos = start
    while pos < end and rows < len(kept.main):
        kind = int(content[pos])
        after = frame_end(content, pos, end, kinds, m, Base(levels, home, clock, part), places.motor)
        if after == ENDED:
            break
        whole = after >= 0
        if whole and after < end:
            mark = int(content[after])
            whole = mark in (FRAME_I, FRAME_P, FRAME_S, FRAME_G, FRAME_H, FRAME_E)
        if not whole:
            sound = sound and kind not in (FRAME_I, FRAME_P)
            damaged += 1
            pos += 1
            continue
        pos = after
        if kind in (FRAME_I, FRAME_P):
            sound = sound or kind == FRAME_I
            put_behind(m, kind == FRAME_I)
            if places.time >= 0 and sound:
                low_bits = m.now[places.time] & 0xFFFFFFFF
                if low_bits < (clock & 0xFFFFFFFF) - 0x80000000:
                    high += 1 << 32
                clock = low_bits
                for k in range(len(taken)):
                    kept.main[rows, k] = m.now[taken[k]]
                kept.clocks[rows] = clock + high
                rows += 1
        elif kind == FRAME_H:
            home[0], home[1] = m.place[0], m.place[1]
            homed = True
        elif kind == FRAME_G and fixes < len(kept.gps) and sound and homed:
            for k in range(fixed):
                kept.gps[fixes, k] = m.fix[k]
            kept.gps[fixes, fixed] = ((m.fix[places.gps_time] & 0xFFFFFFFF) if places.gps_time >= 0 else clock) + high
            fixes += 1
    return rows, fixes, damaged
