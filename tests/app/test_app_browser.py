"""The page in headless Chromium: logs dropped in and cut; cancel, reload, a closed browser; other origins."""

from __future__ import annotations

import functools
import http.server
import json
import re
import threading

import pytest

from app_desk import TOKEN, desk_of, until
from app_pages import Tab, served
from blackbox_logs import blackbox_log, quantised
from command import run
from crazyflie_logs import deck_log
from crazyflie_logs import quantised as deck_tables
from dataflash_files import dataflash_of
from mavlink_logs import flight_log
from replay_logs import log_of_flight
from ros_bags import ros_flight
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


# -- what is dropped in --------------------------------------------------------------------------------------------
def row_of(tab, name):
    return tab.page.locator(f"li[data-file='{name}']")


def test_a_log_of_each_format_is_dropped_in_at_once_and_has_a_verdict_each(browser, address, tmp_path):
    flown = log_of_flight(20.0)
    files = {
        "each.ulg": ulog_of_flight(flown.tables).bytes(),
        "each.bin": dataflash_of(flown).content(),
        "each.bbl": blackbox_log(quantised(flown.tables, inav=True), inav=True).content(),
        "each00": deck_log(deck_tables(flown.tables)).content(),
        "each.tlog": flight_log(6.0).content,
        "each.bag": ros_flight(flown.tables).write_ros_1(tmp_path / "x.bag").read_bytes(),
    }
    tab = Tab(browser, f"{address}#logs")
    kind = "application/octet-stream"
    dropped = [{"name": name, "mimeType": kind, "buffer": content} for name, content in files.items()]
    tab.page.set_input_files("#choose", dropped)
    for name in files:
        row_of(tab, name).locator(".verdict").first.wait_for()
        assert row_of(tab, name).locator("svg.thumbnail polyline").count() == 1
    flown.write(tmp_path / "csv")
    tab.page.set_input_files("#choose-folder", tmp_path / "csv")
    row_of(tab, "csv").locator(".verdict").first.wait_for()
    tab.close(address)


def test_sixty_megabytes_come_whole(browser, address, folder, tmp_path):
    """A log, and behind it a message that no reader knows, over and over."""
    log = ulog_of_flight(log_of_flight(20.0).tables).bytes()
    unknown = (60_000).to_bytes(2, "little") + b"?" + bytes(60_000)
    path = tmp_path / "large.ulg"
    path.write_bytes(log + unknown * 1000)
    assert path.stat().st_size > 60e6
    tab = Tab(browser, f"{address}#logs")
    tab.page.set_input_files("#choose", path)
    tab.page.locator("li[data-file='large.ulg'] .verdict").wait_for()
    assert (folder / "large.ulg").read_bytes() == path.read_bytes()
    tab.page.get_by_role("button", name="Remove large.ulg").click()
    tab.page.locator("li[data-file='large.ulg']").wait_for(state="detached")
    tab.close(address)


def slow_upload(tab, path):
    """Choose a file for a link of 200 kB/s."""
    session = tab.context.new_cdp_session(tab.page)
    slow = {"offline": False, "latency": 0, "downloadThroughput": -1, "uploadThroughput": 200_000}
    session.send("Network.enable")
    session.send("Network.emulateNetworkConditions", slow)
    tab.page.set_input_files("#choose", path)
    tab.page.locator("ul.uploads progress").wait_for()


@pytest.mark.parametrize("leaves", ["cancel", "reload", "close"])
def test_an_upload_that_is_cancelled_or_left_leaves_nothing(browser, address, folder, tmp_path, leaves):
    path = tmp_path / f"{leaves}.ulg"
    path.write_bytes(b"x" * 30_000_000)
    tab = Tab(browser, f"{address}#logs")
    slow_upload(tab, path)
    until(lambda: any(folder.glob(f".{leaves}*.part")))
    if leaves == "cancel":
        tab.page.locator("ul.uploads").get_by_role("button", name="Cancel").press("Enter")
        tab.page.locator("ul.uploads li").wait_for(state="detached")
        tab.close(address)
    elif leaves == "reload":
        tab.page.reload()
        tab.ready()
        tab.close(address)
    else:
        tab.context.close()
    until(lambda: not any(folder.glob(f".{leaves}*")))
    assert not (folder / path.name).exists()


# -- jobs ----------------------------------------------------------------------------------------------------------
def test_a_job_is_cancelled_by_the_keyboard_alone(browser, address):
    tab = Tab(browser, f"{address}#fly")
    many = tab.page.get_by_role("button", name="Fly 200")
    many.focus()
    tab.page.keyboard.press("Enter")
    stop = tab.page.locator("main").get_by_role("button", name="Stop")
    stop.wait_for()
    stop.focus()
    tab.page.keyboard.press("Space")
    tab.page.locator("li.job.cancelled").wait_for()
    tab.close(address)


def test_the_pages_are_walked_through_with_tab_and_enter(browser, address):
    tab = Tab(browser, f"{address}#logs")
    tab.page.keyboard.press("Tab")
    assert tab.page.evaluate("document.activeElement.textContent") == "Skip to the content"
    for name in ("Logs", "Cut GPS", "Fly", "Certify", "Live"):
        tab.page.keyboard.press("Tab")
        assert tab.page.evaluate("document.activeElement.textContent") == name
        outline = tab.page.evaluate("getComputedStyle(document.activeElement).outlineStyle")
        assert outline == "solid", "who tabs sees where"
        tab.page.keyboard.press("Enter")
        tab.page.locator("nav a[aria-current]", has_text=name).wait_for()
        tab.page.locator("h1").wait_for()
    tab.close(address)


