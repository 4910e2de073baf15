"""A quadrotor in the closed loop: it takes off, lands and is dispersed, and its lanes are its own equations."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.campaigns.local import fly_many
from flownav.core.compile import LANES, kernel
from flownav.core.errors import InputError
from flownav.core.record import POSITION_NED
from flownav.scoring.errors import touchdown_rows
from flownav.scoring.landings import crashed, succeeded
from flownav.simulation import layout
from flownav.simulation.assemble import assemble
from flownav.simulation.engine import fly_blocks, fly_one
from flownav.simulation.ensemble import believed
from flownav.simulation.history import column, columns
from flownav.simulation.plant import step_vehicle
from flownav.simulation.scenario import load_scenario, with_filter, with_vehicle
from flownav.simulation.truth import packed_truth
from flownav.vehicle import multirotor
from flownav.vehicle.state import CALM, Controls

QUAD, HEXA = "quad-450", "hexa-550"
FLOWN = 96


def flown_by(vehicle, name):
    return assemble(with_vehicle(load_scenario(name), vehicle))


def flown_by_quad(name):
    return flown_by(QUAD, name)


@kernel
def step(work, lanes, dt, rotors):
    step_vehicle(work, lanes, dt, rotors, None)


@pytest.mark.parametrize(("vehicle", "rotors"), [(QUAD, 4), (HEXA, 6)])
def test_a_step_on_lanes_is_the_multirotors_own(vehicle, rotors):
    flight = flown_by(vehicle, "landing").flight
    count = len(LANES)
    work = np.zeros(layout.ROWS * count)
    work[layout.AS_IS_BEGIN * count : layout.AS_IS_END * count] = packed_truth([believed(flight)] * count)
    rows = work.reshape(-1, count)
    generator = np.random.default_rng(1)
    state = np.array(flight.plan.start)[:, None] + generator.normal(size=(20, count)) * np.array(
        [1, 1, 0.3, 1, 1, 1, *[0.02] * 4, *[0.5] * 3, *[30] * rotors, *[0] * (6 - rotors), 0]
    ).reshape(-1, 1)
    controls = np.array([0.02, -0.03, 0.4, 0.05])[:, None] * generator.uniform(0.5, 1.5, (4, count))
    rows[layout.AROUND : layout.AROUND + len(CALM)] = np.array(CALM)[:, None]
    rows[layout.HELICOPTER : layout.HELICOPTER + 20] = state
    rows[layout.CONTROLS : layout.CONTROLS + 4] = controls
    step(work, LANES, 0.002, flight.rotors)
    for lane in range(count):
        before = type(flight.plan.start)(*(float(x) for x in state[:, lane]))
        told = Controls(*(float(x) for x in controls[:, lane]))
        after = multirotor.step(before, told, CALM, 0.002, rotors == 6, flight.vehicle)
        assert rows[layout.HELICOPTER : layout.HELICOPTER + 20, lane] == pytest.approx(np.array(after), abs=1e-9)


@pytest.mark.parametrize("name", ["landing", "takeoff", "pad_return", "approach"])
def test_it_flies_the_shipped_scenarios_to_their_end(name):
    flight = flown_by_quad(name).flight
    history = fly_one(flight, 2, 0)[:, :, 0]
    end = {axis: history[-1, column("truth", f"pos_{axis}_m")] for axis in "ned"}
    assert np.isfinite(history[:, columns("truth", POSITION_NED)]).all()
    tilt_cosine = 1.0 - 2.0 * (history[:, column("truth", "qx")] ** 2 + history[:, column("truth", "qy")] ** 2)
    assert np.degrees(np.arccos(tilt_cosine.min())) < 30.0
    assert np.hypot(end["n"], end["e"]) < 2.0
    height = -end["d"] - flight.vehicle.cg_above_skid_m
    assert height == pytest.approx(3.0 if name == "takeoff" else 0.0, abs=0.2)
    if name != "takeoff":
        weight = flight.vehicle.mass_kg * flight.vehicle.gravity_m_s2
        assert history[-1, column("truth", "contact_n")] == pytest.approx(weight, rel=0.05)


def test_an_ensembles_flight_is_the_same_alone_and_in_a_batch():
    setup = flown_by_quad("landing")
    truths = setup.ensemble()
    drawn = truths.truths(7, 0, 3)
    assert len({truth.vehicle.mass_kg for truth in drawn}) == 3
    assert len({truth.vehicle.resistance_ohm for truth in drawn}) == 3
    alone = fly_one(setup.flight, 7, 2, truths)[:, :, 0]
    (_, batch), *_ = fly_blocks(setup.flight, 7, 0, 3, lambda history: history[:, :, 2].copy(), ensemble=truths)
    assert alone.tobytes() == batch.tobytes()


@pytest.mark.slow  # minutes of compiling
@pytest.mark.parametrize("name", ["landing", "pad_return"])
def test_a_hexarotor_lands_with_every_vehicle_of_its_ensemble(name):
    setup = flown_by(HEXA, name)
    landings = touchdown_rows(fly_many(setup.flight, 1, FLOWN, ensemble=setup.ensemble()))
    assert succeeded(landings).sum() == FLOWN
    assert crashed(landings).sum() == 0


def test_helicopter_entries_of_the_dispersion_are_passed_over_and_the_other_way_round():
    quad, helicopter = flown_by_quad("landing").ensemble(), assemble(load_scenario("landing")).ensemble()
    assert not any("main_rotor" in name for name in quad.entries)
    assert not any("propeller" in name for name in helicopter.entries)
    assert {"vehicle.body.mass_kg", "wind.speed_20ft_m_s"} <= set(quad.entries) & set(helicopter.entries)


def test_the_papers_filter_and_truth_are_a_helicopters():
    scenario = with_vehicle(load_scenario("landing"), QUAD)
    with pytest.raises(InputError, match="a helicopter's; fly a multirotor with"):
        assemble(with_filter(scenario, "paper"))


def test_a_scenario_names_its_vehicle_in_a_word(tmp_path):
    file = tmp_path / "mine.toml"
    path = "[{t_s = 0, height_m = 3}, {t_s = 9, height_m = 3}]"
    text = f'schema_version = 1\nname = "mine"\nvehicle = "quad-450"\n[flight]\nstart = "hover"\npath = {path}\n'
    file.write_text(text, encoding="utf-8")
    assert load_scenario(str(file)).vehicle.file == QUAD
    assert assemble(load_scenario(str(file))).flight.rotors == (0, 0, 0, 0)
