"""The table of real autopilots: rows of what was flown, its place in the page, and that each case can be asked for."""

from __future__ import annotations

import json

import pytest

import autopilots
from flownav.cli.sitl import COLUMNS
from flownav.live.sitl.flight import PILOTS, SCENARIOS

FLIGHT = {"landed": True, "why": "", "touchdown_m": 0.4, "error_m": 1.0, "cpu_share": 0.2}
PAGE = "# Page\n\n## Before\n\nold\n\n## What was asked\n\nmuch\n"


@pytest.fixture
def folder(tmp_path):
    for number, touchdown_m in enumerate((0.4, 0.6)):
        place = tmp_path / "heli-square-cut" / f"heli-square-gps-cut-{number:03d}"
        place.mkdir(parents=True)
        (place / "flight.json").write_text(json.dumps(FLIGHT | {"touchdown_m": touchdown_m}))
    place = tmp_path / "quad-square-cut" / "quad-square-gps-cut-000"
    place.mkdir(parents=True)
    (place / "flight.json").write_text(json.dumps({"landed": False, "why": "it does not climb"}))
    return tmp_path


def test_flights_of_a_kind_are_a_row_and_what_was_broken_off_is_said(folder):
    text = autopilots.section("## Title", "command", autopilots.rows(folder))
    assert text.startswith("## Title\n\nPrinted by `command`.")
    (heli,) = [line for line in text.splitlines() if line.startswith("| heli")]
    assert heli.startswith("| heli-square-gps-cut | 2 of 2 |")
    assert "| 0.60 |" in heli
    assert heli.count("|") == len(COLUMNS) + 1
    assert "| quad-square-gps-cut | 0 of 1 |" in text
    assert "`quad-square-gps-cut`, not flown to its end: it does not climb." in text


def test_a_section_stands_before_the_last_one_and_is_replaced_there():
    once = autopilots.with_section(PAGE, "## Title", "## Title\n\nfirst\n\n")
    assert once == "# Page\n\n## Before\n\nold\n\n## Title\n\nfirst\n\n## What was asked\n\nmuch\n"
    assert autopilots.with_section(once, "## Title", "## Title\n\nsecond\n\n") == once.replace("first", "second")
    assert autopilots.with_section(once, "## Other", "## Other\n\nx\n\n").index("## Other") > once.index("## Title")


def test_every_case_is_one_that_can_be_flown():
    kinds = {
        (vehicle, dict(zip(options[::2], options[1::2], strict=True))["--gps"]) for vehicle, options in autopilots.CASES
    }
    assert kinds == {(vehicle, gps) for vehicle in autopilots.VEHICLES for gps in ("on", "cut", "never")}
    for vehicle, options in autopilots.CASES:
        make = autopilots.VEHICLES[vehicle]
        assert vehicle in PILOTS[make].vehicles
        assert options[1] in SCENARIOS
        assert make == "ardupilot" or "--wind" not in options
