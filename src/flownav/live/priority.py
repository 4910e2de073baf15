"""Before whom the session's process runs, where the system permits it, and how long a thread may hold Python."""

from __future__ import annotations

import os
import sys
from contextlib import suppress

PRIORITY = 1  # the least of the real-time ones: before every ordinary process, behind the system's own
NICE = -10
SWITCH_S = 0.0005  # Python's own default is ten times this


def run_before_others() -> str:
    """Ask for real-time scheduling, else for a higher priority; what was given, in words.

    Threads made later inherit it: the journal's must not be held up while it holds Python's lock.
    """
    sys.setswitchinterval(SWITCH_S)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
        return f"real time (SCHED_FIFO {PRIORITY})"
    except OSError:
        pass
    try:
        os.setpriority(os.PRIO_PROCESS, 0, NICE)
        return f"priority (nice {NICE})"
    except OSError:
        return "ordinary (more is not permitted)"


def run_as_others() -> None:
    """What follows the flight must not hold up the rest of the machine."""
    with suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
