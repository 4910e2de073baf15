"""Jobs: commands of flownav as child processes, two at a time, each of which can be cancelled."""

import asyncio
import contextlib
import json
import os
import signal
import sys
import time
from collections.abc import Coroutine, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from flownav.app.tasks import Task, command_line

COMMAND = (sys.executable, "-m", "flownav")
AT_ONCE = 2
GRACE_S = 3.0  # between asking a command to end and ending it
LIVE = "live"  # a session: it waits for nobody, and asked to end it still makes its record
RECORD_S = 120.0  # that it has for that
MOST_JOBS = 200  # that the page remembers
LONGEST_LINE = 1 << 26  # bytes of a command's one JSON object
QUEUED, RUNNING, DONE, FAILED, CANCELLED = "queued", "running", "done", "failed", "cancelled"
BAD_VERDICT = 1


@dataclass
class Job:
    """A command and what it came to. message: its one line on standard error; facts: its JSON object."""

    number: int
    kind: str
    task: Task
    state: str = QUEUED
    message: str = ""
    facts: dict[str, Any] | None = None
    since_s: float = field(default_factory=time.time)
    ended_s: float | None = None
    process: asyncio.subprocess.Process | None = None
    ending: bool = False  # a session was asked to end

    def shown(self) -> dict[str, Any]:
        """The job as the page has it."""
        return {
            "number": self.number, "kind": self.kind, "state": self.state, "message": self.message,
            "facts": self.facts, "about": self.task.about, "writes": self.task.writes,
            "command": command_line(self.task.words), "since_s": self.since_s, "ended_s": self.ended_s,
            "ending": self.ending,
        }  # fmt: skip


class Jobs:
    """The jobs of a folder. command: how flownav is called, before the words of a task."""

    def __init__(self, folder: Path, command: Sequence[str] = COMMAND) -> None:
        self.folder, self.command = folder, tuple(command)
        self.all: dict[int, Job] = {}
        self._slots = asyncio.Semaphore(AT_ONCE)
        self._running: set[asyncio.Task[None]] = set()

    def start(self, kind: str, task: Task) -> Job:
        """Begin a job, which waits while two others run, but for a live session."""
        job = Job(max(self.all, default=0) + 1, kind, task)
        self.all[job.number] = job
        for number in [each.number for each in self.all.values() if each.ended_s][: max(0, len(self.all) - MOST_JOBS)]:
            del self.all[number]
        self._keep(self._run(job))
        return job

    def _keep(self, doing: Coroutine[Any, Any, None]) -> None:
        """Do it while other requests are answered."""
        task = asyncio.get_running_loop().create_task(doing)
        self._running.add(task)
        task.add_done_callback(self._running.discard)

    async def cancel(self, number: int) -> None:
        """End a job; what it has not written whole is gone, what a campaign has flown stays.

        A live session is asked to end, and makes its record.
        """
        job = self.all.get(number)
        if job is None or job.ended_s is not None:
            return
        if job.kind == LIVE and job.process is not None:
            if not job.ending:
                job.ending = True
                self._keep(ended(job.process, RECORD_S))
            return
        job.state = CANCELLED
        if job.process is not None:
            await ended(job.process)

    async def close(self) -> None:
        """Cancel all, and wait for their ends."""
        for number in list(self.all):
            await self.cancel(number)
        await asyncio.gather(*self._running, return_exceptions=True)

    async def _run(self, job: Job) -> None:
        try:
            async with contextlib.nullcontext() if job.kind == LIVE else self._slots:
                if job.state == QUEUED:
                    job.state = RUNNING
                    await self._fly(job)
        except Exception as error:
            job.state, job.message = FAILED, f"the job could not be run: {error}"
        finally:
            job.ended_s = time.time()

    async def _fly(self, job: Job) -> None:
        """Run the command, and keep what it printed."""
        words = [*self.command, *job.task.words, "--json"]
        job.process = await asyncio.create_subprocess_exec(
            *words, cwd=self.folder, stdin=asyncio.subprocess.DEVNULL, stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE, start_new_session=True, limit=LONGEST_LINE,
        )  # fmt: skip
        assert job.process.stderr is not None
        assert job.process.stdout is not None
        _, printed = await asyncio.gather(_follow(job, job.process.stderr), job.process.stdout.read())
        status = await job.process.wait()
        job.facts = None if job.state == CANCELLED else _facts(printed)
        if job.state == CANCELLED or (job.ending and job.facts is None):
            job.state, job.message = CANCELLED, job.message if job.ending else "cancelled"
            return
        job.state = DONE if job.facts is not None and status in (0, BAD_VERDICT) else FAILED
        if job.state == FAILED and not job.message:
            job.message = f"the command ended with status {status}"


async def _follow(job: Job, stream: asyncio.StreamReader) -> None:
    """Keep the last line of standard error that says something."""
    async for line in stream:
        text = line.decode(errors="replace").rsplit("\r", 1)[-1].strip()
        if text:
            job.message = text.removeprefix("flownav: ")


def _facts(printed: bytes) -> dict[str, Any] | None:
    """The JSON object that a command printed; None where there is none."""
    try:
        found = json.loads(printed)
    except ValueError:
        return None
    return found if isinstance(found, dict) else None


async def ended(process: asyncio.subprocess.Process, grace_s: float = GRACE_S) -> None:
    """End a process and its children: asked first, and made to after a grace."""
    for how, wait_s in ((signal.SIGTERM, grace_s), (signal.SIGKILL, 60.0)):
        if process.returncode is not None:
            return
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, how)
        try:
            await asyncio.wait_for(process.wait(), wait_s)
        except TimeoutError:
            continue
