"""How the pages of reports look: on a phone, a wide screen and paper, in light and in dark; a landing that moves."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from browsing import Visit
from flownav.report.style import PALETTE
from page_looks import complaints, ground_of, rgb
from report_records import navigated, replay, write_pages

pytestmark = pytest.mark.browser

LARGEST_BYTES = 2.2e6
PAPER_PX = 688  # A4 less its margins
# where the vehicle of each view stands on the screen
PLACES = """[...document.querySelectorAll(".landing-picture .moving.vehicle")].map((vehicle) => {
  const at = vehicle.getScreenCTM();
  return [at.e, at.f];
})"""
SHOWN = """(name) => [...document.querySelectorAll(`.landing-picture .${name}`)]
  .filter((part) => getComputedStyle(part).display !== "none").length"""


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("looks")
    return write_pages(folder, {"landing": navigated(), "replay": replay()})


@pytest.mark.parametrize(("width", "scheme"), [(390, "light"), (390, "dark"), (1600, "light"), (1600, "dark")])
@pytest.mark.parametrize("page", ["landing", "replay", "compared"])
def test_a_page_is_whole_and_readable(browser: Any, pages: dict[str, Path], page: str, width: int, scheme: str) -> None:
    visit = Visit(browser, pages[page], width=width, color_scheme=scheme)
    assert complaints(visit.page) == []
    assert ground_of(visit.page) == rgb(PALETTE["page"][scheme == "dark"])
    assert visit.errors == []
    visit.context.close()


@pytest.mark.parametrize("page", ["landing", "replay", "compared"])
def test_paper_is_light_whole_and_readable_for_a_reader_in_the_dark(
    browser: Any, pages: dict[str, Path], page: str
) -> None:
    visit = Visit(browser, pages[page], width=PAPER_PX, color_scheme="dark")
    visit.page.evaluate("dispatchEvent(new Event('beforeprint'))")
    visit.page.emulate_media(media="print")
    assert [one for one in complaints(visit.page, smallest_px=6.0) if "contrast" not in one] == []
    assert visit.page.evaluate("getComputedStyle(document.body).color") == rgb(PALETTE["ink"][0])
    visit.context.close()


@pytest.mark.parametrize("page", ["landing", "replay", "compared"])
def test_a_page_is_small_enough_to_be_sent(pages: dict[str, Path], page: str) -> None:
    assert pages[page].stat().st_size <= LARGEST_BYTES


def test_the_landing_plays_from_a_file_in_a_loop_of_5_s_and_stands_still_on_paper(
    browser: Any, pages: dict[str, Path]
) -> None:
    visit = Visit(browser, pages["landing"], width=1440)
    assert visit.page.url.startswith("file:")
    before = np.array(visit.page.evaluate(PLACES))
    visit.until_it_is(lambda: np.abs(np.array(visit.page.evaluate(PLACES)) - before).max() > 1.0, True)
    clock = "(at_s) => document.querySelectorAll('.landing-picture svg').forEach((one) => one.setCurrentTime(at_s))"
    visit.page.evaluate("document.querySelectorAll('.landing-picture svg').forEach((one) => one.pauseAnimations())")
    places = []
    for at_s in (1.0, 3.0, 6.0):
        visit.page.evaluate(clock, at_s)
        visit.paint()
        places.append(np.array(visit.page.evaluate(PLACES)))
    assert len(places[0]) >= 2
    assert np.abs(places[1] - places[0]).max() > 5.0
    assert places[2] == pytest.approx(places[0], abs=0.1)
    assert (visit.page.evaluate(SHOWN, "moving") > 0, visit.page.evaluate(SHOWN, "still")) == (True, 0)
    visit.page.emulate_media(media="print")
    assert (visit.page.evaluate(SHOWN, "moving"), visit.page.evaluate(SHOWN, "still") > 0) == (0, True)
    visit.context.close()
