"""`flownav vehicle`: the promised JSON, tables that people can read, and one line on a bad file."""

from __future__ import annotations

import json
import math
import re
from functools import cache

import pytest
import typer
from typer.testing import CliRunner

from flownav.cli.vehicle import command
from flownav.control import margins
from flownav.core.errors import InputError, VerdictError
from flownav.core.parameter_files import shipped
from flownav.vehicle.kinds import SHIPPED_VEHICLE
from flownav.vehicle.linearize import load_paper_model
from vehicle_files import X_CELL

UNCERTAINTY = re.compile(r', uncertainty = (".*?"|[\d.e-]+)')
APP = typer.Typer()
APP.command()(command)


def run(*arguments):
    return CliRunner().invoke(APP, list(arguments))


@pytest.fixture(scope="module")
def _computed_once():
    """The margins at 123 corners take a while, and are the same however they are printed."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(margins, "margins_over_box", cache(margins.margins_over_box))
        yield


def test_json_is_one_object_with_the_promised_keys():
    result = run("--json")
    assert result.exit_code == 0
    sheet = json.loads(result.stdout)
    promised = {"collective_rad", "pedal_rad", "roll_rad", "pitch_rad", "induced_velocity_m_s", "power_w"}
    assert promised <= set(sheet["trim"])
    assert sheet["states"] == ["x", "y", "z", "u", "v", "w"]
    assert sheet["inputs"] == ["lon", "lat", "col", "ped"]
    for model in ("frozen_inflow", "quasi_steady_inflow", "paper"):
        assert [len(row) for row in sheet[model]["A"]] == [6] * 6
        assert [len(row) for row in sheet[model]["B"]] == [4] * 6
    assert sheet["paper"]["A"] == load_paper_model().a.tolist()
    gains = {point["z_over_R"]: point["multiplier"] for point in sheet["ground_effect"]}
    assert list(gains) == [0.5, 0.75, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0]
    assert (gains[0.5], gains[1.0], gains[2.0]) == pytest.approx((1.333, 1.0667, 1.0159), abs=5e-4)
    assert math.degrees(sheet["trim"]["collective_rad"]) == pytest.approx(4.2, abs=0.1)


def test_tables_show_trim_power_and_every_entry_beside_the_papers():
    result = run()
    assert result.exit_code == 0
    text = result.stdout
    for part in ("Maxi Joker 3", "Trim", "shaft power", "A(w,w)", "-3.2826", "B(w,col)", "-294.6074", "1.3333"):
        assert part in text
    for title in ("A, inflow frozen", "B, inflow re-solved", "Eigenvalues", "Ground effect"):
        assert title in text
    assert text.count("A(") == 18
    assert text.count("B(") == 4


def test_another_vehicle_is_shown_from_its_file(tmp_path):
    path = tmp_path / "x_cell.toml"
    path.write_text(X_CELL)
    assert json.loads(run(str(path), "--json").stdout)["vehicle"] == "X-Cell .60"


def test_a_bad_file_is_an_input_error_and_prints_nothing(tmp_path):
    result = run(str(tmp_path / "none.toml"), "--json")
    assert isinstance(result.exception, InputError)
    assert result.stdout == ""


@pytest.mark.usefixtures("_computed_once")
def test_margins_are_a_row_a_loop_and_corner():
    result = run("--margins", "--json")
    assert result.exit_code == 0
    facts = json.loads(result.stdout)
    first = facts["margins"][0]
    assert set(first) == {"loop", "corner", "phase_deg", "gain_db", "delay_s"}
    assert first["corner"] == "nominal"
    loops = {row["loop"] for row in facts["margins"]}
    assert {"roll", "pitch", "yaw", "heave", "velocity forward", "position right", "roll rate"} <= loops
    assert len(facts["margins"]) == len(loops) * len({row["corner"] for row in facts["margins"]})
    assert facts["cannot_hover"] == []


@pytest.mark.usefixtures("_computed_once")
def test_margins_as_a_table_name_the_least_of_each_loop():
    text = run("--margins").stdout
    for part in ("velocity forward", "[°]", "123 corners", "flapping stiffness"):
        assert part in text


def test_a_vehicle_without_margins_is_a_bad_verdict(tmp_path):
    """Blades that can hardly be turned: their servos lag behind what the gains ask of them.

    Of its numbers only the mass is uncertain: 9 corners are looked at, where the shipped file has 123.
    """
    path = tmp_path / "slow.toml"
    text = shipped(SHIPPED_VEHICLE).read_text(encoding="utf-8")
    assert text.count('value = 50.0, uncertainty = "36..60"') == 2
    text = text.replace('value = 50.0, uncertainty = "36..60"', "value = 12.0")
    lines = [line if line.startswith("mass_kg") else UNCERTAINTY.sub("", line) for line in text.splitlines()]
    path.write_text("\n".join(lines), encoding="utf-8")
    result = run("--margins", "--json", str(path))
    assert isinstance(result.exception, VerdictError)
    assert "less than 45 deg or 6 dB at a corner" in str(result.exception)
    rows = json.loads(result.stdout)["margins"]
    assert min(row["phase_deg"] for row in rows if row["phase_deg"] is not None) < 45.0
    assert len({row["corner"] for row in rows}) == 9
