"""The page of `flownav app`, served to a headless browser, and a tab of it."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from app_desk import TOKEN
from flownav.app.desk import Desk
from flownav.app.doors import Doors
from flownav.app.server import application, listening

PATIENCE_MS = 240_000  # a machine that has no time takes longer


@contextmanager
def served(desk: Desk) -> Iterator[str]:
    """The address of the page while it is served."""
    pytest.importorskip("starlette", reason="install `starlette` (dependency group `test`)")
    uvicorn = pytest.importorskip("uvicorn", reason="install `uvicorn` (dependency group `test`)")
    with listening(0) as found:
        port = found.getsockname()[1]
        config = uvicorn.Config(Doors(application(desk), TOKEN, port), log_level="warning", ws="none", loop="asyncio")
        server = uvicorn.Server(config)
        thread = threading.Thread(target=server.run, kwargs={"sockets": [found]})
        thread.start()
        give_up = time.monotonic() + 60.0
        while not server.started:
            assert time.monotonic() < give_up
            time.sleep(0.05)
        try:
            yield f"http://127.0.0.1:{port}/{TOKEN}/"
        finally:
            server.should_exit = True
            thread.join(60.0)


class Tab:
    """A tab, and what it complained of."""

    def __init__(self, browser: Any, address: str, width: int = 1100, **options: Any) -> None:
        self.width, self.complaints, self.asked = width, [], []
        self.context = browser.new_context(viewport={"width": width, "height": 850}, **options)
        self.context.set_default_timeout(PATIENCE_MS)
        self.page = self.context.new_page()
        self.page.on("console", lambda line: self.complaints.append(line.text) if line.type == "error" else None)
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.goto(address)
        self.ready()

    def ready(self) -> None:
        """Wait until the page is there."""
        self.page.wait_for_selector("html[data-ready=yes]", state="attached")

    def close(self, address: str) -> None:
        """Nothing was complained of, nothing was asked of anybody else, nothing sticks out."""
        assert self.complaints == []
        assert [url for url in self.asked if not url.startswith((address.split("#")[0], "data:"))] == []
        assert self.page.evaluate("document.documentElement.scrollWidth") <= self.width
        self.context.close()
