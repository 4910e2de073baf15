"""A certificate and a campaign in a real browser: figures drawn, nothing loaded, phone, dark, paper to be signed."""

from __future__ import annotations

import pytest

from browsing import Visit
from flownav.api.campaign import Campaign
from flownav.campaigns.certification.cells import plan_of
from flownav.campaigns.certification.certify import certify, with_ranking
from flownav.campaigns.certification.written import write_certificate
from flownav.campaigns.requirement import load_requirement
from flownav.campaigns.store import Dataset, Store
from flownav.campaigns.summary import summary_of
from flownav.report.style import PALETTE
from page_looks import complaints, ground_of, rgb
from requirements import ASKED, HEAD, WINDY, StandIn, write

pytestmark = pytest.mark.browser
CRASH = '[[requirement]]\nmeasure = "crash"\nat_most = 0\nprobability = 0.9\n'


def far_in_wind(cell, seed, first, flights):
    """Up to 0.8 m from the pad's centre, the further the more wind there is."""
    import numpy as np

    return 0.1 * np.array(cell.ensemble.values(seed, first, flights)["wind.speed_20ft_m_s"])


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """The pages of a certificate and of the campaign that its flights are."""
    folder, engine = tmp_path_factory.mktemp("certificate"), StandIn(far_in_wind)
    path = write(folder, HEAD + WINDY + "height_m = [2, 4]\n" + ASKED + CRASH)
    asked = load_requirement(path)
    plan = plan_of(asked, 600)
    with Store(folder / "out").opened(plan) as store:
        certificate = with_ranking(certify(asked, plan, engine, store), engine, store.folder, 16)
        write_certificate(certificate, store, path, 0)
    campaign = Campaign(plan, folder / "out", summary_of(plan, Dataset(folder / "out")))
    return {"certificate": folder / "out" / "certificate.html", "campaign": campaign.report(folder / "campaign.html")}


@pytest.fixture
def page(pages):
    return pages["certificate"]


def test_every_figure_is_drawn_and_the_verdict_is_said(browser, page):
    visit = Visit(browser, page, width=1440)
    visit.check(count=5)  # touchdowns, tail, envelope, ranking, split
    text = visit.page.inner_text("body")
    assert visit.page.inner_text(".verdict b") == "Fail"
    for words in ("Distance of the first contact from the pad's centre at most 0.5 m with 90 %", "Consumer's risk",
                  "Tolerance bound", "from 2 m", "Assumptions", "SHA-256", "Approved by"):  # fmt: skip
        assert words in text
    visit.context.close()


def test_it_works_on_a_dark_phone(browser, page):
    visit = Visit(browser, page, width=390, color_scheme="dark", has_touch=True, is_mobile=True)
    visit.check(count=5)
    assert {figure["ink"] for figure in visit.figures().values()} == {"#e7eaee"}
    assert visit.page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    visit.context.close()


def test_paper_has_places_to_sign_and_no_trees(browser, page):
    visit = Visit(browser, page, width=1440, color_scheme="dark")
    visit.page.evaluate("dispatchEvent(new Event('beforeprint'))")
    visit.page.emulate_media(media="print")
    visit.until("[...document.querySelectorAll('[data-figure]')].every((p) => p._fullLayout.width <= 680)")
    assert {figure["ink"] for figure in visit.figures().values()} == {"#1d232a"}
    assert visit.page.evaluate("document.querySelectorAll('.signature').length") == 3
    assert visit.page.evaluate("getComputedStyle(document.querySelector('.on-screen')).display") == "none"
    visit.context.close()


@pytest.mark.parametrize(("width", "scheme"), [(390, "light"), (390, "dark"), (1600, "dark")])
@pytest.mark.parametrize("name", ["certificate", "campaign"])
def test_a_page_is_whole_readable_and_small_enough_to_be_sent(browser, pages, name, width, scheme):
    visit = Visit(browser, pages[name], width=width, color_scheme=scheme)
    assert complaints(visit.page) == []
    assert ground_of(visit.page) == rgb(PALETTE["page"][scheme == "dark"])
    assert visit.errors == []
    assert pages[name].stat().st_size <= 2.2e6
    visit.context.close()


@pytest.mark.parametrize("name", ["certificate", "campaign"])
def test_tables_are_whole_on_paper(browser, pages, name):
    visit = Visit(browser, pages[name], width=688)  # A4 less its margins
    visit.page.evaluate("dispatchEvent(new Event('beforeprint'))")
    visit.page.emulate_media(media="print")
    visit.paint()
    wide = "[...document.querySelectorAll('table')].filter((one) => one.getBoundingClientRect().right > 689).length"
    assert visit.page.evaluate(wide) == 0
    visit.context.close()
