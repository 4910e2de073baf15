"""The corners of the uncertainty box: every combination once, at the ends that the file states."""

from __future__ import annotations

import pytest

from flownav.core.errors import InputError
from flownav.core.parameter_files import shipped
from flownav.vehicle.corners import ALONE, CROSSED, NOMINAL, corners
from flownav.vehicle.kinds import SHIPPED_VEHICLE, load_vehicle

SHEET = shipped(SHIPPED_VEHICLE).read_text(encoding="utf-8")


def written(tmp_path, text):
    path = tmp_path / "vehicle.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_shipped_box_has_every_combination_once_and_the_rest_one_at_a_time():
    box = list(corners())
    assert box[0].name == NOMINAL
    assert box[0].vehicle == load_vehicle()
    assert len({corner.name for corner in box}) == len(box) == 1 + 2 ** len(CROSSED) + 2 * len(ALONE)
    masses = {corner.vehicle.mass_kg for corner in box}
    assert sorted(round(mass, 9) for mass in masses) == [7.3, 7.9, 8.5]


def test_a_corner_is_what_its_name_says():
    by_name = {corner.name: corner.vehicle for corner in corners()}
    soft = by_name["mass -, inertia +, flapping stiffness -, drag +, servos -"]
    assert (soft.mass_kg, soft.inertia_xx_kg_m2) == pytest.approx((7.3, 0.26))
    assert (soft.hub_stiffness_n_m_rad, soft.hub_above_cg_m) == pytest.approx((60.0, 0.22))
    assert (soft.fuselage_area_x_m2, soft.cyclic_frequency_rad_s) == pytest.approx((0.14, 36.0))
    stiff = by_name["mass -, inertia -, flapping stiffness +, drag +, servos +"]
    assert (stiff.hub_stiffness_n_m_rad, stiff.cyclic_frequency_rad_s) == pytest.approx((150.0, 60.0))
    thin = by_name["air density -"]
    assert thin.air_density_kg_m3 == pytest.approx(1.145)
    assert thin.mass_kg == 7.9


def test_what_states_no_uncertainty_is_not_moved(tmp_path):
    bare = "\n".join("mass_kg = 7.9" if line.startswith("mass_kg") else line for line in SHEET.splitlines())
    box = list(corners(written(tmp_path, bare)))
    assert len(box) == 1 + 2 ** (len(CROSSED) - 1) + 2 * len(ALONE)
    assert {corner.vehicle.mass_kg for corner in box} == {7.9}


def test_an_uncertainty_that_is_no_number_is_one_line(tmp_path):
    path = written(tmp_path, SHEET.replace('"60..150"', '"some"'))
    with pytest.raises(InputError, match=r"main_rotor\.hub_stiffness_n_m_rad: uncertainty is a number or"):
        list(corners(path))
