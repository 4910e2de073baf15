"""The page's server: who may ask, what is dropped in, the folder, jobs and looks, two tabs, and what is refused."""

from __future__ import annotations

import json
import os
import re
import time
from pathlib import Path

import pytest

from app_desk import BASE, PORT, TOKEN, Page, client_of, desk_of, until
from flownav.app import uploads
from flownav.app.server import STATIC
from flownav.app.shelf import KEPT, Shelf
from flownav.core.errors import InputError


@pytest.fixture
def page(tmp_path):
    with client_of(desk_of(tmp_path)) as client:
        yield Page(client)


# -- who may ask ---------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    "path", ["/", "/api/state", "/wrong/api/state", f"/{TOKEN}x/", "//", "/static/main.js", "/%2e/"]
)
def test_without_the_token_nothing_is_served(page, path):
    answer = page.client.get(path)
    assert answer.status_code == 403
    assert answer.text.count("\n") == 1


@pytest.mark.parametrize("origin", ["http://evil.example", "null", f"https://127.0.0.1:{PORT}", "http://127.0.0.1:1"])
def test_another_page_may_not_ask(page, origin):
    assert page.get("api/state", headers={"origin": origin}).status_code == 403
    assert page.upload("x.ulg", b"x", headers={"origin": origin}).status_code == 403
    assert page.file("x.ulg") is None


def test_its_own_page_may_ask(page):
    for origin in (BASE, f"http://localhost:{PORT}"):
        assert page.get("api/state", headers={"origin": origin}).status_code == 200


@pytest.mark.parametrize("host", ["evil.example", f"evil.example:{PORT}", "127.0.0.1", ""])
def test_another_name_for_this_machine_is_refused(page, host):
    assert page.get("api/state", headers={"host": host}).status_code == 403


def test_a_request_that_another_site_makes_is_refused_but_its_link_is_followed(page):
    fetched = {"sec-fetch-site": "cross-site", "sec-fetch-mode": "no-cors"}
    assert page.get("api/state", headers=fetched).status_code == 403
    assert page.get("", headers={**fetched, "sec-fetch-mode": "navigate"}).status_code == 200


def test_every_answer_is_of_one_page_and_kept_by_nobody(page, tmp_path):
    (tmp_path / "a.html").write_text("<p>x</p>")
    for path in ("", "static/main.js", "api/state"):
        headers = page.get(path).headers
        assert headers["content-security-policy"].startswith("default-src 'none'; script-src 'self'")
        assert headers["referrer-policy"] == "no-referrer"
        assert headers["cache-control"] == "no-store"
    assert page.get("files/a.html").headers["content-security-policy"].startswith("sandbox allow-scripts")
    assert "allow-same-origin" not in page.get("files/a.html").headers["content-security-policy"]


def test_every_module_and_style_that_a_page_names_is_there(page):
    texts = [page.get("").text, *(path.read_text(encoding="utf-8") for path in STATIC.glob("*.js"))]
    names = set(re.findall(r'static/([\w.]+)|"\./([\w.]+)"', " ".join(texts)))
    assert len(names) > 8
    for pair in names:
        answer = page.get(f"static/{''.join(pair)}")
        assert answer.status_code == 200, pair
        assert "://" not in answer.text.replace("http://www.w3.org/2000/svg", ""), "nothing is loaded from elsewhere"
    assert page.get("static/../server.py").status_code in (403, 404)
    assert page.get("static/server.py").status_code == 404


# -- what is dropped in --------------------------------------------------------------------------------------------
def test_a_file_is_written_whole_looked_at_and_numbered(page, tmp_path):
    assert page.upload("a.ulg", b"first").json() == {"name": "a.ulg"}
    assert page.upload("a.ulg", b"second").json() == {"name": "a-1.ulg"}
    assert (tmp_path / "a.ulg").read_bytes() == b"first"
    assert (tmp_path / "a-1.ulg").read_bytes() == b"second"
    assert page.look("a.ulg")["explained"] == "nothing wrong"
    assert sorted(path.name for path in tmp_path.iterdir()) == [KEPT, "a-1.ulg", "a.ulg"]


