"""The recording of a session: every reading the navigator was fed, as it was fed, and its outputs.

While the session runs all of it goes to a journal beside the record (`logs/journal.py`), written by a thread of its
own; `finish` makes the Record of the journal, and then removes that. A session that was killed leaves the journal, of
which `flownav recover` makes the same Record. A journal that cannot be written ends the recording, not the session.
"""

import json
import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flownav.core.errors import InputError
from flownav.core.free_names import free_name
from flownav.core.measurement import Array, EventQueue
from flownav.core.provenance import command_line, provenance
from flownav.live.filtering import NAN, Keeper
from flownav.live.options import Options
from flownav.live.recovery import WIDTHS, recovered
from flownav.live.writing import Writer, claim
from flownav.logs.mavlink.messages import TrueState
from flownav.navigation.kernel_settings import Equipment
from flownav.navigation.tables import fed_rows

MOST_NOTES = 100_000  # chosen, so that memory has a bound
FACTS_S = 1.0  # chosen: a killed session loses its last second


class Finished(NamedTuple):
    """The result of a recording: the record and the journal that remain, None where they do not.

    reason: why the record is not whole, or not there; "" where all is well.
    """

    record: Path | None
    journal: Path | None
    reason: str

    def facts(self) -> dict[str, Any]:
        """The recording's fields of the `--json` output."""
        return {
            "record": str(self.record) if self.record else None,
            "journal": str(self.journal) if self.journal else None,
            "recording_stopped": self.reason or None,
        }

    def verdict(self) -> str:
        """The sentence that tells the user why the record is not whole."""
        if self.record is not None:
            return f"{self.record}: recorded in part only ({self.reason}); it holds what came before"
        return (
            f"{self.journal}: no record could be made of it ({self.reason}); "
            f"`flownav recover {self.journal} --out FILE` makes one where there is room"
        )


class Recorder(Keeper):
    """A Keeper that keeps all. InputError where its journal cannot be begun; nothing is raised after that."""

    def __init__(
        self, path: Path, options: Options, *, force: bool = False, failed: Callable[[str], None] = lambda reason: None
    ) -> None:
        place = claim(path, force=force)
        self.path, self.journal, self.notice = place.record, place.journal, place.notice
        self._force, self._file = force, place.file
        self._segments, self._notes, self._notes_lost = 0, 0, 0
        self._fed: Array | None = None
        try:
            self._writer = Writer(self._file, _head(options), failed)
        except OSError as error:
            os.close(self._file)
            with suppress(OSError):
                self.journal.unlink()
            raise InputError(f"{path}: cannot be written ({error.strerror}); give another name") from error

    @property
    def reason(self) -> str:
        """Why nothing is recorded any more; "" while all is."""
        return self._writer.reason

    @property
    def size(self) -> int:
        """Bytes that the journal has."""
        return self._writer.written

    def segment(self, equipment: Equipment) -> None:
        """A navigator begins; what is fed from now on is fed to it."""
        self._writer.say("segments", [self._segments, equipment._asdict()])
        self._segments += 1

    def fed(self, queue: EventQueue, arrival_s: Array) -> None:
        """Keep a batch, to be written together with its results."""
        self._fed = fed_rows(queue, arrival_s, self._segments - 1)

    def written(self, estimate: Array, innovation: Array, event: Array) -> None:
        """Write the batch with its estimates, innovations and events."""
        rows = {"fed": self._fed, "estimate": estimate, "innovation": innovation, "event": event}
        self._writer.take({name: values for name, values in rows.items() if values is not None and len(values)})
        self._fed = None

    def note(self, t_s: float, source: str, kind: str, detail: str, value: float = NAN) -> None:
        """A happening; the first MOST_NOTES are kept."""
        if self._notes < MOST_NOTES:
            self._notes += 1
            self._writer.say("notes", [t_s, source, kind, detail, value])
        else:
            self._notes_lost += 1

    def origin(self, t_s: float, origin_deg_m: tuple[float, float, float]) -> None:
        """The local frame's origin from an instant on."""
        self._writer.say("origins", [t_s, *origin_deg_m])

    def truth(self, t_s: float, state: TrueState) -> None:
        """Position stays geodetic until the record is made."""
        row = (t_s, *state.position_deg_m, *state.vel_ned_m_s, *state.quaternion, *state.rate_frd_rad_s)
        self._writer.take({"truth": np.array([row])})

    def facts(self, facts: dict[str, Any]) -> None:
        """The session's own figures so far."""
        self._writer.say("facts", json.loads(json.dumps(facts, default=str)))  # they change while the thread writes

    def finish(self, facts: dict[str, Any], *, received: bool = True) -> Finished:
        """Make the record, whole, and then remove the journal. `facts`: the session's own figures.

        received: a vehicle was received; without one there is nothing to keep, and no record is made.
        """
        if self._fed is not None:
            self._writer.take({"fed": self._fed})
        self._writer.say("end", {"facts": facts, "notes_lost": self._notes_lost})
        self._writer.close()
        reason = self.reason
        if self._writer.is_stuck:
            return Finished(None, self.journal, reason)
        try:
            if not received:
                self._remove_journal()
                return Finished(None, None, "")
            path = self.path if self._force else free_name(self.path)
            record = recovered(self.journal).record
            record.manifest["live"] = {**facts, **({"recording_stopped": reason} if reason else {})}
            record.save(path, replacing=self._force)
            forced_to_disk(path)
            self._remove_journal()
            return Finished(path, None, reason)
        except (OSError, ValueError, MemoryError, InputError) as error:
            why = (error.strerror if isinstance(error, OSError) else "") or str(error)
            return Finished(None, self.journal, reason or why)
        finally:
            self._let_go()

    def leave(self) -> None:
        """Write what waits and leave the journal as it is, for `flownav recover`."""
        self._writer.close()
        self._let_go()

    def _let_go(self) -> None:
        """Whoever comes may have the journal now."""
        if self._file >= 0 and not self._writer.is_stuck:
            os.close(self._file)
            self._file = -1

    def _remove_journal(self) -> None:
        """Still locked: nobody takes it for the journal of a killed run in between."""
        self.journal.unlink(missing_ok=True)


def facts_every_second(recorder: Recorder, facts: Callable[[], dict[str, Any]]) -> Callable[[float], None]:
    """A function called by the loop with our clock: writes the facts once a second, in case the session is killed."""
    at_s = [float("-inf")]

    def keep_facts(now_s: float) -> None:
        if now_s - at_s[0] >= FACTS_S:
            at_s[0] = now_s
            recorder.facts(facts())

    return keep_facts


def forced_to_disk(path: Path) -> None:
    """A file and its name in the folder are on the disk when this returns. OSError where they are not."""
    for place in (path, path.parent):
        file = os.open(place, os.O_RDONLY)
        try:
            os.fsync(file)
        finally:
            os.close(file)


def _head(options: Options) -> dict[str, Any]:
    """The first block of the journal: all that is known before the first message."""
    return {
        "journal": 1,
        "columns": WIDTHS,
        "parameters": {
            "filter": options.settings.model_dump(),
            "gps_delay_s": options.gps_delay_s,
            "horizon_s": options.least_horizon_s,
            "flow_sensor": options.identified._asdict() if options.identified else None,
            **({"flow_noise": options.flow_noise._asdict()} if options.flow_noise.stated else {}),
        },
        "provenance": provenance(),
        "command": command_line(),
        "process": os.getpid(),
    }
