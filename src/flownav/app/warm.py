"""A process that stays warm: what it has loaded and read is there for the next question."""

import asyncio
import json
from collections.abc import Sequence
from typing import Any

from flownav.app.jobs import LONGEST_LINE, ended
from flownav.core.errors import InputError

Answer = dict[str, Any]


class Warm:
    """A worker process, begun at the first question and again after it ended. command: how it is called."""

    def __init__(self, command: Sequence[str]) -> None:
        self.command = tuple(command)
        self.saying = ""  # its last line on standard error: what is compiled, and how long that takes
        self._process: asyncio.subprocess.Process | None = None
        self._turn = asyncio.Lock()
        self._listening: asyncio.Task[None] | None = None

    async def ask(self, question: dict[str, Any]) -> Answer:
        """The answer to a question, one after the other. InputError with the worker's one line."""
        async with self._turn:
            process = await self._begun()
            assert process.stdin is not None
            assert process.stdout is not None
            try:
                process.stdin.write(json.dumps(question).encode() + b"\n")
                await process.stdin.drain()
                line = await process.stdout.readline()
                answer = json.loads(line) if line else None
            except asyncio.CancelledError:  # its answer would be the next question's
                await self.stop()
                raise
            except (OSError, ValueError):
                answer = None
            self.saying = ""
            if answer is None:
                await self.stop()
                raise InputError("the work was ended before it had an answer")
            if "error" in answer:
                raise InputError(answer["error"])
            return dict(answer)

    async def stop(self) -> None:
        """End the process; a question that it works on has no answer then."""
        process, self._process = self._process, None
        if process is not None:
            await ended(process)

    async def _begun(self) -> asyncio.subprocess.Process:
        if self._process is None or self._process.returncode is not None:
            self._process = await asyncio.create_subprocess_exec(
                *self.command, stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE,
                stderr=asyncio.subprocess.PIPE, start_new_session=True, limit=LONGEST_LINE,
            )  # fmt: skip
            self._listening = asyncio.get_running_loop().create_task(self._listen(self._process))
        return self._process

    async def _listen(self, process: asyncio.subprocess.Process) -> None:
        assert process.stderr is not None
        async for line in process.stderr:
            self.saying = line.decode(errors="replace").rsplit("\r", 1)[-1].strip() or self.saying
