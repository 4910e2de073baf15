"""The page's server in this process, with a worker and commands that answer at once, or with the real ones."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from flownav.app.desk import Desk
from flownav.app.doors import Doors
from flownav.app.server import application
from flownav.app.shelf import Shelf
from flownav.cli.page import WORKER

TOKEN, PORT = "token-of-the-tests", 8047
MISSING = "install `starlette` and `httpx2` (dependency group `test`)"
BASE = f"http://127.0.0.1:{PORT}"
# answers with what it was asked; a question about `slow` takes for ever, one about `broken` ends it
ECHO = """
import json, sys, time
for line in sys.stdin:
    asked = json.loads(line)
    path = asked.get("path", "")
    if "slow" in path: time.sleep(600)
    if "broken" in path: sys.exit(3)
    if "bad" in path: answer = {"error": f"{path}: is damaged"}
    else: answer = {"explained": "nothing wrong", "asked": asked, "path": [[0, 0], [1, 2]]}
    print(json.dumps(answer), flush=True)
"""
# a command that prints its words as its facts; `report slow.fnr` takes for ever, a live session until it is to end
COMMAND = """
import json, signal, sys, time
if sys.argv[1] == "live":
    ending = []
    signal.signal(signal.SIGTERM, lambda number, frame: ending.append(number))
    print("flownav: is at work", file=sys.stderr, flush=True)
    while not ending: time.sleep(0.01)
    print(json.dumps({"schema": 1, "sent": 7}), flush=True)
    sys.exit(0)
print("flownav: is at work", file=sys.stderr, flush=True)
if any("slow" in word for word in sys.argv): time.sleep(600)
if any("bad" in word for word in sys.argv): print("flownav: bad.fnr: is no record", file=sys.stderr); sys.exit(2)
print(json.dumps({"schema": 1, "words": sys.argv[1:]}))
"""


def desk_of(folder: Path, *, real: bool = False) -> Desk:
    """A desk; real: with flownav's own worker and commands."""
    if real:
        return Desk(Shelf(folder), WORKER)
    return Desk(Shelf(folder), (sys.executable, "-c", ECHO), (sys.executable, "-c", COMMAND))


def client_of(desk: Desk) -> Any:
    """A client that has the token in its address; to be used as a context, in which jobs and looks go on."""
    testing = pytest.importorskip(
        "starlette.testclient", reason="install `starlette`, `httpx2` (dependency group `test`)"
    )

    return testing.TestClient(Doors(application(desk), TOKEN, PORT), base_url=BASE)


def until(read: Callable[[], Any], patience_s: float = 120.0) -> Any:
    """The value that is read once it is true."""
    give_up = time.monotonic() + patience_s
    while not (found := read()):
        assert time.monotonic() < give_up
        time.sleep(0.02)
    return found


class Page:
    """The requests of one tab."""

    def __init__(self, client: Any) -> None:
        self.client = client

    def get(self, path: str, **options: Any) -> Any:
        return self.client.get(f"/{TOKEN}/{path}", **options)

    def post(self, path: str, asked: dict[str, Any], **options: Any) -> Any:
        return self.client.post(f"/{TOKEN}/{path}", json=asked, **options)

    def upload(self, name: str, content: Any, **options: Any) -> Any:
        return self.client.put(f"/{TOKEN}/api/upload", params={"name": name}, content=content, **options)

    def state(self) -> dict[str, Any]:
        return self.get("api/state").json()

    def file(self, name: str) -> dict[str, Any] | None:
        return next((each for each in self.state()["files"] if each["name"] == name), None)

    def look(self, name: str) -> dict[str, Any]:
        """The result of a look at a log, once it is there."""
        return until(lambda: (self.file(name) or {}).get("look"))

    def job(self, number: int) -> dict[str, Any]:
        return next(each for each in self.state()["jobs"] if each["number"] == number)

    def ended(self, number: int) -> dict[str, Any]:
        """A job once it ended."""
        return until(lambda: (job := self.job(number))["ended_s"] and job)
