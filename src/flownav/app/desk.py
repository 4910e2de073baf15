"""The desk behind the page: its folder, its jobs, the two warm processes, and the looks at logs that are under way."""

import asyncio
from collections.abc import Sequence
from typing import Any

from flownav.app.jobs import COMMAND, Jobs
from flownav.app.shelf import CAMPAIGN as PLAN
from flownav.app.shelf import LOOKED_AT, Shelf
from flownav.app.tasks import word
from flownav.app.warm import Warm
from flownav.core.errors import InputError

ASKED = ("cut", "fly", "cloud", "pace")


class Desk:
    """Everything that the page's requests come to.

    worker: how a warm process is called. One looks at logs, which may be cancelled; the other answers what is drawn.
    command: how flownav is called.
    """

    def __init__(self, shelf: Shelf, worker: Sequence[str], command: Sequence[str] = COMMAND) -> None:
        self.shelf, self.jobs = shelf, Jobs(shelf.folder, command)
        self.looker, self.bench = Warm(worker), Warm(worker)
        self.looking: dict[str, asyncio.Task[None]] = {}
        self._in_hand = ""  # the log that is looked at now

    def state(self) -> dict[str, Any]:
        """The page's state: the folder, what lies in it, and the jobs."""
        entries = self.shelf.entries()
        for entry in entries:
            if entry["kind"] in LOOKED_AT and entry["look"] is None:
                self.look(entry["name"])
            entry["looking"] = entry["name"] in self.looking
        jobs = [job.shown() for job in self.jobs.all.values()]
        return {"folder": str(self.shelf.folder), "files": entries, "jobs": jobs, "saying": self.bench.saying}

    def look(self, name: str) -> None:
        """Look at a log, where that is not under way."""
        if name not in self.looking:
            task = asyncio.get_running_loop().create_task(self._look(name))
            self.looking[name] = task
            task.add_done_callback(lambda _: self.looking.pop(name, None))

    async def _look(self, name: str) -> None:
        path = self.shelf.existing(name)
        try:
            look = await self.looker.ask({"what": "look", "path": str(path)})
        except InputError as error:
            look = {"error": str(error).replace(f"{self.shelf.folder}/", "")}
        if path.exists():
            self.shelf.keep_look(path, look)

    async def stop_looking(self, name: str) -> None:
        """Break a look off; the log stays, without a verdict, until it is asked for again."""
        task = self.looking.get(name)
        if task is not None:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
            path = self.shelf.existing(name)
            self.shelf.keep_look(path, {"error": f"{name}: was not looked at; look again"})

    def forget(self, name: str) -> None:
        """Look at a log again."""
        self.shelf.keep_look(self.shelf.existing(name), {})
        self.look(name)

    async def ask(self, question: dict[str, Any]) -> dict[str, Any]:
        """A question that is answered within seconds: a GPS cut, a flight, touchdowns, a certificate's time."""
        if question.get("what") not in ASKED:
            raise InputError("no such question")
        if question["what"] == "cloud" and not (self.shelf.path_of(str(question.get("file"))) / PLAN).is_file():
            return {"flights": 0, "planned": 1, "landed": 0, "r95_m": None, "svg": "", "words": "is begun"}
        if "file" in question:
            question["path"] = str(self.shelf.existing(str(question["file"])))
        if question["what"] == "pace":
            asked = word(question.get("requirement"))
            question["requirement"] = str(self.shelf.existing(asked)) if asked.endswith(".toml") else asked
        if question.get("sensor"):
            question["sensor"] = str(self.shelf.existing(str(question["sensor"])))
        return await self.bench.ask(question)

    async def close(self) -> None:
        """End all that runs."""
        for task in list(self.looking.values()):
            task.cancel()
        await asyncio.gather(self.jobs.close(), self.looker.stop(), self.bench.stop(), *self.looking.values(),
                             return_exceptions=True)  # fmt: skip
