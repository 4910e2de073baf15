"""The README's first figure is what the shipped requirement asks, the accuracy page holds and the flights keep."""

from __future__ import annotations

import json
import re

import pytest
from typer.testing import CliRunner

from docs_tools import figures_book
from flownav.campaigns.requirement import load_requirement
from flownav.cli import app
from places import DOCS, PROJECT

README = (PROJECT / "README.md").read_text(encoding="utf-8")
FLIGHTS = 96
BOOK = figures_book.read()


FIGURE = re.compile(
    r"^- \*\*<!-- figure certify\.asked_m -->([\d.]+) m<!-- end -->\*\* from the pad's centre at rest", re.M
)


def figure_m() -> float:
    return float(FIGURE.search(README)[1])


def test_readme_requirement_and_accuracy_page_say_one_figure():
    asked = load_requirement("approach").requirement[0]
    assert (asked.measure, asked.probability) == ("touchdown.rest_m", 0.95)
    assert figure_m() == asked.at_most
    page = (DOCS / "explanation" / "accuracy.md").read_text(encoding="utf-8")
    row = re.search(
        r"^\| approach +\| ensemble \| touchdown R95 at rest \[m\] +\| ([\d.]+) +\| <= ([\d.]+) ", page, re.M
    )
    assert float(row[2]) == figure_m()
    assert float(row[1]) <= figure_m()


@pytest.mark.parametrize(("case", "flights", "figure"), [
    ("pad_return", "ensemble", "accuracy-pad-return.rest_r95_m"),
    ("approach", "matched", "accuracy.approach_matched_rest_r95_m"),
    ("approach", "ensemble", "accuracy.approach_rest_r95_m"),
    ("approach_8_m_s", "matched", "accuracy.windy_matched_rest_r95_m"),
    ("approach_8_m_s", "ensemble", "accuracy.windy_rest_r95_m"),
])  # fmt: skip
def test_the_tables_of_the_accuracy_page_have_the_figures_of_the_book(case, flights, figure):
    page = (DOCS / "explanation" / "accuracy.md").read_text(encoding="utf-8")
    table = re.search(rf"^\| {flights}: touchdown .*?\n\n", page, re.M | re.S)[0]
    row = re.search(rf"^\| {case} +\| [\d.]+ \([^|]*\) +\| ([\d.]+) \(([\d.]+)-([\d.]+)\) ", table, re.M)
    noted = BOOK.figures[figure]
    assert [float(row[k]) for k in (1, 2, 3)] == [round(value, 3) for value in (noted.value, *noted.interval)]


def test_fewer_flights_of_the_certificate_keep_the_figure(tmp_path):
    """Of all flights 1 in 20 may be farther off; of these no more than that, whatever the crash rate needs."""
    asked = ("--flights", FLIGHTS, "--ranking", 0, "--records", 0, "--again", 1, "--out", tmp_path / "few", "--json")
    done = CliRunner().invoke(app, ["certify", "approach", *map(str, asked)])
    facts = json.loads(done.stdout)
    near, whole = facts["requirement"]["requirements"]
    assert facts["flights"] == FLIGHTS
    assert near["failures"] <= 0.05 * FLIGHTS
    assert near["tolerance_bound"] < 2.0 * figure_m()
    assert whole["failures"] == 0
