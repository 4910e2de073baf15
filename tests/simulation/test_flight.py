"""The closed loop: bit-identical alone, in any batch and on any number of threads; flies, lands, and is scored."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.campaigns.local import counted_steps, fly_many, fly_recorded, score_history
from flownav.core.parameter_files import check, shipped
from flownav.core.record import POSITION_NED, QUATERNION, VELOCITY_BODY, Record
from flownav.scoring.errors import MAX_POSITION_ERROR, SCORE_COLUMNS, published, touchdown_rows
from flownav.scoring.landings import column_of, succeeded
from flownav.scoring.touchdown import TOUCHDOWN_COLUMNS, names_of
from flownav.simulation.assemble import assemble
from flownav.simulation.engine import fly_blocks, fly_one
from flownav.simulation.history import column, columns
from flownav.simulation.scenario import SHIPPED, Scenario, load_scenario

SHORT, SOON, PAPERS = {"duration_s": 3.0}, {"handover_s": 1.0}, {"name": "paper"}
STATES = (*POSITION_NED, *VELOCITY_BODY)
TOUCHDOWN_S, OFF_M, SINK_M_S, BROKEN = (
    SCORE_COLUMNS.index(name)
    for name in (
        "touchdown.contact.t_s",
        "touchdown.contact.distance_m",
        "touchdown.contact.sink_rate_m_s",
        "touchdown.broken",
    )
)


def setup(name, **sections):
    entries = load_scenario(name).model_dump(exclude_unset=True)
    for key, value in sections.items():
        entries[key] = {**entries.get(key, {}), **value} if isinstance(value, dict) else value
    return assemble(check(entries, Scenario, "test"))


def height_of(flight, history):
    return -history[:, column("truth", "pos_d_m")] - flight.vehicle.cg_above_skid_m


# -- the same bytes --------------------------------------------------------------------------------------------
@pytest.mark.parametrize("filter_", [SOON, PAPERS], ids=["the navigator", "the paper's filter"])
@pytest.mark.parametrize("name", SHIPPED)
def test_a_flight_is_the_same_bytes_alone_in_any_batch_and_on_any_threads(name, filter_):
    flight = setup(name, flight=SHORT, filter=filter_).flight
    alone = [fly_one(flight, 5, k)[:, :, 0] for k in range(20)]
    for threads, first, count in ((1, 0, 20), (2, 0, 20), (3, 0, 20), (2, 13, 7)):
        blocks = [block for _, block in fly_blocks(flight, 5, first, count, np.copy, threads)]
        together = np.concatenate(blocks, axis=2)
        for k in range(count):
            assert np.array_equal(together[:, :, k], alone[first + k], equal_nan=True), (threads, first, k)
    scores = np.concatenate([score_history(flight, history[:, :, None]) for history in alone])
    assert np.array_equal(fly_many(flight, 5, 20), scores, equal_nan=True)


def test_seeds_and_flights_differ():
    flight = setup("landing", flight=SHORT, filter=SOON).flight
    largest = [fly_many(flight, seed, 8)[:, MAX_POSITION_ERROR] for seed in (1, 2)]
    assert len({*largest[0], *largest[1]}) == 16


# -- the navigator flies -----------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def landing():
    return setup("landing")


@pytest.fixture(scope="module")
def landings(landing):
    return fly_many(landing.flight, 11, 32)


def test_every_landing_touches_down_on_the_pad_softly(landings):
    assert np.isfinite(landings[:, TOUCHDOWN_S]).all()
    assert landings[:, OFF_M].max() < 1.0
    assert landings[:, SINK_M_S].max() < 0.5


def test_landing_follows_the_papers_profile(landing):
    """Hover at 3 m to 10 s, 0.3 m/s down, on the ground by about 20 s, and it stays."""
    history = fly_one(landing.flight, 11)[:, :, 0]
    height = height_of(landing.flight, history)
    assert np.abs(height[:500] - 3.0).max() < 0.3
    assert (height[600] - height[900]) / 6.0 == pytest.approx(0.3, abs=0.05)
    assert np.abs(height[1400:]).max() < 0.02
    assert np.ptp(history[1400:, column("truth", "pos_n_m")]) < 0.01


def test_takeoff_waits_climbs_at_one_metre_a_second_and_holds():
    takeoff = setup("takeoff")
    history = fly_one(takeoff.flight, 3)[:, :, 0]
    height = height_of(takeoff.flight, history)
    assert np.abs(height[:500]).max() < 0.02
    assert (height[640] - height[540]) / 2.0 == pytest.approx(1.0, abs=0.2)
    assert np.abs(height[900:] - 3.0).max() < 0.5


def test_until_the_hand_over_it_is_flown_on_the_truth_and_then_on_an_estimate_that_starts_there(landing):
    history = fly_one(landing.flight, 11)
    error = history[:, columns("estimate", STATES)] - history[:, columns("truth", STATES)]
    handed = round(landing.scenario.filter.handover_s / 0.02)
    assert not error[:handed].any()
    assert 0.0 < np.abs(error[handed, :3]).max() < 0.05
    counted = counted_steps(landing.flight, history)[:, 0]
    contact = history[:, column("truth", "contact_n"), 0]
    assert not counted[:handed].any()
    np.testing.assert_array_equal(counted[handed:], contact[handed:] <= 0.0)
    scores = score_history(landing.flight, history)[0]
    assert scores[MAX_POSITION_ERROR] == np.abs(error[counted > 0.0, :3]).max()


def test_a_flight_that_ends_before_the_hand_over_has_no_errors_to_score():
    flight = setup("landing", flight=SHORT).flight
    assert np.isnan(fly_many(flight, 1, 2)[:, : MAX_POSITION_ERROR + 1]).all()


def test_at_its_horizon_the_navigator_errs_by_what_the_horizons_columns_say():
    """On a climb at 1 m/s, where an instant 20 ms off would show as 20 mm."""
    takeoff = setup("takeoff", flight={"duration_s": 14.0})
    history, record = fly_one(takeoff.flight, 11, 4)[:, :, 0], fly_recorded(takeoff, 11, 4)
    behind = takeoff.flight.table.horizon_epochs
    said = history[:, columns("horizon", tuple(f"error_{name}" for name in STATES))]
    estimate, truth = record.tables["estimate"], record.tables["truth"]
    t_s = (np.arange(len(history)) - behind) * 0.02
    climbing = (t_s > 11.0) & (t_s < 13.0)
    for i, name in enumerate(POSITION_NED):
        error = estimate[name] - np.interp(estimate["t_s"], truth["t_s"], truth[name])
        difference = said[climbing, i] - np.interp(t_s[climbing], estimate["t_s"], error)
        assert abs(difference.mean()) < 0.004, name
        assert np.abs(difference).max() < 0.05, name
    assert np.isnan(said[:behind]).all()


def test_flying_on_truth_stays_nearer_to_the_path_than_flying_on_the_estimate():
    """With a real receiver by metres; with white fixes by centimetres."""

    def wander(feedback, **more):
        """Rms distance from the pad's middle, north and east, of sixteen hovers."""
        hover = {"duration_s": 30.0, "path": [{"t_s": t_s, "height_m": 3.0} for t_s in (0.0, 30.0)]}
        flight = setup("landing", autopilot={"feedback": feedback}, flight=hover, **more).flight
        (found,) = (block for _, block in fly_blocks(flight, 2, 0, 16, np.copy))
        return np.sqrt(np.mean(found[750:, columns("truth", STATES[:2])] ** 2))

    real = {"gps": {"model": "midg"}}
    assert wander("truth", **real) < 0.95 * wander("estimate", **real)
    assert wander("truth") < wander("estimate") < 0.12


