"""The README's picture: the command that it names is run, and its report photographed in headless Chromium.

`readme_picture.py [OUT.png]` writes docs/pictures/landing.png. It needs Chromium and the group `test` (playwright), so
it is run by hand when the report changes, and not by the build.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image
from playwright.sync_api import Error, sync_playwright

PROJECT = Path(__file__).parents[2]
PICTURE = PROJECT / "docs" / "pictures" / "landing.png"
NAMED = re.compile(r"\*The report of `flownav ([^`]+)`")
WIDE_PX, HIGH_PX = 1280, 1500
DRAWN_MS = 60_000
COLOURS = 128  # of the picture: a page of a few colours needs no more, and is a third of the size


def command() -> list[str]:
    """The arguments of the command that the README names under its picture. ValueError where it names none."""
    found = NAMED.search((PROJECT / "README.md").read_text(encoding="utf-8"))
    if found is None:
        raise ValueError("README.md names no command under its picture")
    return shlex.split(found[1])


def main(out: Path) -> None:
    """Run the command in an empty folder and photograph the top of the report that it writes."""
    with TemporaryDirectory() as folder:
        record = Path(folder) / "flight.fnr"
        subprocess.run([sys.executable, "-m", "flownav", *command(), "--out", str(record)], cwd=folder, check=True)
        photograph(record.with_suffix(".html"), out)


def photograph(page_file: Path, out: Path) -> None:
    """The top of a report, when its figures are drawn, as a PNG of few colours."""
    with sync_playwright() as playwright:
        try:
            browser = playwright.chromium.launch()
        except Error:  # Debian's own
            browser = playwright.chromium.launch(executable_path="/usr/bin/chromium")
        page = browser.new_page(viewport={"width": WIDE_PX, "height": HIGH_PX})
        page.goto(page_file.resolve().as_uri())
        page.wait_for_selector("html[data-figures=drawn]", timeout=DRAWN_MS)
        page.screenshot(path=str(out))
        browser.close()
    with Image.open(out) as picture:
        few = picture.convert("RGB").quantize(COLOURS)
    few.save(out, optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else PICTURE)
