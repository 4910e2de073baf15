"""Every mistake in a parameter file is one line that says what, where and what to do."""

from __future__ import annotations

import math
import re

import pytest

from flownav.core.errors import InputError
from flownav.core.parameter_files import Number, ParameterModel, load, shipped
from flownav.vehicle.feasibility import require_feasible
from flownav.vehicle.kinds import describe_vehicle, load_vehicle
from flownav.vehicle.linearize import load_paper_model
from flownav.vehicle.parameters import VehicleParameters
from vehicle_files import X_CELL

SHIPPED = shipped("maxi_joker_3.toml").read_text()


def written(tmp_path, text, name="maxi.toml"):
    path = tmp_path / name
    path.write_text(text)
    return path


def refusal(tmp_path, text):
    """The one line with which a vehicle file is refused, without its folder."""
    with pytest.raises(InputError) as caught:
        load_vehicle(written(tmp_path, text))
    line = str(caught.value)
    assert "\n" not in line
    assert line.startswith(str(tmp_path / "maxi.toml"))
    return line.removeprefix(f"{tmp_path}/")


def changed(key, value):
    """The X-Cell file with one key of one table given another value."""
    table, name = key.split(".")
    lines, inside, hits = [], False, 0
    for line in X_CELL.splitlines():
        if line.startswith("["):
            inside = line == f"[{table}]"
        if line.startswith(f"{table} = "):
            line, count = re.subn(rf"\b{name} = [-\d.]+", f"{name} = {value}", line)
            hits += count
        elif inside and line.startswith(f"{name} = "):
            line, hits = f"{name} = {value}", hits + 1
        lines.append(line)
    assert hits == 1, key
    return "\n".join(lines)


def test_the_shipped_vehicle_has_provenance_for_every_number():
    described = describe_vehicle()
    assert described.name.startswith("Maxi Joker 3")
    assert len(described.entries) == 74
    assert all(entry.source for entry in described.entries)
    unstated = {entry.key for entry in described.entries if not entry.uncertainty}
    assert unstated == {
        "environment.gravity_m_s2",
        "main_rotor.blade_count",
        "tail_rotor.blade_count",
        "wind.max_speed_20ft_m_s",
    }
    by_key = {entry.key: entry for entry in described.entries}
    assert by_key["body.mass_kg"].value == load_vehicle().mass_kg
    assert "paper" in by_key["body.mass_kg"].source


def test_a_file_may_leave_provenance_out(tmp_path):
    described = describe_vehicle(written(tmp_path, X_CELL))
    assert described.name == "X-Cell .60"
    assert all(entry.source == "" for entry in described.entries)


def test_degrees_become_radians_and_rotor_constants_are_derived(tmp_path):
    vehicle = load_vehicle(written(tmp_path, X_CELL))
    assert isinstance(vehicle, VehicleParameters)
    assert vehicle.cyclic_maximum_rad == pytest.approx(math.radians(8.0))
    assert vehicle.pedal_rate_limit_rad_s == pytest.approx(math.radians(300.0))
    solidity = 2 * 0.058 / (math.pi * 0.775)
    assert vehicle.main_lift_solidity == pytest.approx(5.5 * solidity)
    assert vehicle.main_inflow_speed_m_s == pytest.approx(5.5 * solidity * 167.0 * 0.775 / 8.0)
    assert vehicle.tail_speed_rad_s == pytest.approx(4.66 * 167.0)
    lock = 1.225 * 5.5 * 0.058 * 0.775**4 / 0.038
    assert 1.0 / vehicle.flap_rate_1_s == pytest.approx(16.0 / (lock * 167.0))


def test_values_out_of_range_name_the_key_and_the_range(tmp_path):
    line = refusal(tmp_path, changed("main_rotor.radius_m", -1.0))
    assert line == "maxi.toml: main_rotor.radius_m: Input should be greater than 0.2, got -1.0"
    assert "body.mass_kg: Input should be less than 500, got 8200" in refusal(tmp_path, changed("body.mass_kg", 8200))
    radians = changed("cyclic.maximum_deg", 0.14)
    assert "cyclic.maximum_deg: Input should be greater than 1, got 0.14" in refusal(tmp_path, radians)


def test_a_value_with_provenance_is_checked_alike(tmp_path):
    line = refusal(tmp_path, SHIPPED.replace("value = 0.89,", "value = 89.0,"))
    assert line == "maxi.toml: main_rotor.radius_m: Input should be less than 6, got 89.0"
    line = refusal(tmp_path, SHIPPED.replace("{ value = 0.89,", "{ valeu = 0.89,"))
    assert "main_rotor.radius_m: an entry with provenance is { value" in line


@pytest.mark.parametrize("bad", ['"heavy"', "true", "nan", "inf", "[1.0]"])
def test_what_is_no_number_is_refused(tmp_path, bad):
    line = refusal(tmp_path, changed("body.mass_kg", bad))
    assert line.startswith("maxi.toml: body.mass_kg: ")


def test_unknown_missing_and_misspelt_keys(tmp_path):
    line = refusal(tmp_path, X_CELL.replace("hub_above_cg_m", "hub_above_cg_cm"))
    assert "main_rotor.hub_above_cg_cm: unknown key; known here: blade_count, " in line
    assert line.endswith("(and 1 more)")
    line = refusal(tmp_path, X_CELL.replace("hub_above_cg_m = 0.235\n", ""))
    assert line == "maxi.toml: main_rotor.hub_above_cg_m: missing; add it"
    line = refusal(tmp_path, X_CELL + "\n[drive_train]\ngear = 3.0\n")
    assert "drive_train: unknown key; known here:" in line
    assert "main_rotor" in line
    assert "schema_version" in refusal(tmp_path, X_CELL.replace("schema_version = 1", "schema_version = 2"))


