"""The Live page: a session begun and ended on it, its state as it is shown, and a recorded vehicle in flight."""

from __future__ import annotations

import json
import os
import re
import time

import pytest

from app_desk import TOKEN, Page, client_of, desk_of, until
from app_pages import Tab, served
from flownav.app.sessions import sessions_in
from flownav.core.record import Record
from live_process import free_port
from live_states import FRESH_S, STATE, Written
from played_link import PlayedLink


@pytest.fixture
def page(tmp_path):
    with client_of(desk_of(tmp_path)) as client:
        yield Page(client)


# -- the server ----------------------------------------------------------------------------------------------------
def test_a_form_is_a_command_with_its_record_and_its_state(page, tmp_path):
    asked = {"kind": "live", "url": "serial:/dev/ttyACM0:115200", "send": "odometry", "gps_delay": 0.2, "send_limit": 2,
             "send_protection": 8.5, "sensor": "x-sensor.toml"}  # fmt: skip
    job = page.post("api/jobs", asked).json()
    assert job["command"] == (
        "flownav live serial:/dev/ttyACM0:115200 --send odometry --sensor x-sensor.toml --gps-delay 0.2 --send-limit 2 "
        "--send-protection 8.5 --record flight.fnr --status flight.live.json"
    )
    assert job["writes"] == "flight.fnr"
    least = page.post("api/jobs", {"kind": "live", "url": "udp:14550"}).json()
    assert least["command"].startswith("flownav live udp:14550 --send none --record ")


@pytest.mark.parametrize("there", ["flight.fnr", "flight.fnr.journal", "flight.live.json"])
def test_a_session_has_a_name_that_nothing_of_another_has(page, tmp_path, there):
    (tmp_path / there).write_text("x")
    job = page.post("api/jobs", {"kind": "live", "url": "udp:14550"}).json()
    assert job["command"].endswith("--record flight-1.fnr --status flight-1.live.json")


@pytest.mark.parametrize(("asked", "line"), [
    ({"url": ""}, "is no link; give one such as"), ({"url": "--json"}, "is no link"),
    ({"url": "udp:1 2"}, "is no link"),
    ({"url": "file:/etc/passwd"}, "is no link"), ({"url": "udp:1", "send": "--x"}, "none, odometry, vision"),
    ({"url": "udp:1", "gps_delay": 2}, "from 0 to 1"), ({"url": "udp:1", "sensor": "--x"}, "is none of the choices"),
])  # fmt: skip
def test_a_session_that_cannot_be_is_one_line(page, asked, line):
    answer = page.post("api/jobs", {"kind": "live", **asked})
    assert answer.status_code == 400
    assert line in answer.json()["error"]
    assert page.state()["jobs"] == []


def test_a_session_waits_for_no_job_and_ends_with_its_facts(page):
    page.upload("slow.fnr", b"x")
    slow = [page.post("api/jobs", {"kind": "report", "files": ["slow.fnr"]}).json()["number"] for _ in range(2)]
    until(lambda: [page.job(number)["message"] for number in slow] == ["is at work"] * 2)
    number = page.post("api/jobs", {"kind": "live", "url": "udp:14550"}).json()["number"]
    until(lambda: page.job(number)["message"] == "is at work")
    page.client.delete(f"/{TOKEN}/api/jobs/{number}")
    done = page.ended(number)
    assert (done["state"], done["facts"]["sent"]) == ("done", 7)
    assert [page.job(each)["state"] for each in slow] == ["running"] * 2


def test_leaving_the_page_lets_a_session_write_its_record(tmp_path):
    desk = desk_of(tmp_path)
    with client_of(desk) as client:
        page = Page(client)
        page.post("api/jobs", {"kind": "live", "url": "udp:14550"})
        until(lambda: page.job(1)["message"] == "is at work")
    assert (desk.jobs.all[1].state, desk.jobs.all[1].facts) == ("done", {"schema": 1, "sent": 7})