def test_another_helicopter_flies_with_gains_of_its_own(tmp_path):
    """Heavier, slower rotor: nothing is tuned to the shipped vehicle."""
    text = shipped("maxi_joker_3.toml").read_text(encoding="utf-8")
    other = tmp_path / "other.toml"
    lines = ["mass_kg = 9.0" if line.startswith("mass_kg") else line for line in text.splitlines()]
    other.write_text("\n".join(lines), encoding="utf-8")
    flight = setup("landing", vehicle={"file": str(other)}).flight
    assert flight.vehicle.mass_kg == 9.0
    scores = fly_many(flight, 1, 16)
    assert np.isfinite(scores[:, TOUCHDOWN_S]).all()


# -- the paper's filter --------------------------------------------------------------------------------------------
def test_the_papers_filter_has_its_largest_error_with_white_gps_and_metres_with_real_gps():
    papers = fly_many(setup("landing", filter=PAPERS).flight, 11, 32)
    largest = np.median(papers[:, MAX_POSITION_ERROR])
    assert largest == pytest.approx(published(6)["max_position_error_m"], abs=0.06)
    honest = setup("landing", filter=PAPERS, gps={"model": "midg"}, pad={"size_m": 20.0})
    assert np.median(fly_many(honest.flight, 11, 32)[:, MAX_POSITION_ERROR]) > 1.5


def test_a_storm_is_a_crash_and_not_a_landing():
    storm = setup("landing", filter=PAPERS, wind={"speed_20ft_m_s": 30.0}).flight
    scores = fly_many(storm, 1, 16)
    assert (scores[:, BROKEN] > 0.0).mean() > 0.9
    assert np.isnan(scores[:, TOUCHDOWN_S]).any()
    landed = np.isfinite(scores[:, TOUCHDOWN_S]) & (scores[:, BROKEN] == 0.0)
    assert not (landed & (scores[:, OFF_M] < 1.0)).any()


