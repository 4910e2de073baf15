"""A blackbox log's frames as columns of numbers, in a compiled loop: main frames (I, P), GPS (G), home (H).

A frame counts only where another begins, or the log ends, behind it; else reading goes on a byte after its start, and
main frames wait for the next whole one (I). betaflight/blackbox-log-viewer, src/flightlog_parser.js does the same.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flownav.compile import kernel
from flownav.logs.blackbox.header import Header
from flownav.logs.blackbox.values import AT_MOST, Bytes, Numbers, packed, signed_vb, unsigned_vb

FRAME_I, FRAME_P, FRAME_S, FRAME_G, FRAME_H, FRAME_E = 73, 80, 83, 71, 72, 69
LONGEST_FRAME = 1024
LEAST_FRAME = 8  # bytes of a main or a GPS frame, on average, at the least
SYNC_BEEP, ADJUSTMENT, RESUME, DISARM, FLIGHT_MODE, LOG_END = 0, 13, 14, 15, 30, 255
MIN_THROTTLE, BATTERY, MIN_MOTOR = 0, 1, 2  # places in `levels`


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
    i, p, s, g, h = kinds
    rows, fixes, damaged = decode(
        content, header.first_byte, header.end_byte, i.predictors, i.encodings, p.predictors, p.encodings, s.predictors,
        s.encodings, g.predictors, g.encodings, h.predictors, h.encodings, i.place("time"), i.place("motor[0]"),
        g.place("time"), levels, taken, main, clock, gps,
    )  # fmt: skip
    columns = {kinds[0].names[k]: main[:rows, place].astype(np.int64) for place, k in enumerate(taken.tolist())}
    columns["time"] = clock[:rows].copy()
    fixed = {name: gps[:fixes, k].copy() for k, name in enumerate(kinds[3].names)}
    return Frames(columns, fixed | {"time": gps[:fixes, -1].copy()}, int(damaged))


@kernel
def frame_values(
    content: Bytes, pos: int, end: int, predictors: Numbers, encodings: Numbers, last: Numbers, before: Numbers,
    levels: Numbers, home: Numbers, clock: int, motor: int, out: Numbers, part: Numbers,
) -> int:  # fmt: skip
    """The values of one frame into `out`; the place after it, -1 where its bytes end before.

    last, before: the frame before this one and the one before that. part (AT_MOST,): scratch.
    """
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
        return -2
    else:
        return -1
    for _ in range(numbers):
        if pos >= 0:
            _, pos = unsigned_vb(content, pos, end)
    return pos


@kernel
def decode(
    content: Bytes, start: int, end: int, i_predictors: Numbers, i_encodings: Numbers, p_predictors: Numbers,
    p_encodings: Numbers, s_predictors: Numbers, s_encodings: Numbers, g_predictors: Numbers, g_encodings: Numbers,
    h_predictors: Numbers, h_encodings: Numbers, time: int, motor: int, gps_time: int, levels: Numbers,
    taken: Numbers, main: NDArray[np.int32], clocks: Numbers, gps: Numbers,
) -> tuple[int, int, int]:  # fmt: skip
    """All frames from `start` to `end`: how many main rows, GPS rows, and bytes of no frame.

    main (most, len(taken)) int32, clocks (most,) of the main frames' times, unwrapped; gps (most, fields + 1) with
    the time last.
    """
    fields = len(i_predictors)
    last, before, now = np.zeros(fields, np.int64), np.zeros(fields, np.int64), np.zeros(fields, np.int64)
    slow = np.zeros(max(len(s_predictors), 1), np.int64)
    fix = np.zeros(max(len(g_predictors), 1), np.int64)
    place = np.zeros(max(len(h_predictors), 2), np.int64)
    home = np.zeros(2, np.int64)
    part = np.zeros(AT_MOST, np.int64)
    rows, fixes, damaged = 0, 0, 0
    sound, homed = False, True
    for k in range(len(g_predictors)):  # positions counted from a home that is not told yet are none
        homed = homed and g_predictors[k] != 7 and g_predictors[k] != 12
    clock, high = 0, 0  # the last main frame's time as it is written, and what its 32 bits have lost
    pos = start
    while pos < end and rows < len(main):
        kind = int(content[pos])
        after = -1
        if kind == FRAME_I:
            after = frame_values(content, pos + 1, end, i_predictors, i_encodings, last, before, levels, home, clock,
                                 motor, now, part)  # fmt: skip
        elif kind == FRAME_P:
            after = frame_values(content, pos + 1, end, p_predictors, p_encodings, last, before, levels, home, clock,
                                 motor, now, part)  # fmt: skip
        elif kind == FRAME_S and len(s_predictors):
            after = frame_values(content, pos + 1, end, s_predictors, s_encodings, slow, slow, levels, home, clock, -1,
                                 slow, part)  # fmt: skip
        elif kind == FRAME_G and len(g_predictors):
            after = frame_values(content, pos + 1, end, g_predictors, g_encodings, fix, fix, levels, home, clock, -1,
                                 fix, part)  # fmt: skip
        elif kind == FRAME_H and len(h_predictors):
            after = frame_values(content, pos + 1, end, h_predictors, h_encodings, place, place, levels, home, clock,
                                 -1, place, part)  # fmt: skip
        elif kind == FRAME_E:
            after = event_end(content, pos + 1, end)
            if after == -2:
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
            if kind == FRAME_I:
                sound = True
                for k in range(fields):
                    before[k] = now[k]
                    last[k] = now[k]
            else:
                for k in range(fields):
                    before[k] = last[k]
                    last[k] = now[k]
            if time >= 0 and sound:
                told = now[time] & 0xFFFFFFFF
                if told < (clock & 0xFFFFFFFF) - 0x80000000:
                    high += 1 << 32
                clock = told
                for k in range(len(taken)):
                    main[rows, k] = now[taken[k]]
                clocks[rows] = clock + high
                rows += 1
        elif kind == FRAME_H:
            home[0], home[1] = place[0], place[1]
            homed = True
        elif kind == FRAME_G and fixes < len(gps) and sound and homed:
            for k in range(len(g_predictors)):
                gps[fixes, k] = fix[k]
            gps[fixes, len(g_predictors)] = ((fix[gps_time] & 0xFFFFFFFF) if gps_time >= 0 else clock) + high
            fixes += 1
    return rows, fixes, damaged