def test_the_sessions_of_the_folder_are_those_whose_state_lies_there(page, tmp_path):
    assert page.get("api/live").json() == {"sessions": []}
    page.post("api/jobs", {"kind": "live", "url": "udp:14550"})
    (tmp_path / "flight.live.json").write_text(json.dumps(STATE))
    (tmp_path / "other.live.json").write_text(json.dumps({**STATE, "url": "udp:1"}))
    os.utime(tmp_path / "other.live.json", (time.time() - 30.0,) * 2)
    for name, text in (("a", "{"), ("b", "[]"), ("c", "{}"), ("d", '{"live_status": 2}'), ("e", "[" * 100_000)):
        (tmp_path / f"{name}.live.json").write_text(text)
    (tmp_path / "f.live.json").symlink_to(tmp_path / "flight.live.json")
    found = page.get("api/live").json()["sessions"]
    assert [(each["name"], each["job"]) for each in found] == [("flight.live.json", 1), ("other.live.json", None)]
    assert found[0]["state"] == STATE
    assert found[0]["age_s"] < 20.0
    assert 30.0 <= found[1]["age_s"] < 60.0
    assert [each["job"] for each in sessions_in(tmp_path, {})] == [None, None]


def test_a_simulated_vehicle_flies_for_a_port_of_this_machine(page):
    job = page.post("api/jobs", {"kind": "vehicle", "port": 14551}).json()
    assert job["command"] == ("flownav fly pad_return --mavlink udpout:127.0.0.1:14551 --no-report --out simulated.fnr")
    assert "a whole number" in page.post("api/jobs", {"kind": "vehicle", "port": "1:2"}).json()["error"]


# -- in the browser ------------------------------------------------------------------------------------------------
@pytest.fixture
def served_folder(tmp_path):
    with served(desk_of(tmp_path)) as address:
        yield tmp_path, f"{address}#live"


def alarm_of(tab):
    return tab.page.locator("section.session [role=alert]")


@pytest.mark.browser
def test_a_withheld_estimate_is_a_big_red_reason_and_a_sent_one_is_not(browser, served_folder):
    folder, address = served_folder
    session, tab = Written(folder), Tab(browser, address)
    session.state(FRESH_S, reason="stale", why="the newest reading is too old", quality_percent=None)
    alarm = alarm_of(tab)
    alarm.filter(has_text="Nothing is sent: the newest reading is too old.").wait_for()
    box = alarm.bounding_box()
    style = alarm.evaluate("(node) => [getComputedStyle(node).backgroundColor, getComputedStyle(node).fontSize]")
    assert style == ["rgb(184, 35, 42)", "26px"]
    assert box["y"] + box["height"] < 850, "it is in sight without scrolling"
    assert "For 4 s." in tab.page.inner_text("section.session")
    assert tab.page.locator("circle.place.withheld").count() == 1
    session.state(FRESH_S)
    alarm.filter(has_text="The estimate is sent.").wait_for()
    assert alarm.get_attribute("class") == "sends"
    tiles = tab.page.inner_text("dl.tiles")
    for figure in ("73 %", "1.50 m", "5.00 m", "0.50 m", "0.50 m/s", "1234"):
        assert figure in tiles
    session.state(FRESH_S, reason="uncertain", why="the position's standard deviation is too large", velocity_only=True)
    alarm.filter(has_text="Only the velocity is sent: the position's standard deviation is too large.").wait_for()
    session.state(FRESH_S, listens=True, send="none")
    alarm.filter(has_text="It only listens; the estimate could be sent.").wait_for()
    session.state(FRESH_S, alarms=["ALARM: gps_position is received and has not been fused for 6 s (gate)"])
    alarm.filter(has_text="ALARM: gps_position").wait_for()
    assert alarm.get_attribute("class") == "reason"
    tab.close(address)


@pytest.mark.browser
def test_the_path_is_drawn_to_scale_and_red_where_nothing_was_sent(browser, served_folder):
    folder, address = served_folder
    Written(folder).state(FRESH_S)
    tab = Tab(browser, address)
    tab.page.locator("section.session svg.map").wait_for()
    lines = tab.page.locator("section.session svg.map polyline")
    assert [lines.nth(k).get_attribute("class") for k in range(lines.count())] == ["withheld", "estimate"]
    level, place = (tab.page.locator(f"section.session circle.{name}") for name in ("level", "place"))
    assert level.get_attribute("cx") == place.get_attribute("cx")
    bar = tab.page.locator("section.session line.bar")
    length = float(bar.get_attribute("x2")) - float(bar.get_attribute("x1"))
    metres = float(re.search(r"(\d+) m", tab.page.text_content("section.session svg.map"))[1])
    assert float(level.get_attribute("r")) / 1.5 == pytest.approx(length / metres, rel=1e-3)
    pad = tab.page.locator("section.session rect.pad")
    north = float(pad.get_attribute("y")) + 6.0 - float(place.get_attribute("cy"))
    assert north == pytest.approx(3.0 * length / metres, rel=1e-3), "the pad is south of the vehicle, below it"
    tab.close(address)


