"""The page in headless Chromium: a log is dropped in, explained and cut; two tabs; nothing sticks out or complains."""

from __future__ import annotations

import re

import pytest

from app_desk import desk_of
from app_pages import Tab, served
from replay_logs import log_of_flight
from ulog_files import ulog_of_flight

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("page")


@pytest.fixture(scope="module")
def address(folder):
    with served(desk_of(folder, real=True)) as address:
        yield address


def test_a_log_is_dropped_in_explained_and_there_after_a_reload(browser, address):
    tab = Tab(browser, address)
    log = ulog_of_flight(log_of_flight(30.0).tables).bytes()
    tab.page.set_input_files("#choose", {"name": "flight.ulg", "mimeType": "application/octet-stream", "buffer": log})
    row = tab.page.locator("li[data-file='flight.ulg']")
    row.locator(".verdict").wait_for()
    assert row.locator("svg.thumbnail polyline").count() == 1
    row.get_by_role("button", name="Explain").click()
    tab.page.reload()
    tab.page.locator("li.job.done").wait_for()
    assert "flownav explain flight.ulg" in tab.page.inner_text("li.job.done")
    assert tab.page.locator("li.job.done a").first.get_attribute("href").endswith("flight-explained.html")
    other = Tab(browser, address, 390, color_scheme="dark")
    assert other.page.locator("li[data-file='flight.ulg'] .verdict").count() == 1
    assert other.page.locator("li.job").count() == 1
    for each in (tab, other):
        each.close(address)


def test_gps_is_cut_by_drawing_and_by_typing(browser, address):
    tab = Tab(browser, f"{address}#logs")
    tab.page.locator("li[data-file='flight.ulg'] a", has_text="Cut GPS").click()
    chart = tab.page.locator("svg.chart.drawn")
    chart.locator("polyline").wait_for(state="attached")
    box = chart.bounding_box()
    tab.page.mouse.move(box["x"] + 0.4 * box["width"], box["y"] + 50)
    tab.page.mouse.down()
    tab.page.mouse.move(box["x"] + 0.7 * box["width"], box["y"] + 50, steps=4)
    tab.page.mouse.up()
    tab.page.locator("tbody td:nth-child(2)", has_text=re.compile(r"\d\.\d\d")).wait_for()
    assert "--gps-outage" in tab.page.inner_text("main")
    tab.page.get_by_label("Cut GPS from [s]").fill("3")
    tab.page.get_by_label("Cut GPS to [s]").fill("6")
    tab.page.get_by_role("button", name="Cut", exact=True).press("Enter")
    tab.page.locator("tbody tr:nth-child(2)").wait_for()
    assert tab.page.inner_text("tbody tr:first-child td:first-child") == "3 to 6"
    tab.close(address)


def test_a_damaged_file_is_one_line_in_the_list(browser, address):
    tab = Tab(browser, address)
    torn = {"name": "torn b.ulg", "mimeType": "application/octet-stream", "buffer": b"ULog"}
    tab.page.set_input_files("#choose", torn)
    alert = tab.page.locator("li[data-file='torn b.ulg'] .alert")
    alert.wait_for()
    assert "\n" not in alert.inner_text()
    tab.close(address)


@pytest.mark.parametrize("page", ["logs", "cut", "fly", "certify", "live"])
def test_every_page_fits_a_phone_in_the_dark(browser, address, page):
    tab = Tab(browser, f"{address}#{page}", 390, color_scheme="dark")
    assert tab.page.locator("h1").count() == 1
    assert tab.page.get_attribute("nav a[aria-current]", "href") == f"#{page}"
    tab.close(address)
