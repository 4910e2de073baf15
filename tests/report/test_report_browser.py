"""The report in a real browser: every figure is drawn, nothing is loaded, narrow and dark pages work."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from browsing import CHROMIUM, NO_GL, QUIET, SOFTWARE_GL, Visit
from flownav.record import Record
from flownav.report.html import write_report
from report_records import flight, navigated, replay

pytestmark = pytest.mark.browser
WORDS_OF_NO_WEBGL = "This browser has no WebGL"


@pytest.fixture(scope="module")
def playwright() -> Iterator[Any]:
    if CHROMIUM is None:
        pytest.skip("no Chromium here: install Debian's package `chromium` (apt-get install chromium)")
    api = pytest.importorskip("playwright.sync_api", reason="install `playwright` (dependency group `test`)")
    with api.sync_playwright() as running:
        yield running


@pytest.fixture(scope="module")
def browser(playwright: Any) -> Iterator[Any]:
    opened = playwright.chromium.launch(executable_path=CHROMIUM, args=QUIET + SOFTWARE_GL)
    yield opened
    opened.close()


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("reports")
    records: dict[str, Record] = {"landing": navigated(), "takeoff": flight("takeoff"), "replay": replay(200.0)}
    for name, record in records.items():
        write_report(record, folder / f"{name}.html")
    return {name: folder / f"{name}.html" for name in records}


def test_every_figure_of_a_landing_is_drawn(browser: Any, pages: dict[str, Path]) -> None:
    visit = Visit(browser, pages["landing"], width=1440)
    visit.check(count=15)
    buttons = visit.page.eval_on_selector_all(".modebar-btn", "all => all.map((b) => b.dataset.title || '')")
    assert buttons
    assert not [title for title in buttons if "hare" in title or "loud" in title]  # no "Share chart": it would upload
    visit.context.close()


def test_a_take_off_works_on_a_dark_phone(browser: Any, pages: dict[str, Path]) -> None:
    visit = Visit(browser, pages["takeoff"], width=390, color_scheme="dark",
                  has_touch=True, is_mobile=True)  # fmt: skip
    visit.check(count=14)
    assert visit.page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(20, 24, 29)"
    assert {figure["ink"] for figure in visit.figures().values()} == {"#e7eaee"}
    visit.context.close()


def test_a_replay_follows_the_reader_from_light_to_dark(browser: Any, pages: dict[str, Path]) -> None:
    visit = Visit(browser, pages["replay"], width=1100, color_scheme="light")
    visit.check(count=10)
    assert {figure["ink"] for figure in visit.figures().values()} == {"#1d232a"}
    visit.page.emulate_media(color_scheme="dark")
    visit.until("[...document.querySelectorAll('[data-figure]')].every((p) => p.layout.font.color === '#e7eaee')")
    visit.wait()
    visit.check(count=10)
    visit.context.close()


def test_without_webgl_the_3d_view_says_so_and_the_rest_is_drawn(playwright: Any, pages: dict[str, Path]) -> None:
    opened = playwright.chromium.launch(executable_path=CHROMIUM, args=QUIET + NO_GL)
    visit = Visit(opened, pages["takeoff"], width=1440)
    figures = visit.figures()
    assert WORDS_OF_NO_WEBGL in figures.pop("path-3d")["text"]
    assert {figure["drawn"] for figure in figures.values()} == {"figure"}
    assert visit.errors == []
    opened.close()


def test_paper_gets_light_figures_that_fit_and_all_details(browser: Any, pages: dict[str, Path]) -> None:
    visit = Visit(browser, pages["landing"], width=1440, color_scheme="dark")
    visit.page.evaluate("dispatchEvent(new Event('beforeprint'))")
    visit.page.emulate_media(media="print")
    visit.until("[...document.querySelectorAll('[data-figure]')].every((p) => p._fullLayout.width <= 680)")
    assert {figure["ink"] for figure in visit.figures().values()} == {"#1d232a"}
    assert visit.page.evaluate("[...document.querySelectorAll('details')].every((part) => part.open)")
    visit.context.close()
