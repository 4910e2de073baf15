"""A log's page and the explanation's own page in a real browser."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import flownav
from browsing import Visit
from command import run
from flownav.report.html import write_report
from flownav.studies.explain.hypothesis import words
from flownav.studies.explain.page import HEADINGS
from planted.planted import written
from planted_logs import fault

pytestmark = pytest.mark.browser

NARROW = 390
ROWS = """() => [...document.querySelectorAll("#explained tbody tr, #checked tbody tr")].map((row) =>
  [...row.children].map((cell) => cell.innerText))"""
OVERFLOWS = "document.documentElement.scrollWidth > window.innerWidth"


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The page of a replay of a log whose flow is turned, and the page that explains it."""
    folder = tmp_path_factory.mktemp("explained")
    log = written(fault("forum", "sensor mounted a quarter turn round"), folder)
    assert run("replay", str(log), "--out", "r.fnr", cwd=folder).returncode == 0
    write_report(flownav.load(folder / "r.fnr"), folder / "log.html")
    assert run("explain", str(log), "--out", "why.html", cwd=folder).returncode == 1
    return {"log": folder / "log.html", "why": folder / "why.html"}


@pytest.fixture(params=[1440, NARROW], ids=["wide", "narrow"])
def visits(request: Any, browser: Any, pages: dict[str, Path]) -> Iterator[dict[str, Visit]]:
    opened = {name: Visit(browser, path, width=request.param) for name, path in pages.items()}
    yield opened
    for visit in opened.values():
        visit.context.close()


def test_the_log_s_page_tells_the_cause_on_top_and_lists_what_was_tried(visits):
    visit = visits["log"]
    verdict = visit.page.locator("header p.summary").first
    assert verdict.is_visible()
    assert verdict.inner_text().startswith("A cause of drift: The flow sensor's axes are not the vehicle's")
    section = visit.page.locator("#explained")
    section.scroll_into_view_if_needed()
    assert section.get_by_role("columnheader").all_inner_texts() == list(HEADINGS)
    rows = visit.page.evaluate(ROWS)
    assert rows[0][0] == words()["flow_axes"]["title"]
    assert len({row[0] for row in rows}) == len(rows) > 1
    assert visit.errors == []
    assert not visit.page.evaluate(OVERFLOWS)


def test_a_wide_page_leads_to_it_from_its_contents(browser, pages):
    visit = Visit(browser, pages["log"], width=1440)
    visit.page.get_by_role("link", name="Why it drifted").click()
    visit.until("location.hash === '#explained'")
    visit.until("document.querySelector('#explained').getBoundingClientRect().top < 100")
    visit.context.close()


def test_the_explanation_draws_its_evidence_and_has_the_cure(visits):
    visit = visits["why"]
    figures = visit.page.locator("[data-figure]")
    assert figures.count() >= 1
    for number in range(figures.count()):
        figure = figures.nth(number)
        figure.scroll_into_view_if_needed()
        visit.until_it_is(lambda figure=figure: bool(figure.get_attribute("data-drawn")), True)
        box = figure.bounding_box()
        assert box["width"] > 200
        assert box["x"] + box["width"] <= visit.width
    cure = visit.page.locator("#cure-flow_axes")
    assert cure.is_visible()
    assert cure.locator("tbody tr").first.locator("th, td").all_inner_texts()[:2] == ["SENS_FLOW_ROT", "2"]
    assert visit.page.evaluate(ROWS)[0][0] == words()["flow_axes"]["title"]
    assert visit.errors == []
    assert not visit.page.evaluate(OVERFLOWS)
    assert [request for request in visit.requests if not request.startswith(("file:", "data:", "blob:"))] == []
