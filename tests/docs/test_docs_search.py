"""The site's search finds what it is asked for where the site is opened from a disk."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from browsing import CHROMIUM, QUIET
from places import DOCS, PROJECT

SETTINGS = (PROJECT / "mkdocs.yml").read_text(encoding="utf-8")
PAGES = {"index.md": "# Begin\n\nNothing.\n", "found.md": "# Where it is\n\nThe word is quincunx.\n"}


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    pytest.importorskip("zensical")
    folder = tmp_path_factory.mktemp("search")
    pages = folder / "out" / "docs-pages"
    (pages / "assets").mkdir(parents=True)
    for asset in (DOCS / "assets").iterdir():
        (pages / "assets" / asset.name).write_bytes(asset.read_bytes())
    for name, text in PAGES.items():
        (pages / name).write_text(text, encoding="utf-8")
    own = re.sub(r"nav:\n.*?\n(?=theme:)", "nav:\n  - Begin: index.md\n  - Found: found.md\n", SETTINGS, flags=re.S)
    (folder / "mkdocs.yml").write_text(own.replace("  - mathematics\n", ""), encoding="utf-8")
    order = [str(Path(sys.executable).parent / "zensical"), "build", "--config-file", "mkdocs.yml"]
    subprocess.run(order, cwd=folder, check=True, capture_output=True)
    return folder / "out" / "docs"


def test_pages_load_nothing_from_a_network(site):
    page = (site / "index.html").read_text(encoding="utf-8")
    scripts = re.findall(r'<script[^>]* src="([^"]*)"', page)
    assert "./assets/iframe-worker.js" in scripts
    assert [script for script in scripts if "//" in script] == []


@pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium")
def test_the_search_of_a_site_on_disk_finds_the_page_with_the_word(site):
    api = pytest.importorskip("playwright.sync_api")
    with api.sync_playwright() as play:
        browser = play.chromium.launch(executable_path=CHROMIUM, args=QUIET)
        page = browser.new_page()
        page.set_default_timeout(60_000)
        page.goto((site / "index.html").as_uri())
        page.get_by_role("button", name="Search").first.click()
        page.get_by_placeholder("Search").first.fill("quincunx")
        page.get_by_text("Where it is").first.click()
        page.wait_for_url("**/found.html*")
        browser.close()
