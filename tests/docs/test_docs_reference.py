"""The generated pages of the reference: every command, key, table and column has its place, with its unit."""

from __future__ import annotations

import pytest
import typer.main
from pydantic import BaseModel

from docs_tools import reference, reference_commands, reference_keys, reference_tables, units
from flownav.cli import app
from flownav.core.measurement import COLUMNS
from flownav.core.record import TABLES
from flownav.simulation.scenario import Scenario


@pytest.fixture(scope="module")
def keys():
    return reference_keys.page()


@pytest.fixture(scope="module")
def commands():
    return reference_commands.page()


def _every_key(model: type[BaseModel]) -> set[str]:
    found = set()
    for key, field in model.model_fields.items():
        inner = [part for part in reference_keys._classes(field.annotation) if issubclass(part, BaseModel)]
        found |= {key for _ in [0] if not inner}
        for part in inner:
            found |= _every_key(part)
    return found


@pytest.mark.parametrize("name", sorted(reference.PAGES))
def test_every_generated_page_begins_with_its_title(name):
    assert reference.PAGES[name]().startswith("# ")


@pytest.mark.parametrize("name", sorted(typer.main.get_command(app).commands))  # type: ignore[attr-defined]
def test_every_command_has_its_own_help(name, commands):
    section = commands.split(f"\n## flownav {name}\n", 1)[1].split("\n## ", 1)[0]
    assert f"Usage: flownav {name}" in section
    assert "--help" in section


@pytest.mark.parametrize("title", sorted(reference_keys.FILES))
def test_every_key_of_every_file_has_a_row(title, keys):
    chapter = keys.split(f"\n## {title}\n", 1)[1].split("\n## ", 1)[0]
    missing = {key for key in _every_key(reference_keys.FILES[title][0]) if f"| `{key}` |" not in chapter}
    assert not missing


def test_a_number_has_its_unit_range_and_default(keys):
    assert "| `duration_s` | s | number | ≥ 0.1, ≤ 3600 | `50` |" in keys
    assert Scenario.model_fields["flight"].annotation.model_fields["duration_s"].default == 50.0


def test_a_choice_and_a_list_say_what_they_take(keys):
    assert "| `truth` |  | `nonlinear` or `linear` |  | `nonlinear` |" in keys
    assert "**`[flight.path]`**" in keys


@pytest.mark.parametrize("name", sorted(TABLES))
def test_every_table_has_a_sentence_and_every_column(name):
    section = reference_tables.page().split(f"\n## {name}\n", 1)[1].split("\n## ", 1)[0]
    assert reference_tables.MEANINGS[name] in section
    assert all(f"`{column}`" in section for column in TABLES[name])


def test_every_stream_is_listed():
    page = reference_tables.page()
    for sensor, columns in COLUMNS.items():
        assert f"| `{sensor.name.lower()}` | {', '.join(f'`{column}`' for column in columns)} |" in page


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("pos_n_m", "m"), ("vel_n_m_s", "m/s"), ("std_vel_e_m_s", "m/s"), ("thrust_n", "N"), ("stiffness_n_m", "N/m"),
        ("hub_stiffness_n_m_rad", "N·m/rad"), ("gyro_noise_rad_s_rt_hz", "rad/s/√Hz"), ("tilt_n_rad", "rad"),
        ("speed_20ft_m_s", "m/s"), ("gps_slow_e_m", "m"), ("qw", ""), ("sensor", ""), ("mass_kg", "kg"),
        ("governor_integral_1_rad", "1/rad"), ("range_g", "g"), ("t_s", "s"), ("accel_bias_x_m_s2", "m/s²"),
    ],
)  # fmt: skip
def test_units_are_read_from_names(name, unit):
    assert units.unit_of(name) == unit


@pytest.mark.parametrize("title", sorted(reference_keys.FILES))
def test_every_key_of_every_file_has_a_meaning(title, keys):
    chapter = keys.split(f"\n## {title}\n", 1)[1].split("\n## ", 1)[0]
    table, silent = "", []
    for line in chapter.split("\n"):
        table = line.split("**")[1] if line.startswith("**") else table
        if line.startswith("| `") and not line.removesuffix("|").rsplit(" | ", 1)[1].strip():
            silent.append(f"{table}: {line.split('`')[1]}")
    assert not silent
