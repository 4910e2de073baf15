"""`flownav explain`, `flownav.explain`, and what `info` and a log's page say of it."""

from __future__ import annotations

import json
import os
from pathlib import Path

import jsonschema
import pytest

import flownav
from command import run
from flownav.cli.schemas import schema_of
from flownav.report.html import render
from mavlink_logs import flight_log
from planted.planted import written
from planted_logs import fault, sound


@pytest.fixture(scope="module")
def turned(tmp_path_factory) -> Path:
    return written(fault("forum", "sensor mounted a quarter turn round"), tmp_path_factory.mktemp("turned"))


@pytest.fixture(scope="module")
def clean(tmp_path_factory) -> Path:
    return written(sound("hall", "ardupilot", 22), tmp_path_factory.mktemp("clean"))


def test_the_command_names_the_cause_and_writes_page_and_parameters(turned, tmp_path):
    done = run("explain", str(turned), "--json", cwd=tmp_path)
    assert done.returncode == 1
    assert "The flow sensor's axes are turned" in done.stderr
    facts = json.loads(done.stdout)
    jsonschema.validate(facts, schema_of("explain"))
    assert facts["first"] == "flow_axes"
    assert facts["causes"][0]["cure"]["parameters"][0] == {
        "name": "SENS_FLOW_ROT", "value": 2.0, "reason": facts["causes"][0]["cure"]["parameters"][0]["reason"]
    }  # fmt: skip
    assert "SENS_FLOW_ROT\t2" in (tmp_path / facts["parameters"]).read_text()
    page = (tmp_path / facts["page"]).read_text()
    assert facts["causes"][0]["title"].replace("'", "&#39;") in page
    assert "Causes that were checked" in page


def test_a_sound_log_ends_well_and_lists_what_was_looked_for(clean, tmp_path):
    done = run("explain", str(clean), cwd=tmp_path)
    assert done.returncode == 0
    assert "Nothing wrong was found" in done.stdout
    assert "Looked for: vibration" in done.stdout.replace("\n", " ")
    assert max(map(len, done.stdout.splitlines())) <= 80
    assert "Hypotheses that remained" not in done.stdout  # nothing was found
    assert not list((tmp_path / "out").glob("*.param*"))


def test_info_says_it_on_top(turned, tmp_path):
    done = run("info", str(turned), cwd=tmp_path)
    assert done.stdout.splitlines()[1].startswith("A cause of drift: The flow sensor's axes")
    facts = json.loads(run("info", str(turned), "--json", cwd=tmp_path).stdout)
    assert facts["causes"][0] == "flow_axes"


def test_the_page_of_a_log_says_it_on_top(turned, tmp_path):
    run("replay", str(turned), "--out", "r.fnr", cwd=tmp_path)
    page = render(flownav.load(tmp_path / "r.fnr"))
    assert page.index("A cause of drift:") < page.index("<h2>Accuracy</h2>")
    assert 'id="explained"' in page


def test_python_gives_typed_findings(turned, clean):
    explained = flownav.explain(turned)
    assert explained.first is not None
    assert explained.first.figures["turn_deg"] == pytest.approx(-90.0, abs=3.0)
    assert explained.first.cure.settings[0].name == "SENS_FLOW_ROT"
    assert flownav.explain(clean).first is None


@pytest.mark.parametrize(("log", "words"), [("nowhere.ulg", "no such log"), ("", "nothing")])
def test_a_log_that_is_none_is_one_line(tmp_path, log, words):
    done = run("explain", log or "nowhere", cwd=tmp_path)
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists() or not os.listdir(tmp_path / "out")


def test_python_refuses_an_unknown_autopilot(turned):
    with pytest.raises(flownav.InputError, match="px4, ardupilot or inav"):
        flownav.explain(turned, autopilot="betaflight")


def test_a_hover_whose_flow_follows_nothing_has_no_turn_to_try_back(tmp_path):
    """The fit of its flow to its motion is singular: it moves along one axis."""
    found = flownav.explain(flight_log(12.0).write(tmp_path / "hover.tlog"))
    assert found.checked