def test_a_folder_is_one_log(page, tmp_path):
    name = page.post("api/folder", {"name": "log"}).json()["name"]
    for member in ("gps.csv", "flow.csv"):
        assert page.upload(f"{name}/{member}", b"t_s\n1\n").json() == {"name": f"log/{member}"}
    assert page.file("log")["kind"] == "log"
    assert page.file("log")["bytes"] == 12
    assert page.post("api/folder", {"name": "log"}).json() == {"name": "log-1"}


@pytest.mark.parametrize(
    "name", ["", "..", "../x.ulg", "/etc/x", ".hidden", "-rf", "a\nb", "a" * 200, "a/../../x", "C:\\x", " "]
)
def test_a_name_that_leads_elsewhere_is_refused(page, tmp_path, name):
    answer = page.upload(name, b"x")
    assert answer.status_code == 400
    assert "is no name for a file here" in answer.json()["error"]
    with pytest.raises(InputError):
        Shelf(tmp_path).path_of(name)
    assert list(tmp_path.iterdir()) == []


def test_a_link_out_of_the_folder_is_not_followed(page, tmp_path):
    (tmp_path / "out.html").symlink_to("/etc/hostname")
    assert page.get("files/out.html").status_code == 400
    assert page.file("out.html") is None


def test_what_is_too_large_is_refused_before_and_while_it_comes(page, tmp_path, monkeypatch):
    monkeypatch.setattr(uploads, "MOST_BYTES", 1000)
    assert "larger than 500 MB" in page.upload("a.ulg", b"x" * 1001).json()["error"]
    assert "larger than 500 MB" in page.upload("b.ulg", iter([b"x" * 600, b"x" * 600])).json()["error"]
    assert list(tmp_path.iterdir()) == []
    assert page.upload("c.ulg", b"x" * 1000).status_code == 200


def test_a_full_disk_is_one_line(page, tmp_path, monkeypatch):
    monkeypatch.setattr(uploads, "LEAST_FREE_BYTES", 1 << 60)
    assert page.upload("a.ulg", b"x").json() == {"error": "a.ulg: the disk is full; make room, and drop it again"}
    assert list(tmp_path.iterdir()) == []


def test_an_upload_that_breaks_off_leaves_nothing(page, tmp_path):
    answer = page.upload("a.ulg", b"short", headers={"content-length": "10"})
    assert "only 5 of 10 bytes came" in answer.json()["error"]
    assert list(tmp_path.iterdir()) == []


def test_what_was_dropped_in_is_shown_whatever_it_is_called(page, tmp_path):
    (tmp_path / "notes.txt").write_text("of somebody")
    page.upload("log00", b"x")
    assert page.file("log00") is not None
    assert page.file("notes.txt") is None


def test_removing_moves_aside(page, tmp_path):
    page.upload("a.ulg", b"first")
    page.look("a.ulg")
    moved = page.post("api/remove", {"name": "a.ulg"}).json()["moved"]
    assert Path(moved).read_bytes() == b"first"
    assert page.file("a.ulg") is None
    assert page.post("api/remove", {"name": "a.ulg"}).json() == {"error": "a.ulg: is not in the folder any more"}


# -- looks ---------------------------------------------------------------------------------------------------------
def test_a_look_is_kept_until_the_file_changes(page, tmp_path):
    page.upload("a.ulg", b"first")
    page.look("a.ulg")
    with client_of(desk_of(tmp_path)) as again:
        assert Page(again).file("a.ulg")["look"]["explained"] == "nothing wrong"
    (tmp_path / "a.ulg").write_bytes(b"other content")
    assert page.file("a.ulg")["look"] is None


def test_a_damaged_log_is_one_line_without_the_folder(page, tmp_path):
    page.upload("bad.ulg", b"x")
    assert page.look("bad.ulg") == {"error": "bad.ulg: is damaged"}