def test_a_rollover_after_a_soft_contact_is_a_crash():
    """In 16 m/s some flights touch down below the limit of sink rate, slide and roll over; none of them has landed."""
    storm = setup("landing", filter=PAPERS, wind={"speed_20ft_m_s": 16.0}).flight
    landings = touchdown_rows(fly_many(storm, 1, 64))
    rolled = landings[
        np.array(["rolled over" in names_of(bits) for bits in landings[:, TOUCHDOWN_COLUMNS.index("broken")]])
    ]
    soft = rolled[:, column_of("contact", "sink_rate_m_s")] < storm.limits.max_sink_rate_m_s
    assert soft.any()
    assert not succeeded(rolled).any()


def test_linear_truth_reproduces_the_papers_own_experiment():
    history = fly_one(setup("takeoff", filter=PAPERS, truth="linear").flight, 1)[:, :, 0]
    down = history[:, column("truth", "pos_d_m")]
    assert down[0] - down[-1] == pytest.approx(3.0, abs=0.3)
    error = down - history[:, column("estimate", "pos_d_m")]
    assert np.abs(error).max() < 0.45


def test_the_papers_flow_disengages_where_the_pad_is_too_small_for_its_view():
    small = setup("landing", pad={"size_m": 0.3}, flight=SHORT, filter=PAPERS)
    assert fly_one(small.flight, 1)[:, column("flow", "engaged"), 0].sum() == 0.0


# -- records -------------------------------------------------------------------------------------------------------
def test_record_holds_the_flight_and_survives_the_disk(landing, tmp_path):
    record = fly_recorded(landing, 11, 4)
    record.save(tmp_path / "landing.fnr")
    again = Record.load(tmp_path / "landing.fnr")
    assert again.manifest["scores"] == record.manifest["scores"]
    assert again.tables.keys() == record.tables.keys()
    for name, table in record.tables.items():
        for key, values in table.items():
            exact = values.dtype.kind != "f"
            assert np.array_equal(again.tables[name][key], values, equal_nan=not exact), (name, key)
    assert {"start", "touchdown"} <= set(again.tables["events"]["kind"])


def test_a_navigated_record_has_its_own_attitude_its_consistency_its_gate_and_what_was_flown_on(landing):
    record = fly_recorded(landing, 11, 4)
    assert np.allclose(sum(record.tables["estimate"][name] ** 2 for name in QUATERNION), 1.0)
    rows = record.tables["innovation"]
    gate = landing.fitted.given.settings.gate_sigma
    known = np.isfinite(rows["test_ratio"])
    ratio = rows["innovation"] ** 2 / (gate**2 * rows["innovation_variance"])
    assert rows["test_ratio"][known] == pytest.approx(ratio[known])
    assert {"gps_position", "flow_rate", "range", "baro", "mag", "landed"} <= set(rows["sensor"])
    assert "pad" not in record.tables
    flown, truth = record.tables["flown"], record.tables["truth"]
    np.testing.assert_array_equal(flown["t_s"], truth["t_s"])
    early = truth["t_s"] < landing.scenario.filter.handover_s
    np.testing.assert_array_equal(flown["pos_n_m"][early], truth["pos_n_m"][early])
    assert np.isfinite(record.tables["consistency"]["nees"]).all()
    assert record.tables["consistency"]["t_s"][-1] == pytest.approx(50.0 - landing.fitted.schedule.horizon_s)


def test_the_papers_filter_has_the_ins_attitude_and_no_consistency():
    record = fly_recorded(setup("landing", filter=PAPERS, flight=SHORT), 11)
    assert np.array_equal(record.tables["estimate"]["qx"], record.tables["attitude"]["qx"])
    assert not {"consistency", "flown", "fed"} & set(record.tables)


def test_a_fitted_pad_camera_is_a_stream_of_the_record_only_where_the_pad_is_seen():
    near = {"max_height_m": 0.6}  # of the inner tag: five times as far for the outer
    approach = setup("approach", flight={"duration_s": 45.0}, autopilot={"feedback": "truth"}, pad_fix=near)
    record = fly_recorded(approach, 3)
    pad, truth = record.tables["pad"], record.tables["truth"]
    then_s = pad["t_s"] - record.manifest["delays_s"]["pad"]
    height = -np.interp(then_s, truth["t_s"], truth["pos_d_m"])
    seen = pad["quality"] > 0.0
    assert seen.sum() > 30
    assert height[seen].max() < 4.0
    assert pad["distance_m"][seen] == pytest.approx(height[seen], abs=0.5)


def test_texture_of_the_pad_alone_leaves_flow_blind_beside_it():
    sensors = {"texture": "pad"}
    small, whole = (
        fly_recorded(setup("landing", pad={"size_m": size_m}, flight=SHORT, sensors=sensors), 1).tables["flow_rate"]
        for size_m in (0.3, 20.0)
    )
    assert small["quality"].max() < whole["quality"].min()
