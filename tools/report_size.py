"""How large a record's report is and how soon it shows: python tools/report_size.py RECORD.fnr ... (needs Chromium).

Prints for each record the page's size, the time to write it, and in headless Chromium the time from the start of the
navigation to the first figure and to the last one, median of five fresh visits from the file system.
"""

from __future__ import annotations

import shutil
import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from flownav.core.record import Record
from flownav.report.html import write_report

VISITS = 5
DRAWN = """() => { const { dataset } = document.documentElement; return dataset.figures === "drawn" ?
  [Number(dataset.firstFigure), Number(dataset.lastFigure)] : null; }"""


def main(paths: list[str]) -> int:
    """Measure each record and print a table; 2 without a record or a browser."""
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        print("report_size: playwright is not installed; it is in the dependency group `test`", file=sys.stderr)
        return 2
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        print("report_size: no Chromium here; install Debian's package `chromium`", file=sys.stderr)
        return 2
    if not paths:
        print(__doc__, file=sys.stderr)
        return 2
    print(f"{'record':28} {'page [MB]':>10} {'written [s]':>12} {'first figure [s]':>17} {'all figures [s]':>16}")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as running:
        browser = running.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-gpu"])
        for path in map(Path, paths):
            record, page = Record.load(path), Path(folder) / "page.html"
            started = time.perf_counter()
            write_report(record, page)
            written = time.perf_counter() - started
            visits = [visit(browser, page) for _ in range(VISITS)]
            first, last = (statistics.median(times) / 1000.0 for times in zip(*visits, strict=True))
            print(f"{path.name:28} {page.stat().st_size / 1e6:10.2f} {written:12.2f} {first:17.2f} {last:16.2f}")
        browser.close()
    return 0


def visit(browser: Any, page: Path) -> list[float]:
    """Milliseconds to the first figure and to the last one of a page in a fresh context 1400 pixels wide."""
    context = browser.new_context(viewport={"width": 1400, "height": 900})
    tab = context.new_page()
    tab.goto(page.as_uri())
    tab.wait_for_selector("html[data-figures=drawn]", state="attached", timeout=120_000)
    times = tab.evaluate(DRAWN)
    context.close()
    return list(times)


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
