"""Records beside each other: a known difference comes out with its interval, in the table, in JSON and on the page."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from flownav.cli.compare import command
from flownav.core.errors import InputError
from flownav.core.record import Record
from flownav.studies.compare.records import cells, rows_of_records
from report_records import flight, replay


def worse(record: Record, by_m: float) -> Record:
    """The record with the north error of its estimate larger by so much everywhere."""
    estimate, truth = record.tables["estimate"], record.tables["truth"]
    east = estimate["pos_e_m"] - truth["pos_e_m"]
    error = np.hypot(estimate["pos_n_m"] - truth["pos_n_m"], east)
    estimate["pos_n_m"] = truth["pos_n_m"] + np.sqrt((error + by_m) ** 2 - east**2)
    return record


def test_a_known_difference_comes_out_with_its_interval() -> None:
    first, second = rows_of_records([("a", flight()), ("b", worse(flight(), 0.25))])
    assert first["difference"] is None
    assert first["against"] == "truth"
    found = second["difference"]["horizontal_m"]
    assert found["mean"] == pytest.approx(0.25, abs=1e-9)
    assert found["low"] <= found["mean"] <= found["high"]
    assert found["high"] - found["low"] < 1e-6  # the same difference at every instant
    assert second["difference"]["vertical_m"]["mean"] == pytest.approx(0.0, abs=1e-12)
    assert second["horizontal_rms_m"] > first["horizontal_rms_m"] + 0.2
    assert second["touchdown_m"] == 0.083
    assert second["touchdown_limited_by"] == {"estimate_m": 0.012, "guidance_m": 0.081, "pad_m": 0.003}


def test_two_filters_that_are_equally_good_show_no_difference() -> None:
    rows = rows_of_records([("a", flight(seed=1)), ("b", flight(seed=2))])
    for found in rows[1]["difference"].values():
        assert found["low"] < 0.0 < found["high"]


def test_errors_on_the_ground_do_not_count() -> None:
    record = flight()
    landed = record.tables["truth"]["t_s"] > 22.0
    record.tables["estimate"]["pos_n_m"] = record.tables["estimate"]["pos_n_m"] + 5.0 * landed
    (row,) = rows_of_records([("a", record)])
    assert row["horizontal_rms_m"] < 0.2


def test_without_a_truth_positions_are_held_against_gps() -> None:
    rows = rows_of_records([("a", replay(60.0)), ("b", replay(60.0, seed=3)), ("c", Record())])
    assert [row["against"] for row in rows] == ["gps", "gps", None]
    assert rows[1]["difference"]["velocity_m_s"] is None
    assert rows[1]["difference"]["horizontal_m"]["low"] is not None
    assert rows[2]["difference"] == {"horizontal_m": None, "vertical_m": None, "velocity_m_s": None}
    assert cells(rows[2])[1:] == ("-",) * 8


@pytest.fixture
def saved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    flight().save(Path("a.fnr"))
    worse(flight(), 0.25).save(Path("b.fnr"))
    return tmp_path


def run(*arguments: str):
    app = typer.Typer()
    app.command()(command)
    return CliRunner().invoke(app, list(arguments))


def test_the_command_prints_a_table_and_writes_one_page(saved: Path) -> None:
    result = run("a.fnr", "b.fnr", "--out", "both.html")
    assert result.exit_code == 0, result.output
    assert "mean error less that of a.fnr" in result.stdout
    assert re.search(r"horizontal \[m\] +0\.250 +0\.250 +0\.250", result.stdout)
    assert max(map(len, result.stdout.splitlines())) <= 80
    page = Path("both.html").read_text(encoding="utf-8")
    assert "Records compared" in page
    assert "+0.250 (+0.250 to +0.250)" in page
    assert len(page) < 1e6


def test_the_command_prints_json_alone(saved: Path) -> None:
    told = json.loads(run("a.fnr", "b.fnr", "--json").stdout)
    assert [row["record"] for row in told["records"]] == ["a.fnr", "b.fnr"]
    assert told["records"][1]["difference"]["horizontal_m"]["confidence"] == 0.95


def test_a_record_that_is_none_is_told_in_one_line(saved: Path) -> None:
    Path("c.fnr").write_text("no record")
    result = run("a.fnr", "c.fnr", "--out", "both.html")
    assert isinstance(result.exception, InputError)
    assert "\n" not in str(result.exception)
    assert not Path("both.html").exists()


def test_names_from_records_are_never_markup(saved: Path) -> None:
    name = "<img src=x onerror=alert(2)>.fnr"
    flight().save(Path(name))
    assert run("a.fnr", name, "--out", "both.html").exit_code == 0
    page = Path("both.html").read_text(encoding="utf-8")
    assert "<img" not in page
    assert "\\u003cimg" in page or "&lt;img" in page
