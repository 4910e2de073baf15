"""How far the autopilot's own estimate went astray meanwhile: in the frame, and against the reference, of its scores.

`flownav info` and `flownav replay` score the whole estimate in the same way; over a whole log the figures are the same.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Array
from flownav.core.record import POSITION_NED, Table
from flownav.replays.prepare import GPS, ReplayOptions
from flownav.replays.session import Replay
from flownav.scoring.path import AGAINST, Offsets, autopilot_offsets
from flownav.studies.explain.case import Case
from flownav.studies.explain.sign import Window

LEAST_ROWS = 5
REPLAYED = "replay"
NAMES = AGAINST | {REPLAYED: "the replay with the repair, turned and shifted onto it"}
FLOOR_M = {"truth": 1.0, "gps": 3.0, REPLAYED: 1.0}  # what sound estimates are off by
STANDARD_ERRORS = 2.0


class Astray(NamedTuple):
    """The level distance of the autopilot's own estimate from a reference [m], rms and at most; that one's key."""

    rms_m: float
    most_m: float
    against: str

    @property
    def is_large(self) -> bool:
        """Whether it is more than a sound estimate has."""
        return self.rms_m > FLOOR_M[self.against]

    @property
    def words(self) -> str:
        """In words, with the reference."""
        off = f"{self.rms_m:.1f} m rms ({self.most_m:.1f} m at most)"
        return f"the autopilot's own estimate was {off} off {NAMES[self.against]}"


def astray(case: Case, run: Replay | None, window_s: Window, *, gps_is_blamed: bool) -> Astray | None:
    """The autopilot's own estimate in flight within a window; None where nothing shows how far off it was.

    Against the log's reference, else GPS where that is not what is wrong, else the replay with the repair, where that
    knows its own position well enough.
    """
    table = case.log.autopilot
    if table is None or case.own is None:
        return None
    delay_s = ReplayOptions().gps_delay_s  # the one that scores take
    gps = {
        sensor: replace(case.log.streams[sensor], delay_s=delay_s)
        for sensor in GPS
        if sensor in case.log.streams and not gps_is_blamed
    }
    found = _within(case, autopilot_offsets(table, case.log.truth, gps), window_s)
    if found is not None:
        return found
    return None if run is None else _from_replay(case, run, window_s)


def _within(case: Case, offsets: Offsets | None, window_s: Window) -> Astray | None:
    """The offset in flight within a window."""
    if offsets is None:
        return None
    level = np.hypot(offsets.error[:, 0], offsets.error[:, 1])[_inside(case, offsets.t_s, window_s)]
    level = level[np.isfinite(level)]
    if len(level) < LEAST_ROWS:
        return None
    return Astray(float(np.sqrt(np.mean(level**2))), float(level.max()), offsets.against)


def _inside(case: Case, t_s: Array, window_s: Window) -> NDArray[np.bool_]:
    begin, end = max(window_s[0], case.flight_s[0]), min(window_s[1], case.flight_s[1])
    return np.asarray((t_s >= begin) & (t_s <= end))


def _from_replay(case: Case, run: Replay, window_s: Window) -> Astray | None:
    """Against the replay's path, which is laid on the autopilot's; None where the replay itself knows no better."""
    rows, table = run.estimate_rows, case.log.autopilot
    known = np.isfinite(rows.pos_ned_m).all(axis=1)
    if table is None or np.count_nonzero(known) < LEAST_ROWS:
        return None
    path: Table = {"t_s": rows.t_s[known], **dict(zip(POSITION_NED, rows.pos_ned_m[known].T, strict=True))}
    offsets = autopilot_offsets(table, path, {})
    if offsets is None:
        return None
    found = _within(case, offsets._replace(against=REPLAYED), window_s)
    inside = _inside(case, rows.t_s, window_s) & known
    unsure_m = np.hypot(rows.std_pos_ned_m[inside, 0], rows.std_pos_ned_m[inside, 1])
    if found is None or not len(unsure_m) or found.rms_m < STANDARD_ERRORS * float(unsure_m.max()):
        return None
    return found
