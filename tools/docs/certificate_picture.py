"""The picture of the certificate in docs/how-to/certify.md: the top of its page in headless Chromium.

`certificate_picture.py certificate.html` draws docs/pictures/certificate.png. The page is that of the page's worked
example, `flownav certify pad_in_wind.toml`; it is drawn by hand when the page or the flights change.
"""

from __future__ import annotations

import io
import shutil
import sys
from pathlib import Path

PICTURE = Path(__file__).parents[2] / "docs" / "pictures" / "certificate.png"
SIZE_PX, SCALE = (1140, 2100), 0.75  # wide enough for two figures beside each other
COLOURS = 256  # enough for a page, and the file is a fraction as large


def main(page: Path, out: Path = PICTURE) -> None:
    """Draw the page's top."""
    from PIL import Image
    from playwright.sync_api import sync_playwright

    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    with sync_playwright() as running:
        opened = running.chromium.launch(executable_path=browser, args=["--no-sandbox", "--disable-gpu"])
        tab = opened.new_page(viewport={"width": SIZE_PX[0], "height": SIZE_PX[1]}, device_scale_factor=SCALE)
        tab.goto(page.resolve().as_uri())
        tab.wait_for_selector("html[data-figures=drawn]", state="attached", timeout=120_000)
        shown = Image.open(io.BytesIO(tab.screenshot()))
        opened.close()
    shown.convert("RGB").quantize(COLOURS, method=Image.Quantize.MAXCOVERAGE).save(out, optimize=True)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: certificate_picture.py CERTIFICATE.html")
    main(Path(sys.argv[1]))
