"""The envelope: flights by the wind's speed, as a row of a table, on the page and in its picture."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from docs_tools import pictures
from flownav.api.flying import notes_of
from flownav.api.scenario import Scenario
from flownav.scoring.landings import REST_DISTANCE
from flownav.scoring.touchdown import TOUCHDOWN_COLUMNS
from flownav.simulation.assemble import assemble
from flownav.simulation.scenario import load_scenario
from flownav.vehicle.kinds import read_vehicle

PROJECT = Path(__file__).parents[2]
PAGE = PROJECT / "docs" / "explanation" / "control.md"
STATED_M_S = read_vehicle().wind.max_speed_20ft_m_s


@pytest.fixture(scope="module")
def envelope():
    sys.path.insert(0, str(PROJECT / "tools"))
    import envelope

    yield envelope
    sys.path.remove(str(PROJECT / "tools"))


def test_all_flights_of_a_row_have_its_speed_and_a_direction_of_their_own(envelope):
    setup = envelope.in_wind(load_scenario("approach"), 6.0)
    truths = setup.ensemble().truths(3, 0, 4)
    assert {truth.wind.along_sigma_m_s for truth in truths} == {setup.flight.wind.along_sigma_m_s}
    assert len({truth.wind.toward_n for truth in truths}) == len(truths)
    assert len({truth.vehicle.mass_kg for truth in truths}) == len(truths)
    assert setup.scenario.wind.speed_20ft_m_s == 6.0


def test_a_row_has_shares_and_a_radius_and_the_picture_reads_it(envelope):
    landings = np.zeros((100, len(TOUCHDOWN_COLUMNS)))
    landings[:, TOUCHDOWN_COLUMNS.index("expected")] = 1.0
    landings[:, REST_DISTANCE] = 0.04
    landings[0, TOUCHDOWN_COLUMNS.index("broken")] = 1.0
    few = landings.copy()
    few[:50, REST_DISTANCE] = np.nan
    table = envelope.heading(100, 7) + "".join(
        envelope.line(envelope.row_of("approach", speed, each)) for speed, each in ((8.0, landings), (15.0, few))
    )
    assert "(100 flights a row, seed 7)" in table
    assert "| `approach` | 8 | 99.0 | 1.0 | 0.040 (0.040-" in table
    assert "| `approach` | 15 | 50.0 | 1.0 | none |" in table
    read = pictures.campaigns.envelope_of(f"{envelope.BEGIN}\n\n{table}\n{envelope.END}")
    assert list(read) == ["approach"]
    np.testing.assert_array_equal(read["approach"], [(8.0, 99.0, 1.0, 0.04), (15.0, 50.0, 1.0, np.nan)])
    with pytest.raises(ValueError, match="make envelope"):
        pictures.campaigns.envelope_of("# A page\n")


def test_the_page_has_every_case_in_every_wind_and_no_crash_up_to_the_stated_limit(envelope):
    table = pictures.campaigns.envelope_of(PAGE.read_text(encoding="utf-8"))
    assert list(table) == list(envelope.SCENARIOS)
    for case, rows in table.items():
        assert [row[0] for row in rows] == list(envelope.SPEEDS_M_S), case
        assert [row for row in rows if row[0] <= STATED_M_S and row[2] > 0.0] == [], case


@pytest.mark.parametrize(("wind_m_s", "vehicle", "says"), [
    (STATED_M_S, None, False), (STATED_M_S + 0.5, None, True), (STATED_M_S + 0.5, "hexa-550", False),
])  # fmt: skip
def test_a_wind_beyond_the_vehicles_limit_is_noted_in_one_line(wind_m_s, vehicle, says):
    chosen = Scenario.load("approach").changed(wind=wind_m_s, vehicle=vehicle)
    notes = notes_of(assemble(chosen.file))
    assert len(notes) == says
    if says:
        assert f"{wind_m_s:g} m/s" in notes[0]
        assert f"beyond the {STATED_M_S:g} m/s" in notes[0]
