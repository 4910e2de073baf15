"""The touchdown's lines in the terminal: the parts of its distance bear the names of the report and the glossary."""

from __future__ import annotations

from pathlib import Path

import pytest

from flownav.cli.fly_output import file_lines, touchdown_lines

GLOSSARY = Path(__file__).parents[2] / "docs" / "explanation" / "glossary.md"
PARTS = {"estimate_m": 0.0012, "guidance_m": 0.0221, "pad_m": 0.0023}
CONTACT = {"distance_m": 0.0234, "t_s": 76.421, "sink_rate_m_s": 0.221, "lateral_speed_m_s": 0.0181}


def test_the_parts_of_one_touchdown_have_their_own_figures():
    one = {"contact": CONTACT, "rest": {"distance_m": 0.0231}, "limited_by": PARTS}
    assert touchdown_lines(one, None, 1) == [
        "touchdown  0.023 m off at 76.42 s, sinking at 0.22 m/s, drifting at 0.02 m/s",
        "at rest  0.023 m off: estimate 0.001, guidance 0.022, pad's place 0.002 m",
    ]


@pytest.mark.parametrize("name", ["estimate", "guidance", "pad"])
def test_the_glossary_knows_each_part(name):
    said = GLOSSARY.read_text(encoding="utf-8").split("**Touchdown**")[1].split("**")[0]
    assert name in said


def test_of_many_flights_the_parts_are_percentiles_that_add_as_vectors():
    spread = {"median": 0.01, "p05": 0.004, "p95": 0.022}
    many = {
        "contact": None, "rest": {"distance_m": spread, "t_s": spread, "r95_m": 0.0221, "r95_interval_m": (0.02, 0.03)},
        "limited_by": PARTS, "success": {"rate": 1.0, "low": 0.926, "high": 1.0}, "broken": {},
        "went_around": {"flights": 0, "landed": 0}, "unfinished": {}, "verdicts": {"landed": 48},
    }  # fmt: skip
    lines = touchdown_lines(many, 48, 48)
    assert lines[2] == (
        "parts of the distance (they add as vectors), in 95 % of the flights at most  "
        "estimate 0.001 m, guidance 0.022 m, pad's place 0.002 m"
    )
    few = touchdown_lines(many, 19, 19)
    assert few[1] == "95 % of the flights, at rest  needs 20 flights"
    assert not [line for line in few if "parts of the distance" in line]


def test_record_and_report_share_a_line_where_it_is_no_wider_than_a_terminal():
    facts = {"record": "out/sortie.fnr", "report": "out/sortie.html"}
    assert file_lines(facts) == ["record  out/sortie.fnr   report  out/sortie.html"]
    which = " (flight 15, the one with the median largest error)"
    assert file_lines(facts, which) == [f"record  out/sortie.fnr{which}", "report  out/sortie.html"]
    fits = "x" * (80 - len("record  " + "   report  out/sortie.html"))
    assert len(file_lines(facts | {"record": fits})) == 1
    assert len(file_lines(facts | {"record": fits + "x"})) == 2
    assert file_lines({"record": "r.fnr"}) == ["record  r.fnr"]