def test_a_file_that_is_absent_or_no_toml(tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.toml: no such file"):
        load_vehicle(tmp_path / "nowhere.toml")
    assert "not valid TOML" in refusal(tmp_path, "[body\nmass = ")
    with pytest.raises(InputError, match="cannot be read"):
        load_vehicle(tmp_path)


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        (
            "body.inertia_zz_kg_m2",
            0.9,
            r"body: no rigid body has these inertias, 0\.9 kg m2 is more than 0\.18 \+ 0\.34",
        ),
        ("body.mass_kg", 60.0, r"main_rotor: cannot hover, the blades stall at \d+\.\d N and hover takes 588\.4 N"),
        ("collective.maximum_deg", 2.0, r"collective: cannot hover, it takes 5\.\d+ deg and the travel is -5\.\.2 deg"),
        ("pedal.maximum_deg", 3.0, r"pedal: cannot hover, it takes \d+\.\d+ deg and the travel is -20\.\.3 deg"),
        ("tail_rotor.chord_m", 0.005, r"tail_rotor: cannot hold the heading, the blades stall at \d\.\d+ N"),
        ("drive.shaft_power_limit_w", 900.0, r"drive\.shaft_power_limit_w: cannot hover, it takes 1\d\d\d W .* 900 W"),
        ("skids.cg_above_skid_m", 0.03, r"skids\.cg_above_skid_m: the tail rotor strikes the ground when parked"),
        ("skids.cg_above_skid_m", -0.2, r"skids\.cg_above_skid_m: Input should be greater than 0, got -0\.2"),
    ],
)
def test_a_helicopter_that_cannot_be_is_refused(tmp_path, key, value, says):
    assert re.search(says, refusal(tmp_path, changed(key, value)))


def test_rotors_that_strike_each_other_are_refused(tmp_path):
    low = X_CELL.replace("above_cg_m = 0.08", "above_cg_m = 0.15")
    load_vehicle(written(tmp_path, low))
    line = refusal(tmp_path, low.replace("behind_cg_m = 0.91", "behind_cg_m = 0.85"))
    assert "tail_rotor.behind_cg_m: the rotors strike each other, 0.85 m is less than" in line


def test_the_papers_model_refuses_a_wrong_shape_and_a_negative_variance(tmp_path):
    text = shipped("paper_reduced_model.toml").read_text()
    path = written(tmp_path, text.replace("[0.0, 0.0,    0.0374,    0.0]", "[0.0, 0.0374, 0.0]"), "reduced.toml")
    with pytest.raises(InputError, match=r"reduced\.toml: B\.3\.3: missing; add it"):
        load_paper_model(path)
    path = written(tmp_path, text.replace("process_variance = [0.0022", "process_variance = [-0.0022"), "reduced.toml")
    with pytest.raises(InputError, match=r"process_variance: variances should not be negative"):
        load_paper_model(path)


def test_a_twentieth_more_thrust_than_hover_takes_is_asked_for():
    vehicle = load_vehicle()
    heaviest = vehicle.main_thrust_limit_n / vehicle.gravity_m_s2 / 1.05
    free = {
        "collective_maximum_rad": 1.0,
        "pedal_maximum_rad": 1.0,
        "shaft_power_limit_w": 1e6,
        "tail_thrust_limit_n": 1e6,
    }
    require_feasible(vehicle._replace(mass_kg=0.999 * heaviest, **free), "here")
    with pytest.raises(InputError, match="main_rotor: cannot hover, the blades stall"):
        require_feasible(vehicle._replace(mass_kg=1.001 * heaviest, **free), "here")


@pytest.mark.parametrize(("moments", "possible"), [((1.0, 2.0, 2.99), True), ((1.0, 2.0, 3.01), False),
                                                   ((3.01, 1.0, 2.0), False), ((0.5, 0.5, 0.5), True)])  # fmt: skip
def test_no_body_has_a_moment_of_inertia_above_the_sum_of_the_others(moments, possible):
    """Of the principal moments, ∫(y² + z²) and so on, none exceeds the sum of the other two."""
    names = ("inertia_xx_kg_m2", "inertia_yy_kg_m2", "inertia_zz_kg_m2")
    body = load_vehicle()._replace(**dict(zip(names, moments, strict=True)))
    if possible:
        require_feasible(body, "here")
    else:
        with pytest.raises(InputError, match="no rigid body has these inertias"):
            require_feasible(body, "here")


@pytest.mark.parametrize(("text", "words"), [
    ("a = " + "[" * 3000 + "]" * 3000, "nested too deep"),
    (".".join("k" * 100) + " = 1", "nested too deep"),
    ("a = " + "9" * 5000, "an integer of thousands of digits"),
    ("radius_m = 0x" + "f" * 5000, "something that is too long to show"),
    ('"a\\nb" = 1', r"a\nb: unknown key"),
    ("x = 1 #" + "x" * 5_000_000, "more than 4,000,000 bytes"),
    ("x = \xff", "cannot be read"),
])  # fmt: skip
def test_what_breaks_readers_is_one_line(tmp_path, text, words):
    class Sheet(ParameterModel):
        radius_m: Number = 1.0

    path = tmp_path / "x.toml"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(InputError) as said:
        load(path, Sheet)
    assert words in str(said.value)
    assert "\n" not in str(said.value)
    assert len(str(said.value)) < 1000