def flights_of(tab):
    """How many flights the campaign that is shown has flown, and is to fly."""
    found = tab.page.locator("main [role=status]", has_text=re.compile(r"\d+ of \d+ flights, \d+ landed"))
    return tuple(map(int, re.search(r"(\d+) of (\d+) flights", found.inner_text()).groups()))


def test_a_campaign_outlives_the_browser_goes_on_after_a_stop_and_is_the_command_lines(browser, address, folder):
    tab = Tab(browser, f"{address}#fly")
    before = set(folder.glob("landing_campaign*"))
    tab.page.get_by_role("button", name="Fly 200").click()
    tab.page.locator("li.job.running").wait_for()
    (campaign,) = until(lambda: {path for path in folder.glob("landing_campaign*") if path.is_dir()} - before)
    tab.context.close()
    until(lambda: list(campaign.rglob("*.parquet")))  # it flies on without anybody looking
    back = Tab(browser, f"{address}#fly/{campaign.name}")
    stop = back.page.locator("main").get_by_role("button", name="Stop")
    go_on = back.page.locator("main").get_by_role("button", name="Go on")
    ended = back.page.get_by_role("link", name="Open the campaign's page")
    stop.or_(go_on).or_(ended).wait_for()
    if stop.count():
        stop.click()
        go_on.or_(ended).wait_for()  # it may have ended before the stop reached it
        flown, planned = flights_of(back)
        assert 0 < flown <= planned == 200
        if go_on.count():
            go_on.click()
    ended.wait_for()
    assert flights_of(back) == (200, 200)
    assert back.page.locator("main figure.picture svg").count() >= 1
    back.close(address)
    done = run("campaign", "landing", "--flights", 200, "--seed", 1, "--set", "wind.speed_20ft_m_s=4", "--set",
               "wind.from_direction_deg=270", "--out", campaign.name, "--json", cwd=folder)  # fmt: skip
    assert done.returncode == 0, done.stderr
    facts = json.loads(done.stdout)
    assert facts["flights"] == 200


def test_a_small_requirement_is_flown_and_judged_to_its_certificate(browser, address, folder):
    tab = Tab(browser, f"{address}#certify")
    tab.page.get_by_label("Requirement").select_option("")
    tab.page.get_by_label("Scenario").select_option("pad_return")
    tab.page.get_by_label("at most").fill("5")
    tab.page.get_by_label("with probability [%]").fill("80")
    tab.page.get_by_label("shown with confidence [%]").fill("80")
    tab.page.get_by_role("button", name="Fly and judge").click()
    tab.page.get_by_role("link", name="Open the certificate").wait_for()
    assert tab.page.inner_text("main p.big") == "pass"
    place = tab.page.get_by_role("link", name="Open the certificate").get_attribute("href")
    assert (folder / place.removeprefix("files/")).is_file()
    tab.close(address)


# -- who may ask ---------------------------------------------------------------------------------------------------
class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *parts):
        """Nothing."""


@pytest.fixture
def elsewhere(tmp_path):
    """Another page, of another origin, on this machine."""
    (tmp_path / "index.html").write_text("<!doctype html><title>elsewhere</title>")
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=tmp_path))
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}/"
    server.shutdown()
    thread.join()
    server.server_close()


def test_a_page_of_another_origin_reads_and_writes_nothing_even_with_the_token(browser, address, folder, elsewhere):
    context = browser.new_context()
    page = context.new_page()
    page.goto(elsewhere)
    asked = """async ([path, options]) => {
      try {
        const answer = await fetch(path, options);
        return `${answer.type} ${answer.status}`;
      } catch { return "refused"; }
    }"""
    assert page.evaluate(asked, [f"{address}api/state", {}]) == "refused"
    assert page.evaluate(asked, [f"{address}api/upload?name=evil.ulg", {"method": "PUT", "body": "x"}]) == "refused"
    blind = {"method": "POST", "mode": "no-cors", "body": '{"kind": "fly"}'}
    assert page.evaluate(asked, [f"{address}api/jobs", blind]) in ("opaque 0", "refused")
    framed = """(address) => new Promise((done) => {
      const frame = document.createElement("iframe");
      frame.onload = () => done(frame.contentDocument === null);
      frame.src = address;
      document.body.append(frame);
    })"""
    assert page.evaluate(framed, address)
    context.close()
    assert not (folder / "evil.ulg").exists()
    assert not (folder / "landing.fnr").exists()


def test_without_the_token_the_browser_is_told_what_to_open(browser, address):
    context = browser.new_context()
    page = context.new_page()
    for wrong in (address.replace(TOKEN, "token-of-nobody"), address.replace(f"{TOKEN}/", "")):
        answer = page.goto(wrong)
        assert answer.status == 403
        assert page.inner_text("body").strip() == (
            "flownav: the token is missing; open the address that flownav app printed"
        )
    context.close()
