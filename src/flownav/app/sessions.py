"""Live sessions in the folder, as the files of their state have them: those that the page began, and any other."""

import json
import stat
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from flownav.app.jobs import LIVE, Job
from flownav.app.tasks import STATUS

MOST_BYTES = 1 << 20  # of a state
VERSION = 1  # of a state that the page can show (live/status.py)


def sessions_in(folder: Path, jobs: Mapping[int, Job]) -> list[dict[str, Any]]:
    """Each session whose state lies in the folder, the newest first.

    name: of the file; age_s: since it was written; job: the number of the job that runs it, None for one that was begun
    in a terminal; state: as `flownav live --status` wrote it.
    """
    found = []
    for path in folder.glob(f"*{STATUS}"):
        read = _state_of(path)
        if read is not None:
            state, written_s = read
            running = (job.number for job in jobs.values() if job.kind == LIVE and job.ended_s is None)
            number = next((each for each in running if path.name in jobs[each].task.words), None)
            age_s = round(max(0.0, time.time() - written_s), 1)
            found.append({"name": path.name, "age_s": age_s, "job": number, "state": state})
    return sorted(found, key=lambda each: (each["job"] is None, each["age_s"], each["name"]))


def _state_of(path: Path) -> tuple[dict[str, Any], float] | None:
    """The state in a file, and when it was written; None where it holds none, or is just removed."""
    try:
        info = path.lstat()
        if not stat.S_ISREG(info.st_mode) or info.st_size > MOST_BYTES:
            return None
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return None
    known = isinstance(found, dict) and found.get("live_status") == VERSION
    return (found, info.st_mtime) if known else None
