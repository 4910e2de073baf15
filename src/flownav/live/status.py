"""The state of a session as a JSON file, for a page or a program that looks at it: `flownav live --status FILE`.

The file is replaced twice a second, by a thread of its own so that a slow disk holds nothing up, and removed at the
session's end. A file that stays and is not written any more is that of a session that was killed.
"""

import math
import os
import queue
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from flownav.core.errors import InputError
from flownav.core.files import written_whole
from flownav.core.guard import an_output
from flownav.core.marks import marked_json
from flownav.estimation.states import PAD, STATE
from flownav.live.anchor import PLACES
from flownav.live.answers import WITHHELD
from flownav.live.screen import Screen, protection_of
from flownav.live.session import Session
from flownav.logs.mavlink.outgoing import Estimate
from flownav.navigation.memory import PAD_KNOWN

VERSION = 1
WRITE_S = 0.5  # chosen, for readers
ALIVE_S = 5.0  # a file that was written since then is another session's: chosen
MOST_POINTS = 600  # of the path: chosen; with more every second one is left out
LISTENS = "nothing_asked"  # the reason of a session that is to send nothing
LAST_WAIT_S = 1.0  # for the disk, at the end: chosen

Point = tuple[float, float, int]


class Trail:
    """The path so far: north, east [m] and whether it was sent (1) or withheld (0), evenly in time, MOST_POINTS at
    most however long it is.
    """

    def __init__(self) -> None:
        self.points: list[Point] = []
        self._every, self._seen = 1, 0

    def take(self, north_m: float, east_m: float, *, sent: bool) -> None:
        """The next point of the path."""
        if self._seen % self._every == 0:
            self.points.append((round(north_m, 3), round(east_m, 3), int(sent)))
        self._seen += 1
        if len(self.points) > MOST_POINTS:
            self.points = self.points[::2]
            self._every *= 2


class Status:
    """The doings of a session as JSON values. screen: looks at the same session, and at nothing else."""

    def __init__(self, session: Session, screen: Screen, url: str, record: Path | None, now_s: float) -> None:
        self._session, self._screen, self._url = session, screen, url
        self._record, self._begun_s = record, now_s
        self._trail = Trail()
        self._reason, self._since_s = session.reason, now_s
        self._velocities = session.velocities

    def look(self, now_s: float) -> dict[str, Any]:
        """The session at an instant of our clock; what is not known is None.

        reason, why, for_s: why nothing is sent, in a word and in words ("" while it is sent), and since when [s].
        listens: nothing is to be sent. quality_percent, three_sigma_m, three_sigma_m_s: of the estimate that is sent.
        protection_m: horizontal and vertical. here_ned_m, path: where the navigator is and was, in the frame that is
        sent, withheld or not. sensors, lines, alarms: as on the screen.
        """
        session = self._session
        if session.reason != self._reason:
            self._reason, self._since_s = session.reason, now_s
        velocities, self._velocities = session.velocities - self._velocities, session.velocities
        view, here = self._screen.view(now_s), self._here()
        able = session.reason in ("", LISTENS)
        if here is not None:
            self._trail.take(here[0], here[1], sent=able)
        vehicle, protection = session.reception.vehicle, protection_of(session)
        return {
            "live_status": VERSION,
            "url": self._url,
            "record": self._record.name if self._record else None,
            "process": os.getpid(),
            "lasted_s": round(now_s - self._begun_s, 1),
            "vehicle": {"system": vehicle.system, "component": vehicle.component} if vehicle else None,
            "send": session.options.send,
            "listens": session.reason == LISTENS,
            "reason": "" if able else session.reason,
            "why": "" if able else WITHHELD[session.reason],
            "for_s": round(now_s - self._since_s, 1),
            "velocity_only": session.reason in PLACES and velocities > 0,
            "sent": session.sent,
            "withheld": {WITHHELD[reason]: count for reason, count in sorted(session.withheld.items())},
            "protection_m": [round(level_m, 3) for level_m in protection[:2]] if protection else None,
            "suspected": protection[2] if protection else "",
            "limits": {"protection_m": session.options.limits.protection_m},
            "here_ned_m": [round(value, 3) for value in here] if here else None,
            "pad_m": self._pad(),
            **_figures(session.estimate if able else None),
            "path": list(self._trail.points),
            "sensors": view.sensors,
            "alarms": view.alarms,
            "lines": view.lines,
        }

    def _here(self) -> tuple[float, float, float] | None:
        """Where the navigator is, in the frame that is sent [m]."""
        here = self._session.filtering.here_ned_m
        if here is None or not all(map(math.isfinite, here)):
            return None
        north, east, down = (a + b for a, b in zip(here, self._session.offering.offset_ned_m, strict=True))
        return north, east, down

    def _pad(self) -> list[float] | None:
        """The pad, where its place is known: north and east in the frame that is sent [m]."""
        on = self._session.filtering.running
        if on is None or not on.work[PAD_KNOWN] > 0.0:
            return None
        offset = self._session.offering.offset_ned_m
        found = [float(on.work[STATE + PAD + i]) + offset[i] for i in range(2)]
        return [round(value, 3) for value in found] if all(map(math.isfinite, found)) else None


