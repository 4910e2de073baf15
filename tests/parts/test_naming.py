"""Parts by name: of a file, of an installed package's entry point, and the campaign that keeps to them."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from typer.testing import CliRunner

from flownav.campaigns.local import rows_of
from flownav.campaigns.plan import planned
from flownav.core.errors import InputError
from flownav.parts.examples.complementary import ComplementaryFilter
from flownav.parts.flying import OwnPartsEngine, fly_parts, identities
from flownav.parts.naming import names, part_of
from flownav.parts.protocols import Parts

MINE = """
from flownav.parts.examples.complementary import ComplementaryFilter

class Mine(ComplementaryFilter):
    name = "mine"
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(MINE)
    return path


def test_a_class_in_a_file(file):
    assert part_of("filter", f"{file}:Mine").name == "mine"
    with pytest.raises(InputError, match="has no Other"):
        part_of("filter", f"{file}:Other")


def test_a_file_that_cannot_be_loaded_is_told(tmp_path):
    (tmp_path / "bad.py").write_text("import nothing_of_that_name")
    with pytest.raises(InputError, match=r"cannot be loaded: ModuleNotFoundError: No module named 'nothing_of"):
        part_of("filter", f"{tmp_path / 'bad.py'}:Mine")


def test_an_installed_packages_entry_point(file, tmp_path, monkeypatch):
    info = tmp_path / "others-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: others\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[flownav.filters]\ntheirs = mine:Mine\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "mine", raising=False)
    assert "theirs" in names("filter")
    assert part_of("filter", "theirs").name == "mine"


def test_the_command_line_flies_a_filter_of_a_file(file, tmp_path):
    from flownav.cli import app

    scenario = tmp_path / "short.toml"
    from flownav.api.scenario import Scenario

    Scenario.load("landing").changed(flight={"duration_s": 4.0}).save(scenario)
    asked = [
        "fly",
        str(scenario),
        "--filter",
        f"{file}:Mine",
        "--no-report",
        "--out",
        str(tmp_path / "r.fnr"),
        "--json",
    ]
    done = CliRunner().invoke(app, asked)
    assert done.exit_code == 0, done.output
    assert '"filter": "mine"' in done.stdout


def test_a_campaigns_rows_are_the_flights_one_by_one_and_its_folder_names_the_parts():
    from flownav.campaigns.engines import Part
    from flownav.simulation.scenario import load_scenario

    plan = planned(
        [load_scenario("landing")], {}, truth_models=["ensemble"], seed=3, flights=2, changes={"flight.duration_s": 4.0}
    )
    parts = Parts(filter=ComplementaryFilter)
    cell = plan.ready(0)
    ((_, rows),) = OwnPartsEngine(parts).fly(cell, 3, [Part(0, 0, 2)])
    for k in range(2):
        history = fly_parts(cell.setup, parts, 3, k, cell.ensemble, written=False).history
        np.testing.assert_array_equal(rows[k], rows_of(cell.flight, history)[0])
    (said,) = identities(parts)
    assert said.startswith("filter complementary ")
    assert len(said.split()[-1]) == 64


class Tuned(ComplementaryFilter):
    def __init__(self, gain=1.0):
        self.gain = gain


def test_identities_tell_classes_numbers_and_equations_apart():
    from flownav.parts.equations import EquationFilter
    from flownav.parts.examples.equation_filter import Memory, equation_filter, say, step

    filters = [
        ComplementaryFilter, Tuned, Tuned(2.0), Tuned(3.0), equation_filter,
        EquationFilter("equations", Memory(qw=0.5), step, say), EquationFilter("equations", Memory(), say, say),
    ]  # fmt: skip
    known = [identities(Parts(filter=each)) for each in filters]
    assert len(set(known)) == len(known)
    assert identities(Parts(filter=Tuned(2.0))) == identities(Parts(filter=Tuned(2.0)))


def test_a_campaign_of_an_own_filter_resumes_with_it_alone_and_flies_a_flight_again(file, tmp_path):
    import flownav

    short = {"flight": {"duration_s": 8.0}}
    first = flownav.campaign("landing", flights=2, filter=f"{file}:Mine", folder=tmp_path / "kept", **short)
    assert first.record(1).manifest["parts"] == {"filter": "mine"}
    assert first.record(1).manifest["scores"]["max_position_error_m"] == pytest.approx(
        first.to_pandas()["max_position_error_m"][1], rel=0, abs=0
    )
    again = flownav.campaign("landing", flights=2, filter=f"{file}:Mine", folder=tmp_path / "kept", **short)
    assert again.rate_per_s is None, "it flew what was there"
    with pytest.raises(InputError, match="another campaign"):
        flownav.campaign("landing", flights=2, filter=ComplementaryFilter, folder=tmp_path / "kept", **short)
    with pytest.raises(InputError, match="engine ray: parts of your own"):
        flownav.campaign("landing", flights=2, filter=ComplementaryFilter, engine="ray", **short)
