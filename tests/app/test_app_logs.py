"""Logs of every format through the page, with flownav's own worker and commands: looks, cuts, flights, jobs."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest

from app_desk import Page, client_of, desk_of, until
from blackbox_logs import blackbox_log, quantised
from crazyflie_logs import deck_log
from crazyflie_logs import quantised as deck_tables
from dataflash_files import dataflash_of
from flownav.app.shelf import Shelf
from flownav.app.tasks import task_of
from flownav.campaigns.requirement import load_requirement
from flownav.core.record import Record
from mavlink_logs import flight_log
from replay_logs import log_of_flight
from ros_bags import ros_flight
from ulog_files import ulog_of_flight

LASTS_S = {"log.tlog": 6.0}  # of a hover; the others 30 s


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("app")


@pytest.fixture(scope="module")
def page(folder):
    with client_of(desk_of(folder, real=True)) as client:
        yield Page(client)


@pytest.fixture(scope="module")
def flown():
    return log_of_flight(30.0)


def content_of(name: str, flown, tmp_path: Path) -> bytes:
    """A small log of a format, as a file."""
    if name == "log.ulg":
        return ulog_of_flight(flown.tables).bytes()
    if name == "log.bin":
        return dataflash_of(flown).content()
    if name == "log.bbl":
        return blackbox_log(quantised(flown.tables, inav=True), inav=True).content()
    if name == "log00":
        return deck_log(deck_tables(flown.tables)).content()
    if name == "log.tlog":
        return flight_log(LASTS_S[name]).content
    if name == "log.bag":
        return ros_flight(flown.tables).write_ros_1(tmp_path / "x.bag").read_bytes()
    Record({"kind": "fly"}).save(tmp_path / "x.fnr")
    return (tmp_path / "x.fnr").read_bytes()


WRITTEN_BY = {"log.ulg": "px4", "log.bin": "ardupilot"}


@pytest.mark.parametrize("name", ["log.ulg", "log.bin", "log.bbl", "log.tlog", "log.bag", "log00"])
def test_a_log_of_each_format_has_a_verdict_and_a_path(page, flown, tmp_path, name):
    assert page.upload(name, content_of(name, flown, tmp_path)).json() == {"name": name}
    look = page.look(name)
    assert "error" not in look, look
    assert look["explained"]
    assert look["end_s"] - look["start_s"] == pytest.approx(LASTS_S.get(name, 30.0), abs=2.0)
    assert len(look["path"]) > 20
    assert look["autopilot"] == WRITTEN_BY.get(name, "")


def test_identify_writes_the_parameters_of_the_logs_own_autopilot_or_of_the_chosen_one(tmp_path):
    shelf = Shelf(tmp_path)
    for name, look in (("a.fnr", {"autopilot": "inav"}), ("b.fnr", {"autopilot": ""}), ("c.fnr", None)):
        (tmp_path / name).write_bytes(b"x")
        if look is not None:
            shelf.keep_look(tmp_path / name, look)

    def whose(name: str, **asked: str) -> list[str]:
        words = task_of("identify", {"files": [name], **asked}, shelf).words
        return [word for before, word in pairwise(words) if before == "--for"]

    assert whose("a.fnr") == whose("a.fnr", autopilot="") == ["inav"]
    assert whose("a.fnr", autopilot="px4") == whose("b.fnr", autopilot="px4") == ["px4"]
    assert whose("b.fnr") == whose("c.fnr") == []


def test_a_folder_of_csv_files_is_looked_at(page, flown, tmp_path):
    flown.write(tmp_path / "log")
    for path in sorted((tmp_path / "log").iterdir()):
        page.upload(f"csv/{path.name}", path.read_bytes())
    page.post("api/look", {"name": "csv"})
    look = until(lambda: (found := page.look("csv")) and "gps_position" in found.get("sensors", []) and found)
    assert look["replayable"]
    assert look["has_gps"]


def test_a_damaged_log_and_a_record_of_nothing_are_one_line_each(page, flown, tmp_path):
    for name, content in (("torn.ulg", b"ULog"), ("none.fnr", content_of("none.fnr", flown, tmp_path))):
        page.upload(name, content)
        error = page.look(name)["error"]
        assert error.startswith(f"{name}: ")
        assert "\n" not in error


def test_a_cut_is_what_replay_says_and_nothing_is_cut_twice(page, flown, tmp_path):
    page.upload("cut.ulg", ulog_of_flight(flown.tables).bytes())
    asked = {"what": "cut", "file": "cut.ulg", "cuts": []}
    whole = page.post("api/ask", asked).json()
    cut = page.post("api/ask", {**asked, "cuts": [[10, 20]]}).json()
    again = page.post("api/ask", asked).json()
    assert again == whole
    assert whole["outages"] == []
    assert len(whole["path"]) > 20
    job = page.post("api/jobs", {"kind": "replay", "files": ["cut.ulg"], "cuts": [[10, 20]]}).json()
    done = page.ended(job["number"])
    assert done["facts"] is not None, done["message"]
    kept = done["facts"]["outages"][0]
    for name in ("horizontal_rms_m", "horizontal_max_m"):
        assert cut["outages"][0][name] == pytest.approx(kept[name], rel=1e-12)
    assert page.get(f"files/{done['facts']['report']}").status_code == 200
    assert page.file(done["facts"]["record"])["kind"] == "record"


def test_without_flow_or_with_flow_scaled_the_drift_is_another(page, flown):
    page.upload("scaled.ulg", ulog_of_flight(flown.tables).bytes())
    asked = {"what": "cut", "file": "scaled.ulg", "cuts": [[10, 25]]}
    found = [page.post("api/ask", {**asked, **more}).json()["outages"][0]["horizontal_rms_m"]
             for more in ({}, {"flow": False}, {"flow_scale": [0.5, 0.5]})]  # fmt: skip
    assert len(set(found)) == 3


def test_a_cut_outside_the_log_is_one_line(page, flown):
    page.upload("out.ulg", ulog_of_flight(flown.tables).bytes())
    answer = page.post("api/ask", {"what": "cut", "file": "out.ulg", "cuts": [[500, 600]]})
    assert answer.status_code == 400
    assert "500" in answer.json()["error"]


def test_a_flight_is_drawn_and_the_wind_moves_it(page):
    asked = {"what": "fly", "scenario": "landing", "seed": 1, "wind": "2:270"}
    found = [page.post("api/ask", {**asked, **more}).json() for more in ({}, {"wind": "6:90"}, {})]
    assert found[0]["svg"].startswith("<div")
    assert found[0]["svg"] == found[2]["svg"]
    assert found[0]["svg"] != found[1]["svg"]
    assert "Wind of 6" in found[1]["words"]


def test_a_campaign_has_a_cloud_and_goes_on_in_its_folder(page, folder):
    asked = {"kind": "campaign", "scenario": "landing", "flights": 24, "seed": 1, "wind": "3:90"}
    job = page.post("api/jobs", asked).json()
    done = page.ended(job["number"])
    assert done["state"] == "done", done["message"]
    cloud = page.post("api/ask", {"what": "cloud", "file": done["writes"]}).json()
    assert (cloud["flights"], cloud["planned"]) == (24, 24)
    summary = done["facts"]["cells"][0]["figures"]["r95_m"]["value"]
    assert cloud["r95_m"] == pytest.approx(summary, rel=1e-12)
    assert "R95" in cloud["words"]
    more = page.post("api/jobs", {**asked, "flights": 32, "folder": done["writes"]}).json()
    assert page.ended(more["number"])["facts"]["flights"] == 32
    assert page.file(done["writes"])["kind"] == "campaign"


def test_the_time_of_a_certificate_counts_all_flights_that_certify_flies(page, folder):
    """Those of the plan, 64 that are flown again, and the ranking, a sample of which has 64 for each input and more."""
    small, large = (
        page.post("api/requirement", {"scenario": "landing", "measure": "touchdown.rest_m", "at_most": 5.0,
                                      "probability": share, "confidence": 0.9}).json()["name"]
        for share in (0.8, 0.99)
    )  # fmt: skip
    paces = [page.post("api/ask", {"what": "pace", "requirement": name}).json() for name in (small, large)]
    plans = [load_requirement(str(folder / name)).flights() for name in (small, large)]
    assert paces[1]["flights"] - paces[0]["flights"] == plans[1] - plans[0] > 400
    ranked = paces[0]["flights"] - plans[0] - 64
    assert ranked % 64 == 0
    assert ranked > 64 * 10
    assert min(one["seconds"] for one in paces) >= 1


@pytest.mark.parametrize("name", ["absent.toml", "../x.toml", "--x", "no_such"])
def test_the_time_of_a_requirement_that_is_none_is_one_line(page, name):
    answer = page.post("api/ask", {"what": "pace", "requirement": name})
    assert answer.status_code == 400
    assert "\n" not in answer.json()["error"]