def test_a_worker_that_ends_is_one_line_and_the_next_one_answers(page):
    page.upload("broken.ulg", b"x")
    assert page.look("broken.ulg") == {"error": "the work was ended before it had an answer"}
    page.upload("a.ulg", b"x")
    assert page.look("a.ulg")["explained"] == "nothing wrong"


def test_a_look_is_cancelled_and_the_next_one_goes_on(page):
    page.upload("slow.ulg", b"x")
    assert page.file("slow.ulg")["looking"]
    page.upload("a.ulg", b"x")
    page.state()
    page.post("api/look", {"name": "slow.ulg", "stop": True})
    assert "was not looked at" in page.look("slow.ulg")["error"]
    assert page.look("a.ulg")["explained"] == "nothing wrong"


# -- jobs ----------------------------------------------------------------------------------------------------------
def test_a_job_is_a_command_whose_words_are_shown(page, tmp_path):
    page.upload("a b.fnr", b"x")
    job = page.post("api/jobs", {"kind": "report", "files": ["a b.fnr"]}).json()
    assert job["command"] == "flownav report 'a b.fnr' --out 'a b.html'"
    done = page.ended(job["number"])
    assert done["state"] == "done"
    assert done["facts"]["words"] == ["report", "a b.fnr", "--out", "a b.html", "--json"]


def test_two_tabs_have_the_same_jobs(page):
    other = Page(page.client)
    page.upload("a.fnr", b"x")
    number = page.post("api/jobs", {"kind": "explain", "files": ["a.fnr"], "autopilot": "px4"}).json()["number"]
    second = other.post("api/jobs", {"kind": "identify", "files": ["a.fnr"]}).json()["number"]
    assert [job["number"] for job in other.state()["jobs"]] == [number, second]
    assert other.ended(number)["command"].endswith("--for px4 --out a-explained.html")
    assert page.ended(second)["state"] == "done"


def test_a_job_that_fails_is_one_line(page):
    page.upload("bad.fnr", b"x")
    job = page.ended(page.post("api/jobs", {"kind": "report", "files": ["bad.fnr"]}).json()["number"])
    assert (job["state"], job["message"], job["facts"]) == ("failed", "bad.fnr: is no record", None)


def test_jobs_are_cancelled_while_they_wait_and_while_they_run(page):
    page.upload("slow.fnr", b"x")
    numbers = [page.post("api/jobs", {"kind": "report", "files": ["slow.fnr"]}).json()["number"] for _ in range(3)]
    until(lambda: [page.job(number)["message"] for number in numbers[:2]] == ["is at work"] * 2)
    assert page.job(numbers[2])["state"] == "queued"
    for number in reversed(numbers):
        page.client.delete(f"/{TOKEN}/api/jobs/{number}")
    assert {page.ended(number)["state"] for number in numbers} == {"cancelled"}
    page.client.delete(f"/{TOKEN}/api/jobs/{numbers[0]}")
    assert page.job(numbers[0])["state"] == "cancelled"


def test_leaving_ends_what_runs(tmp_path):
    desk = desk_of(tmp_path)
    with client_of(desk) as client:
        page = Page(client)
        page.upload("slow.fnr", b"x")
        page.post("api/jobs", {"kind": "report", "files": ["slow.fnr"]})
        until(lambda: page.job(1)["message"] == "is at work")
        process = desk.jobs.all[1].process
    assert process is not None
    with pytest.raises(ProcessLookupError):
        os.kill(process.pid, 0)


