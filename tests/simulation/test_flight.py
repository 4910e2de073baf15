"""The closed loop: bit-identical alone, in any batch and on any number of threads; flies, lands, and is scored."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.campaign.local import fly_many, fly_recorded, score_history
from flownav.parameter_files import check
from flownav.record import POSITION_NED, QUATERNION
from flownav.scoring.errors import MAX_POSITION_ERROR, SCORE_COLUMNS
from flownav.scoring.paper_tables import published
from flownav.simulation.assemble import assemble
from flownav.simulation.engine import fly_one
from flownav.simulation.history import column
from flownav.simulation.scenario import Scenario, load_scenario


def setup(name, **sections):
    entries = load_scenario(name).model_dump(exclude_unset=True)
    for key, value in sections.items():
        entries[key] = {**entries.get(key, {}), **value} if isinstance(value, dict) else value
    return assemble(check(entries, Scenario, "test"))


SHORT = {"duration_s": 3.0}


@pytest.mark.parametrize("name", ["takeoff", "landing", "gusty"])
def test_a_flight_is_the_same_bytes_alone_in_any_batch_and_on_any_threads(name):
    flight = setup(name, flight=SHORT).flight
    alone = np.array([score_history(flight, fly_one(flight, 5, k))[0] for k in range(20)])
    for threads in (1, 2, 3):
        assert np.array_equal(fly_many(flight, 5, 20, threads=threads), alone, equal_nan=True)
    assert np.array_equal(fly_many(flight, 5, 7, first=13), alone[13:], equal_nan=True)


def test_seeds_and_flights_differ():
    flight = setup("landing", flight=SHORT).flight
    largest = [fly_many(flight, seed, 8)[:, MAX_POSITION_ERROR] for seed in (1, 2)]
    assert len({*largest[0], *largest[1]}) == 16


@pytest.fixture(scope="module")
def landing():
    return setup("landing")


@pytest.fixture(scope="module")
def landings(landing):
    return fly_many(landing.flight, 11, 32)


PAPERS = {"name": "paper"}


def test_every_landing_touches_down_on_the_pad_softly(landings):
    assert np.isfinite(landings[:, SCORE_COLUMNS.index("touchdown.t_s")]).all()
    assert landings[:, SCORE_COLUMNS.index("touchdown.horizontal_error_m")].max() < 1.0
    assert landings[:, SCORE_COLUMNS.index("touchdown.sink_rate_m_s")].max() < 0.5


def test_landing_follows_the_papers_profile(landing):
    """Hover at 3 m to 10 s, 0.3 m/s down, on the ground by about 20 s, and it stays."""
    history = fly_one(landing.flight, 11)[:, :, 0]
    height = -history[:, column("truth", "pos_d_m")] - landing.flight.vehicle.cg_above_skid_m
    assert np.abs(height[:500] - 3.0).max() < 0.3
    assert (height[600] - height[900]) / 6.0 == pytest.approx(0.3, abs=0.05)
    assert np.abs(height[1400:]).max() < 0.02
    assert np.ptp(history[1400:, column("truth", "pos_n_m")]) < 0.01


def test_takeoff_waits_climbs_at_one_metre_a_second_and_holds():
    takeoff = setup("takeoff")
    history = fly_one(takeoff.flight, 3)[:, :, 0]
    height = -history[:, column("truth", "pos_d_m")] - takeoff.flight.vehicle.cg_above_skid_m
    assert np.abs(height[:500]).max() < 0.02
    assert (height[640] - height[540]) / 2.0 == pytest.approx(1.0, abs=0.2)
    assert np.abs(height[900:] - 3.0).max() < 0.3


def test_the_papers_filter_has_its_largest_error_with_white_gps_and_metres_with_real_gps(landings):
    papers = fly_many(setup("landing", filter=PAPERS).flight, 11, 32)
    largest = np.median(papers[:, MAX_POSITION_ERROR])
    assert largest == pytest.approx(published(6)["max_position_error_m"], abs=0.06)
    assert np.median(landings[:, MAX_POSITION_ERROR]) < 0.5 * largest
    honest = setup("landing", filter=PAPERS, gps={"model": "midg"}, pad={"size_m": 20.0})
    assert np.median(fly_many(honest.flight, 11, 32)[:, MAX_POSITION_ERROR]) > 1.5


def test_a_storm_is_a_crash_and_not_a_landing():
    storm = setup("landing", filter=PAPERS, wind={"speed_20ft_m_s": 30.0}).flight
    scores = fly_many(storm, 1, 16)
    assert scores[:, SCORE_COLUMNS.index("crashed")].all()
    assert np.isnan(scores[:, SCORE_COLUMNS.index("touchdown.t_s")]).any()


def test_flying_on_truth_tracks_better_than_flying_on_the_estimate():
    def wander(feedback):
        flight = setup("landing", autopilot={"feedback": feedback}, flight={"duration_s": 9.0}).flight
        return np.std(fly_one(flight, 2)[100:, column("truth", "pos_n_m"), 0])

    assert wander("truth") < 0.5 * wander("estimate")


def test_linear_truth_reproduces_the_papers_own_experiment():
    history = fly_one(setup("takeoff", filter=PAPERS, truth="linear").flight, 1)[:, :, 0]
    down = history[:, column("truth", "pos_d_m")]
    assert down[0] - down[-1] == pytest.approx(3.0, abs=0.3)
    error = down - history[:, column("estimate", "pos_d_m")]
    assert np.abs(error).max() < 0.45


def test_record_holds_the_flight_and_survives_the_disk(landing, tmp_path):
    from flownav.record import Record

    record = fly_recorded(landing, 11, 4)
    record.save(tmp_path / "landing.fnr")
    again = Record.load(tmp_path / "landing.fnr")
    assert again.manifest["scores"] == record.manifest["scores"]
    assert again.tables.keys() == record.tables.keys()
    for name, table in record.tables.items():
        for key, values in table.items():
            assert np.array_equal(again.tables[name][key], values), (name, key)
    kinds = list(again.tables["events"]["kind"])
    assert "touchdown" in kinds
    assert "engaged" in kinds


def test_the_landing_filters_record_has_its_own_attitude_its_consistency_and_its_gate(landing):
    record = fly_recorded(landing, 11, 4)
    estimate = record.tables["estimate"]
    assert not np.array_equal(estimate["qw"], record.tables["attitude"]["qw"])
    assert np.allclose(sum(estimate[name] ** 2 for name in QUATERNION), 1.0)
    assert 3.0 < np.mean(estimate["nees"]) < 12.0
    rows = record.tables["innovation"]
    gate = landing.flight.landing.settings.gate_sigma
    assert set(rows["sensor"]) == {"gps_position", "flow_velocity"}
    assert set(rows["component"][rows["sensor"] == "flow_velocity"]) == {0, 1}
    assert rows["test_ratio"] == pytest.approx(rows["innovation"] ** 2 / (gate**2 * rows["innovation_variance"]))
    assert "pad" not in record.tables


def test_other_filters_have_the_ins_attitude_and_no_consistency():
    record = fly_recorded(setup("landing", filter=PAPERS, flight=SHORT), 11)
    assert np.array_equal(record.tables["estimate"]["qx"], record.tables["attitude"]["qx"])
    assert "nees" not in record.tables["estimate"]


def test_a_fitted_pad_fix_is_a_stream_of_the_record_valid_only_where_the_pad_is_seen():
    approach = setup("approach", flight={"duration_s": 30.0})
    record = fly_recorded(approach, 3)
    pad, truth = record.tables["pad"], record.tables["truth"]
    seen = pad["quality"] > 0.0
    assert seen.any()
    height = -np.interp(pad["t_s"], truth["t_s"], truth["pos_d_m"])
    assert height[seen].max() < 3.5
    assert not seen[height > 3.5].any()
    offset = np.column_stack([np.interp(pad["t_s"], truth["t_s"], truth[name]) for name in POSITION_NED])
    slant = np.linalg.norm(offset + np.array([0.0, 0.0, approach.flight.sensors.lens_below_cg_m]), axis=1)
    assert pad["distance_m"][seen] == pytest.approx(slant[seen], rel=0.1)


def test_flow_disengages_where_the_pad_is_too_small_for_its_view():
    engaged = fly_one(setup("landing", pad={"size_m": 0.3}, flight=SHORT).flight, 1)[:, column("flow", "engaged"), 0]
    assert engaged.sum() == 0.0


def test_another_helicopter_flies_with_gains_of_its_own(tmp_path):
    """Heavier, slower rotor: nothing is tuned to the shipped vehicle."""
    from flownav.parameter_files import shipped

    text = shipped("maxi_joker_3.toml").read_text(encoding="utf-8")
    other = tmp_path / "other.toml"
    lines = ["mass_kg = 9.0" if line.startswith("mass_kg") else line for line in text.splitlines()]
    other.write_text("\n".join(lines), encoding="utf-8")
    flight = setup("landing", vehicle={"file": str(other)}).flight
    assert flight.vehicle.mass_kg == 9.0
    scores = fly_many(flight, 1, 16)
    assert np.isfinite(scores[:, SCORE_COLUMNS.index("touchdown.t_s")]).all()
