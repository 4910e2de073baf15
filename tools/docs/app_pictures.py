"""The pictures of the tutorial on `flownav app`, as photographs of its pages in headless Chromium.

`app_pictures.py` walks through the tutorial and takes them anew into docs/pictures. `app_pictures.py FOLDER WIDTH
[dark]` takes them into another folder, at a width in pixels. It needs Chromium, and the dependency group `docs`.
"""

from __future__ import annotations

import contextlib
import io
import json
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from PIL import Image

PICTURES = Path(__file__).parents[2] / "docs" / "pictures"
WIDTH = 1000  # of the tutorial's pictures [px]
HEIGHTS = {390: 844, 1600: 1000}
PATIENCE_MS = 300_000
COLOURS, ROUNDS = 192, 4  # of a picture; of the search for them, so that small red marks stay red
FLOWNAV = (sys.executable, "-m", "flownav")
PORT = 14550  # of the simulated vehicle


@contextlib.contextmanager
def the_page(folder: Path) -> Iterator[str]:
    """The address of `flownav app` on a folder, as a person would start it."""
    command = [*FLOWNAV, "app", "--folder", str(folder), "--no-browser", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as running:
        assert running.stdout is not None
        try:
            yield json.loads(running.stdout.readline())["address"]
        finally:
            running.terminate()


class Camera:
    """Walks through the pages and photographs them."""

    def __init__(self, page: Any, address: str, folder: Path) -> None:
        self.page, self.address, self.folder = page, address, folder

    def go(self, name: str) -> None:
        """Open a page by its link."""
        self.page.get_by_role("navigation").get_by_role("link", name=name, exact=True).click()
        self.page.get_by_role("heading", level=1, name=name).wait_for()

    def click(self, name: str) -> None:
        """Press a button of the page."""
        self.page.locator("main").get_by_role("button", name=name, exact=True).first.click()

    def take(self, name: str) -> None:
        """A photograph of what is on the page, without the list of jobs and the folder's name below it."""
        hide = "(how) => document.querySelectorAll('#jobs, footer').forEach((each) => { each.style.display = how; })"
        self.page.evaluate(hide, "none")
        shot = self.page.locator("body").screenshot(animations="disabled")
        self.page.evaluate(hide, "")
        picture = Image.open(io.BytesIO(shot)).convert("RGB").quantize(COLOURS, kmeans=ROUNDS, dither=Image.Dither.NONE)
        picture.save(self.folder / f"app-{name}.png", optimize=True)


def logs(camera: Camera, log: Path) -> None:
    """A log that was dropped in, its verdict and its path, and why it drifted."""
    camera.go("Logs")
    camera.page.set_input_files("#choose", log)
    camera.page.locator("li[data-file] .verdict").first.wait_for()
    camera.take("logs")
    camera.click("Identify")
    camera.page.locator("li.job.done").first.wait_for()
    camera.page.locator("#jobs").screenshot(path=camera.folder / "app-jobs.png")


def cut(camera: Camera) -> None:
    """GPS cut on the timeline."""
    camera.page.locator("li[data-file] a", has_text="Cut GPS").first.click()
    chart = camera.page.locator("svg.chart.drawn")
    chart.locator("polyline").wait_for(state="attached")
    chart.scroll_into_view_if_needed()
    box = chart.bounding_box()
    camera.page.mouse.move(box["x"] + 0.45 * box["width"], box["y"] + 0.4 * box["height"])
    camera.page.mouse.down()
    camera.page.mouse.move(box["x"] + 0.75 * box["width"], box["y"] + 0.4 * box["height"], steps=5)
    camera.page.mouse.up()
    camera.page.locator("tbody td:nth-child(2)", has_text=re.compile(r"\d\.\d\d")).wait_for()
    camera.page.get_by_text("answered in").wait_for()
    camera.take("cut")


def fly(camera: Camera) -> None:
    """A landing, and the touchdowns of two hundred."""
    camera.go("Fly")
    camera.page.locator("main figure.picture svg").first.wait_for()
    camera.click("Fly 200")
    camera.page.get_by_role("link", name="Open the campaign's page").wait_for()
    camera.take("fly")


def certify(camera: Camera) -> None:
    """The plan of a requirement."""
    camera.go("Certify")
    camera.page.get_by_label("Requirement").select_option("approach")
    camera.click("Plan")
    camera.page.get_by_text("To fly and judge takes about").wait_for()
    camera.take("certify")


def live(camera: Camera) -> None:
    """A session with the simulated vehicle: withheld, and sent."""
    camera.go("Live")
    camera.click("Try it with a simulated vehicle")
    alarm = camera.page.locator("section.session [role=alert]")
    alarm.filter(has_text="Nothing is sent").wait_for()
    camera.take("live-withheld")
    alarm.filter(has_text="The estimate is sent").wait_for()
    camera.page.wait_for_timeout(20_000)  # of the flight
    camera.take("live")
    camera.click("Stop the session")
    camera.page.locator("section.session").wait_for(state="detached")


def take_all(into: Path, width: int = WIDTH, *, dark: bool = False) -> list[str]:
    """Walk through the tutorial; the names of the pictures. Raises where a step of it does not work."""
    from playwright.sync_api import sync_playwright

    into.mkdir(parents=True, exist_ok=True)
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    with tempfile.TemporaryDirectory() as name, sync_playwright() as playwright:
        folder = Path(name)
        subprocess.run([*FLOWNAV, "sample", "ulog"], cwd=folder, check=True, stdout=subprocess.DEVNULL)
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-gpu"])
        size = {"width": width, "height": HEIGHTS.get(width, 800)}
        page = browser.new_page(viewport=size, color_scheme="dark" if dark else "light")
        page.set_default_timeout(PATIENCE_MS)
        with the_page(folder / "app") as address:
            page.goto(address)
            page.wait_for_selector("html[data-ready=yes]", state="attached")
            camera = Camera(page, address, into)
            logs(camera, folder / "samples" / "flight.ulg")
            for step in (cut, fly, certify, live):
                step(camera)
                print(step.__name__, flush=True)
        browser.close()
    return sorted(path.stem for path in into.glob("app-*.png"))


if __name__ == "__main__":
    given = sys.argv[1:]
    print(*take_all(Path(given[0]), int(given[1]), dark="dark" in given) if given else take_all(PICTURES), sep="\n")