@pytest.mark.parametrize(("asked", "said"), [
    ({"kind": "format"}, "format: no such job"),
    ({"kind": "report", "files": []}, "choose 1 file"),
    ({"kind": "report", "files": "a.fnr"}, "choose 1 file"),
    ({"kind": "report", "files": ["gone.fnr"]}, "gone.fnr: is not in the folder any more"),
    ({"kind": "report", "files": ["../x.fnr"]}, "'../x.fnr': is no name for a file here"),
    ({"kind": "compare", "files": ["a.fnr"]}, "choose 2 files"),
    ({"kind": "explain", "files": ["a.fnr"], "autopilot": "--out"}, "px4, ardupilot or inav are possible"),
    ({"kind": "fly", "scenario": "--json"}, "is none of the choices"),
    ({"kind": "fly", "scenario": "landing", "seed": "1;rm"}, "a whole number"),
    ({"kind": "campaign", "flights": 0}, "a whole number from 1 to"),
    ({"kind": "campaign", "folder": "../x"}, "is no name for a file here"),
])  # fmt: skip
def test_what_cannot_be_is_one_line(page, asked, said):
    page.upload("a.fnr", b"x")
    answer = page.post("api/jobs", asked)
    assert answer.status_code == 400
    assert said in answer.json()["error"]
    assert page.state()["jobs"] == []


def test_what_is_no_object_is_one_line(page):
    for body in (b"[]", b"{", b"x" * (2 << 20)):
        answer = page.client.post(f"/{TOKEN}/api/jobs", content=body)
        assert answer.status_code == 400
        assert list(answer.json()) == ["error"]


def test_a_question_is_answered_with_the_command_that_does_the_same(page):
    page.upload("a.ulg", b"x")
    asked = {"what": "cut", "file": "a.ulg", "cuts": [[10.5, 20]], "flow": False, "flow_scale": [1, 0.5]}
    answer = page.post("api/ask", asked).json()
    assert answer["command"] == (
        "flownav replay a.ulg --gps-outage 10.5:20 --no-flow --flow-scale 1,0.5 --out a-replayed.fnr"
    )
    flown = page.post("api/ask", {"what": "fly", "scenario": "landing", "wind": "4:270", "gps": "midg", "seed": 3})
    assert flown.json()["command"] == "flownav fly landing --seed 3 --gps midg --wind 4:270 --out landing.fnr"
    assert page.post("api/ask", {"what": "look", "file": "a.ulg"}).json() == {"error": "no such question"}


def test_the_state_is_json_whatever_files_are_called(page, tmp_path):
    (tmp_path / "<img src=x onerror=alert(1)>.ulg").write_bytes(b"x")
    names = [each["name"] for each in json.loads(page.get("api/state").text)["files"]]
    assert names == ["<img src=x onerror=alert(1)>.ulg"]
    assert time.time() - page.state()["files"][0]["written_s"] < 3600.0


# -- a requirement of one's own ------------------------------------------------------------------------------------
ASKED = {"scenario": "approach", "measure": "touchdown.rest_m", "at_most": 0.5, "probability": 0.95, "confidence": 0.9,
         "wind_m_s": 4}  # fmt: skip


def test_a_form_is_a_requirement_that_certify_reads(page, tmp_path):
    from flownav.campaigns.requirement import load_requirement

    name = page.post("api/requirement", ASKED).json()["name"]
    found = load_requirement(str(tmp_path / name))
    assert (found.scenario, found.requirement[0].measure) == ("approach", "touchdown.rest_m")
    assert (found.requirement[0].at_most, found.requirement[0].probability) == (0.5, 0.95)
    assert page.post("api/requirement", ASKED).json()["name"] == name
    assert page.post("api/requirement", {**ASKED, "at_most": 0.4}).json()["name"] != name
    job = page.post("api/jobs", {"kind": "certify", "requirement": name, "plan": True}).json()
    assert job["command"] == f"flownav certify {name} --plan"


@pytest.mark.parametrize("wrong", [
    {"measure": "crash.x"}, {"measure": None}, {"at_most": "x"}, {"probability": 2}, {"confidence": -1},
    {"wind_m_s": 99}, {"scenario": "../x"},
])  # fmt: skip
def test_a_form_that_cannot_be_is_one_line(page, tmp_path, wrong):
    answer = page.post("api/requirement", {**ASKED, **wrong})
    assert answer.status_code == 400
    assert "\n" not in answer.json()["error"]
    assert list(tmp_path.iterdir()) == []