@pytest.mark.browser
def test_a_protection_level_is_a_whole_circle_or_a_figure_where_it_is_wider_than_the_picture(browser, served_folder):
    folder, address = served_folder
    session, tab = Written(folder), Tab(browser, address)
    session.state(FRESH_S, protection_m=[9.0, 1.0])  # the path spans 4 m
    circle = tab.page.locator("section.session circle.level")
    circle.wait_for()
    x, y, radius = (float(circle.get_attribute(name)) for name in ("cx", "cy", "r"))
    assert min(x, y) - radius > 0.0
    assert max(x, y) + radius < 420.0
    session.state(FRESH_S, protection_m=[60.0, 1.0])
    tab.page.get_by_text("the protection level, 60 m about the vehicle, is wider than the picture").wait_for()
    assert circle.count() == 0
    tab.close(address)


@pytest.mark.browser
def test_a_session_that_falls_silent_and_one_that_ends(browser, served_folder):
    folder, address = served_folder
    session, tab = Written(folder), Tab(browser, address, 390, color_scheme="dark")
    session.state(30.0)
    alarm = alarm_of(tab)
    alarm.filter(has_text="There is no news from the session.").wait_for()
    assert alarm.get_attribute("class") == "reason"
    assert "flownav recover flight.fnr.journal" in tab.page.inner_text("section.session")
    assert tab.page.evaluate("document.documentElement.scrollWidth") <= 390
    session.path.unlink()
    tab.page.locator("section.session").wait_for(state="detached")
    tab.close(address)


@pytest.mark.browser
def test_a_session_is_begun_and_stopped_with_the_keyboard_and_is_there_after_a_reload(browser, served_folder):
    folder, address = served_folder
    tab = Tab(browser, address)
    tab.page.get_by_label("Link to the vehicle").fill("tcp:127.0.0.1:5762")
    tab.page.get_by_label("What is sent to the vehicle").select_option("vision")
    tab.page.get_by_role("button", name="Start", exact=True).press("Enter")
    tab.page.locator("li.job.running").wait_for()
    assert "flownav live tcp:127.0.0.1:5762 --send vision --gps-delay 0.22" in tab.page.inner_text("li.job")
    Written(folder).state(FRESH_S)
    tab.page.get_by_role("button", name="Stop the session").wait_for()
    tab.page.reload()
    tab.ready()
    other = Tab(browser, address)
    other.page.get_by_role("button", name="Stop the session").press("Enter")
    tab.page.locator("li.job.done").wait_for()
    for each in (tab, other):
        each.close(address)


@pytest.mark.browser
@pytest.mark.real_time
def test_a_recorded_vehicle_is_navigated_shown_and_kept_as_a_record(browser, data_folder, tmp_path):
    port = free_port()
    with served(desk_of(tmp_path, real=True)) as address:
        tab = Tab(browser, f"{address}#live")
        tab.page.get_by_label("Link to the vehicle").fill(f"udp:{port}")
        tab.page.get_by_label("What is sent to the vehicle").select_option("odometry")
        tab.page.get_by_role("button", name="Start", exact=True).click()
        alarm = alarm_of(tab)
        alarm.filter(has_text="Nothing is sent: no autopilot's HEARTBEAT is received.").wait_for()
        with PlayedLink(data_folder / "ardupilot-live" / "square", port, 40.0):
            alarm.filter(has_text="The estimate is sent.").wait_for()
            tab.page.locator("section.session polyline.estimate").wait_for(state="attached")
            tab.page.locator("dl.tiles", has_text=re.compile(r"\d+ %")).wait_for()
            assert "Vehicle 1.1" in tab.page.inner_text("section.session h2")
        alarm.filter(has_text="Nothing is sent: the newest reading is too old.").wait_for()
        tab.page.get_by_role("button", name="Stop the session").click()
        tab.page.locator("li.job.done").wait_for()
        assert "estimates sent" in tab.page.inner_text("li.job.done")
        tab.page.locator("section.session").wait_for(state="detached")
        record = Record.load(tmp_path / "flight.fnr")
        assert record.manifest["live"]["sent"] > 10
        assert not list(tmp_path.glob("*.live.json"))
        tab.page.goto(f"{address}#logs")
        tab.page.locator("li[data-file='flight.fnr'] .verdict").wait_for()
        tab.close(address)