def _figures(estimate: Estimate | None) -> dict[str, Any]:
    """Quality, three standard deviations and velocity of the estimate that is sent; None of each where none is."""
    names = ("quality_percent", "three_sigma_m", "vel_ned_m_s", "three_sigma_m_s")
    if estimate is None or estimate.pose_covariance is None or estimate.velocity_covariance is None:
        return dict.fromkeys(names)
    spread_m, spread_m_s = (
        [round(3.0 * math.sqrt(max(float(covariance[i, i]), 0.0)), 3) for i in range(3)]
        for covariance in (estimate.pose_covariance, estimate.velocity_covariance)
    )
    vel_ned_m_s = [round(float(value), 3) for value in estimate.vel_ned_m_s]
    return dict(zip(names, (estimate.quality, spread_m, vel_ned_m_s, spread_m_s), strict=True))


def status_place(path: Path) -> Path:
    """The path of a status file. InputError where another session writes it, or it holds what is not flownav's."""
    with suppress(OSError):
        if time.time() - path.stat().st_mtime < ALIVE_S:
            raise InputError(f"{path}: another session writes its status there; give another name")
    return an_output(path)


class StatusFile:
    """Writes the status while the session runs; nobody waits for it.

    look: the status at an instant of our clock. failed: called once, in the writing thread, with why it cannot be
    written; it is tried again, and the session goes on.
    """

    def __init__(
        self, path: Path, look: Callable[[float], dict[str, Any]], failed: Callable[[str], None] = lambda reason: None
    ) -> None:
        self._path, self._look, self._failed = path, look, failed
        self._at_s, self._idle = float("-inf"), True
        self._waiting: queue.SimpleQueue[dict[str, Any] | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="status", daemon=True)
        self._thread.start()

    def show(self, now_s: float) -> None:
        """The status of now is to be written, where that is due and the last one is. Never waits."""
        if self._idle and now_s - self._at_s >= WRITE_S:
            self._at_s, self._idle = now_s, False
            self._waiting.put(self._look(now_s))

    def close(self) -> None:
        """Write no more, and remove the file."""
        self._waiting.put(None)
        self._thread.join(LAST_WAIT_S)
        with suppress(OSError):
            self._path.unlink(missing_ok=True)

    def _run(self) -> None:
        failed_once = False
        while (found := self._waiting.get()) is not None:
            try:
                with written_whole(self._path) as temporary:
                    temporary.write_bytes(marked_json(found, indent=None))
            except (OSError, ValueError) as error:
                if not failed_once:
                    failed_once = True
                    self._failed(getattr(error, "strerror", None) or str(error))
            self._idle = True
