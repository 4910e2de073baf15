"""How the pages look, filled with long names and figures: on a phone and a wide screen, in light and in dark."""

from __future__ import annotations

import json
import sys

import numpy as np
import pytest

from app_pages import Tab, served
from flownav.app.desk import Desk
from flownav.app.shelf import Shelf
from flownav.report.campaign_figures import Touchdowns
from flownav.report.cloud_picture import cloud_picture
from flownav.report.landing import landing_picture
from flownav.report.style import PALETTE
from live_states import FRESH_S, Written
from page_looks import answers, complaints, ground_of, rgb
from report_records import navigated

pytestmark = pytest.mark.browser

LOG = "log_17_2026-11-28-14-55-02_a-name-that-is-longer-than-a-phone-is-wide.ulg"
WORDS = "The barometer changes by -2.0 m when the rotors run: it stands in their wash. (6 to 91 s; 87 % sure)"
T_S = np.linspace(0.0, 849.0, 200)
PATH = np.column_stack([30.0 * np.sin(T_S / 40.0), 20.0 * np.cos(T_S / 60.0)]).tolist()
LOOK = {
    "explained": WORDS, "verdict": "flow and GPS agree in shape, not in size and time: the flow reads 12 % too little",
    "causes": ["baro_wash"], "warnings": ["gps_position: 3 readings are repeated and left out", "none above 8 m"],
    "obstacles": [], "replayable": True, "start_s": 0.0, "end_s": 849.0, "notes": [], "has_gps": True, "fed": False,
    "autopilot": "px4", "sensors": ["attitude", "imu", "flow_rate", "range", "baro", "gps_velocity", "gps_position"],
    "path": PATH, "path_of": "GPS",
}  # fmt: skip
CUT = {
    "span_s": [0.0, 849.0], "against": "the simulator", "path": PATH, "gps": PATH,
    "outages": [{"t0": 60, "t1": 120.5, "horizontal_rms_m": 0.74, "horizontal_max_m": 12.25}],
    "away": np.column_stack([T_S, 1.0 + np.sin(T_S)]).tolist(),
}  # fmt: skip
ASKED = "touchdown.rest_m at most 0.03 m with 95 % probability at 90 % confidence"
ROW = {"requirement": ASKED, "words": "distance from the pad's centre at rest", "allowed_failures": 2, "flights": 105}
PLAN = {"schema": 1, "requirement": "approach", "flights": 767, "requirements": [ROW | {"allowed_of_all": 30}]}
JUDGED = ROW | {"sentence": ASKED, "verdict": "pass", "failures": 10, "flights": 767}
CERTIFIED = {"schema": 1, "verdict": "pass", "requirement": {"requirements": [JUDGED]}}
COMMAND = f"""
import json, sys
if sys.argv[1] == "report": print("flownav: bad.fnr: is no record", file=sys.stderr); sys.exit(2)
print({json.dumps(PLAN)!r} if "--plan" in sys.argv else {json.dumps(CERTIFIED)!r})
"""


def drawn() -> dict[str, dict[str, object]]:
    """The worker's answers, with a landing and a cloud of touchdowns as it draws them."""
    places = np.random.default_rng(1).normal(0.0, 0.06, (2, 120))
    figures = {"r50_m": {"value": 0.07}, "r95_m": {"value": 0.13}, "r997_m": {"value": None}}
    cloud = cloud_picture({"label": "landing", "figures": figures}, Touchdowns(*places, np.hypot(*places), 2.0))
    landing = landing_picture(navigated())
    assert cloud is not None
    assert landing is not None
    flown = {"svg": landing.svg, "words": landing.words, "verdict": "landed", "reason": "", "crashed": False}
    grown = {"flights": 120, "planned": 200, "landed": 118, "r95_m": 0.13}
    return {
        "look": LOOK, "cut": CUT, "fly": flown, "pace": {"flights": 6271, "seconds": 412},
        "cloud": grown | {"svg": cloud.svg, "words": cloud.words},
    }  # fmt: skip


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    folder = tmp_path_factory.mktemp("looks")
    for name in (LOG, "second.fnr"):
        (folder / name).write_bytes(b"x")
    (folder / "quad-sensor.toml").write_text("x")
    (folder / "landing_campaign").mkdir()
    (folder / "landing_campaign" / "campaign.json").write_text("{}")
    Written(folder).state(FRESH_S, reason="stale", why="the newest reading is too old")
    worker, command = (sys.executable, "-c", answers(drawn())), (sys.executable, "-c", COMMAND)
    with served(Desk(Shelf(folder), worker, command)) as address:
        yield address


# -- each page with all that can stand on it -------------------------------------------------------------------------
def logs(tab):
    row = tab.page.locator(f"li[data-file='{LOG}']")
    row.locator(".verdict").wait_for()
    row.locator("summary").click()
    tab.page.locator("li[data-file='second.fnr']").get_by_role("button", name="Report").click()
    tab.page.locator("li.job.failed").first.wait_for()


def cut(tab):
    tab.page.get_by_label("Cut GPS from [s]").fill("60")
    tab.page.get_by_label("Cut GPS to [s]").fill("120.5")
    tab.page.get_by_role("button", name="Cut", exact=True).click()
    tab.page.locator("td", has_text="12.25").wait_for()
    line = tab.page.locator("svg.map line.bar")
    length = float(line.get_attribute("x2")) - float(line.get_attribute("x1"))
    assert tab.page.text_content("svg.map text") == "10 m"
    assert length == pytest.approx(10.0 * 380.0 / np.ptp(PATH, axis=0).max(), rel=1e-3)  # the path fills 380 of 420


def fly(tab):
    tab.page.goto(f"{tab.page.url.split('#')[0]}#fly/landing_campaign")
    tab.page.locator("figure.picture svg.landing").nth(2).wait_for()
    tab.page.get_by_role("button", name="Go on").wait_for()


def certify(tab):
    tab.page.get_by_label("Requirement").select_option("approach")
    tab.page.get_by_role("button", name="Plan").click()
    tab.page.get_by_text("about 7 minutes").wait_for()
    assert tab.page.locator("tbody td").all_inner_texts() == [
        "distance from the pad's centre at rest at most 0.03 m with 95 % probability at 90 % confidence", "30",
    ]  # fmt: skip
    tab.page.get_by_role("button", name="Fly and judge").click()
    tab.page.locator("p.big", has_text="pass").wait_for()
    assert "touchdown.rest_m" not in tab.page.inner_text("main")


def live(tab):
    tab.page.locator("section.session [role=alert]", has_text="Nothing is sent").wait_for()
    for part in tab.page.locator("summary").all():
        part.click()


FILLED = {"logs": logs, "cut": cut, "fly": fly, "certify": certify, "live": live}


@pytest.mark.parametrize(("width", "scheme"), [(390, "light"), (390, "dark"), (1600, "dark")])
@pytest.mark.parametrize("page", FILLED)
def test_a_full_page_is_whole_and_readable(browser, address, page, width, scheme):
    tab = Tab(browser, f"{address}#{page}", width, color_scheme=scheme)
    FILLED[page](tab)
    assert complaints(tab.page) == []
    assert ground_of(tab.page) == rgb(PALETTE["page"][scheme == "dark"])
    tab.close(address)
