"""The flow sensor's file, the paper's tables that ship, and every message about a wrong file."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from flownav.core.errors import InputError
from flownav.core.parameter_files import check, shipped
from flownav.sensors.datasheet import load_sensor
from flownav.sensors.noise_law import Noise
from flownav.sensors.settings import FlowSettings

TABLES = [
    "table1_identified_models.csv",
    "table2_validation.csv",
    "table3_selected_model.csv",
    "table5_takeoff.csv",
    "table6_landing.csv",
]


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("name", TABLES)
def test_a_shipped_table_is_the_papers(name: str, paper_folder: Path) -> None:
    published = rows(paper_folder / name)
    assert rows(shipped(f"paper_{name}")) == published
    assert published


def test_the_sensor_file_carries_the_28_models_of_table_1() -> None:
    models = load_sensor().identified_models
    table = rows(shipped("paper_table1_identified_models.csv"))
    assert len(models) == len(table) == 28
    for model, row in zip(models, table, strict=True):
        assert model.model == int(row["model"])
        got = (model.height_m, model.fit_percent, model.a_1_s2, model.b_1_s, model.c_1_s2)
        assert got == tuple(float(row[key]) for key in ("height_m", "fit_percent", "a", "b", "c"))


def test_the_shipped_dynamics_are_the_papers_selected_model() -> None:
    sensor = load_sensor()
    assert sensor.dynamics == sensor.with_model(0.6, 2).dynamics
    assert sensor.dynamics.gain == pytest.approx(1.0261, abs=1e-4)
    assert sensor.dynamics.delay_s == pytest.approx(0.077, abs=5e-4)
    assert sensor.dynamics.natural_frequency_rad_s == pytest.approx(13.8528, abs=1e-4)
    assert sensor.dynamics.damping_ratio == pytest.approx(0.5353, abs=2e-3)  # the printed b gives 0.5342


def test_the_power_law_is_the_one_through_table_2() -> None:
    means: dict[float, list[float]] = {}
    for row in rows(shipped("paper_table2_validation.csv")):
        means.setdefault(float(row["height_m"]), []).append(float(row["std_error_m_s"]))
    law = load_sensor().noise
    for height, errors in means.items():
        predicted = law.sigma_m_s * (height / law.reference_height_m) ** law.exponent
        # a power law through four points that do not lie on one: within a quarter
        assert predicted == pytest.approx(sum(errors) / len(errors), rel=0.25)


def text(**replacements: str) -> str:
    source = shipped("px4flow_paper.toml").read_text()
    source = source[: source.index("# Table 1, whole")]
    for old, new in replacements.values():
        assert old in source
        source = source.replace(old, new)
    return source


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "value = 191.9",
            "value = -191.9",
            "dynamics.c_1_s2: Input should be greater than or equal to 0.001, got -191.9",
        ),
        ("b_1_s =", "b_rad_s =", "dynamics.b_rad_s: unknown key; known here: a_1_s2, b_1_s, c_1_s2 (and 1 more)"),
        ("schema_version = 1", "schema_version = 2", "schema_version: Input should be 1, got 2"),
        ('law = "power"', 'law = "cubic"', "noise.law: Input should be 'constant', 'power' or 'accuracy', got 'cubic'"),
        ("value = 3.5", "value = 0.01", "limits.max_height_m: at least min_height_m = 0.05 is needed, got 0.01"),
        ("value = 25.0", "value = 90.0", "limits.max_tilt_deg: Input should be less than 84, got 90.0"),
        ("hysteresis = 0.05", "hysteresis = 0.05\nhisteresis = 1", "limits.histeresis: unknown key; known here: hyst"),
        ("image_side_px = {", "image_side_px = nan # {", "optics.image_side_px: Input should be a finite number"),
        ('law = "power"', 'law = "accuracy"\naccuracy = 0.99\nreference_height_m = 0.7 #', "TOML"),
    ],
)
def test_a_wrong_sensor_file_is_one_line_with_file_key_and_range(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    path = tmp_path / "sensor.toml"
    path.write_text(text(change=(old, new)))
    with pytest.raises(InputError) as error:
        load_sensor(path)
    assert str(path) in str(error.value)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ({"law": "power"}, 'f: sigma_m_s: law = "power" needs this key, got None'),
        ({"law": "accuracy"}, 'f: signal_sigma_m_s: law = "accuracy" needs this key, got None'),
        ({"law": "accuracy", "signal_sigma_m_s": 0.3, "reference_height_m": 1.0}, "f: max_height_m: the noise law is"),
        ({"law": "constant", "sigma_m_s": 0.1, "max_height_m": 0.5}, "f: max_height_m: at least min_height_m = 0.6"),
    ],
)
def test_a_noise_law_that_cannot_be_is_one_line_with_its_key(entries: dict[str, object], message: str) -> None:
    with pytest.raises(InputError) as error:
        check({"min_height_m": 0.6, "max_height_m": 1.5} | entries, Noise, "f")
    assert str(error.value).startswith(message)


def test_a_missing_file_is_named() -> None:
    with pytest.raises(InputError, match=r"nowhere\.toml: no such file"):
        load_sensor("nowhere.toml")


def test_an_unknown_identified_model_lists_the_known_ones() -> None:
    with pytest.raises(InputError, match=r"no identified model 9 at 0\.6 m; it has: 0\.6 m model 1, "):
        FlowSettings(identified_height_m=0.6, identified_model=9).parameters(load_sensor())


@pytest.mark.parametrize("entries", [{"identified_model": 2}, {"identified_height_m": 0.6}])
def test_half_a_choice_of_model_is_refused(entries: dict[str, object]) -> None:
    with pytest.raises(InputError, match="f: identified_model: goes together with identified_height_m"):
        check(entries, FlowSettings, "f")
