"""A page opened in headless Chromium: what is drawn, what it complained of, what it asked for."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
QUIET = ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update",
         "--disable-sync", "--no-first-run", "--disable-extensions", "--disable-dev-shm-usage"]  # fmt: skip
NO_GL = ["--disable-3d-apis", "--disable-webgl", "--disable-webgl2"]

# For each figure: how many traces it has, and whether its drawing has a size and the traces are in it.
FIGURES = """() => [...document.querySelectorAll("[data-figure]")].map((plot) => {
  const drawing = plot.querySelector("svg.main-svg, canvas");
  const box = drawing ? drawing.getBoundingClientRect() : { width: 0, height: 0 };
  return { key: plot.dataset.figure, drawn: plot.dataset.drawn, plotly: plot.classList.contains("js-plotly-plot"),
           traces: (plot.data || []).length, width: box.width, height: box.height, text: plot.innerText,
           marks: plot.querySelectorAll(".scatterlayer .trace, .barlayer .trace, canvas").length,
           ink: plot.layout ? plot.layout.font.color : "", right: plot.getBoundingClientRect().right };
})"""


class Visit:
    """A page that was opened, and what it complained of."""

    def __init__(self, browser: Any, path: Path, width: int, *, watch: str = "", **options: Any) -> None:
        self.width = width
        self.context = browser.new_context(viewport={"width": width, "height": 850}, **options)
        self.context.set_default_timeout(120_000)
        self.page = self.context.new_page()
        self.errors: list[str] = []
        self.requests: list[str] = []
        self.page.on("console", lambda message: self.errors.append(message.text) if message.type == "error" else None)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("requestfailed", lambda request: self.errors.append(f"failed: {request.url[:100]}"))
        self.page.on("request", lambda request: self.requests.append(request.url[:100]))
        if watch:  # runs in the page before its own scripts do
            self.page.add_init_script(watch)
        self.page.goto(path.as_uri())
        self.wait()

    def wait(self) -> None:
        self.page.wait_for_selector("html[data-figures=drawn]", state="attached", timeout=120_000)

    def until(self, condition: str) -> None:
        """Wait for a condition; asked from here, since the page's policy lets nothing evaluate text inside it."""
        self.until_it_is(lambda: (condition, bool(self.page.evaluate(condition))), (condition, True))

    def until_it_is(self, read: Callable[[], Any], expected: Any) -> None:
        """Wait for what is read to be what is expected."""
        give_up = time.monotonic() + 120.0
        while (found := read()) != expected:
            assert time.monotonic() < give_up, (found, expected)
            self.page.wait_for_timeout(50)

    def paint(self) -> None:
        """Wait until the page has drawn what was asked of it."""
        self.page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done())))")

    def figures(self) -> dict[str, dict[str, Any]]:
        return {figure["key"]: figure for figure in self.page.evaluate(FIGURES)}

    def check(self, count: int) -> None:
        """All figures are drawn, nothing was complained of, nothing was loaded, nothing sticks out."""
        figures = self.figures()
        assert len(figures) == count
        for figure in figures.values():
            assert figure["plotly"], figure
            assert figure["drawn"] == "figure", figure
            assert figure["traces"] > 0, figure
            assert figure["marks"] > 0, figure
            assert figure["width"] > 200, figure
            assert figure["height"] > 200, figure
            assert figure["right"] <= self.width, figure
        assert self.errors == []
        assert [request for request in self.requests if not request.startswith(("file:", "data:", "blob:"))] == []
        assert self.page.evaluate("document.documentElement.scrollWidth") <= self.width  # no scrolling sideways
