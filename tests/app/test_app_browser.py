"""The page in headless Chromium: a log is dropped in, explained and cut; two tabs; nothing sticks out or complains."""

from __future__ import annotations

import re
import socket
import threading
import time
from typing import Any

import pytest

from app_desk import TOKEN, desk_of
from flownav.app.doors import Doors
from flownav.app.server import application, listening
from replay_logs import log_of_flight
from ulog_files import ulog_of_flight

pytestmark = pytest.mark.browser
PATIENCE_MS = 120_000


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    """The page, served to a browser, with flownav's own worker and commands."""
    pytest.importorskip("starlette", reason="install `starlette` (dependency group `test`)")
    desk = desk_of(tmp_path_factory.mktemp("page"), real=True)
    found: socket.socket = listening(0)
    port = found.getsockname()[1]
    uvicorn = pytest.importorskip("uvicorn", reason="install `uvicorn` (dependency group `test`)")
    config = uvicorn.Config(Doors(application(desk), TOKEN, port), log_level="warning", ws="none", loop="asyncio")
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [found]})
    thread.start()
    give_up = time.monotonic() + 60.0
    while not server.started:
        assert time.monotonic() < give_up
        time.sleep(0.05)
    yield f"http://127.0.0.1:{port}/{TOKEN}/"
    server.should_exit = True
    thread.join(60.0)
    found.close()


class Tab:
    """A tab, and what it complained of."""

    def __init__(self, browser: Any, address: str, width: int = 1100, **options: Any) -> None:
        self.width, self.complaints, self.asked = width, [], []
        self.context = browser.new_context(viewport={"width": width, "height": 850}, **options)
        self.context.set_default_timeout(PATIENCE_MS)
        self.page = self.context.new_page()
        self.page.on("console", lambda said: self.complaints.append(said.text) if said.type == "error" else None)
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.goto(address)
        self.page.wait_for_selector("html[data-ready=yes]", state="attached")

    def close(self, address: str) -> None:
        """Nothing was complained of, nothing was asked of anybody else, nothing sticks out."""
        assert self.complaints == []
        assert [url for url in self.asked if not url.startswith((address.split("#")[0], "data:"))] == []
        assert self.page.evaluate("document.documentElement.scrollWidth") <= self.width
        self.context.close()


def test_a_log_is_dropped_in_explained_and_there_after_a_reload(browser, address):
    tab = Tab(browser, address)
    log = ulog_of_flight(log_of_flight(30.0).tables).bytes()
    tab.page.set_input_files("#choose", {"name": "flight.ulg", "mimeType": "application/octet-stream", "buffer": log})
    row = tab.page.locator("li[data-file='flight.ulg']")
    row.locator(".verdict").wait_for()
    assert row.locator("svg.thumbnail polyline").count() == 1
    row.get_by_role("button", name="Explain").click()
    tab.page.reload()
    tab.page.locator("li.job.done").wait_for()
    assert "flownav explain flight.ulg" in tab.page.inner_text("li.job.done")
    assert tab.page.locator("li.job.done a").first.get_attribute("href").endswith("flight-explained.html")
    other = Tab(browser, address, 390, color_scheme="dark")
    assert other.page.locator("li[data-file='flight.ulg'] .verdict").count() == 1
    assert other.page.locator("li.job").count() == 1
    for each in (tab, other):
        each.close(address)


def test_gps_is_cut_by_drawing_and_by_typing(browser, address):
    tab = Tab(browser, f"{address}#logs")
    tab.page.locator("li[data-file='flight.ulg'] a", has_text="Cut GPS").click()
    chart = tab.page.locator("svg.chart.drawn")
    chart.locator("polyline").wait_for(state="attached")
    box = chart.bounding_box()
    tab.page.mouse.move(box["x"] + 0.4 * box["width"], box["y"] + 50)
    tab.page.mouse.down()
    tab.page.mouse.move(box["x"] + 0.7 * box["width"], box["y"] + 50, steps=4)
    tab.page.mouse.up()
    tab.page.locator("tbody td:nth-child(2)", has_text=re.compile(r"\d\.\d\d")).wait_for()
    assert "--gps-outage" in tab.page.inner_text("main")
    tab.page.get_by_label("Cut GPS from [s]").fill("3")
    tab.page.get_by_label("Cut GPS to [s]").fill("6")
    tab.page.get_by_role("button", name="Cut", exact=True).press("Enter")
    tab.page.locator("tbody tr:nth-child(2)").wait_for()
    assert tab.page.inner_text("tbody tr:first-child td:first-child") == "3 to 6"
    tab.close(address)


def test_a_damaged_file_is_one_line_in_the_list(browser, address):
    tab = Tab(browser, address)
    torn = {"name": "torn b.ulg", "mimeType": "application/octet-stream", "buffer": b"ULog"}
    tab.page.set_input_files("#choose", torn)
    alert = tab.page.locator("li[data-file='torn b.ulg'] .alert")
    alert.wait_for()
    assert "\n" not in alert.inner_text()
    tab.close(address)


@pytest.mark.parametrize("page", ["logs", "cut", "fly", "certify", "live"])
def test_every_page_fits_a_phone_in_the_dark(browser, address, page):
    tab = Tab(browser, f"{address}#{page}", 390, color_scheme="dark")
    assert tab.page.locator("h1").count() == 1
    assert tab.page.get_attribute("nav a[aria-current]", "href") == f"#{page}"
    tab.close(address)
