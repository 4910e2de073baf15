"""Another estimate scored like ours: what must hold of any of them."""

from __future__ import annotations

import numpy as np
import pytest

import flownav
from flownav.core.errors import InputError
from flownav.core.record import POSITION_NED, PROTECTION_LEVELS, QUATERNION, VELOCITY_BODY
from replay_logs import log_of_flight, write_table

STATES = (*POSITION_NED, *VELOCITY_BODY)
OF_THE_PATH = ("duration_s", "outages", "velocity_rms_m_s", "truth", "end_drift_m", "protection", "coverage")


@pytest.fixture(scope="module", params=["landing", "takeoff", "paper", "dispersed", "on the truth"])
def flown(request):
    """Flights of every kind: on the navigator, from the ground, on the paper's filter, of an ensemble."""
    how = {
        "landing": {"scenario": "landing"},
        "takeoff": {"scenario": "takeoff"},
        "paper": {"scenario": "landing", "filter": "paper", "gps": "midg"},
        "dispersed": {"scenario": "approach", "dispersed": True, "flight": 2},
        "on the truth": {"scenario": "landing", "autopilot": "truth"},
    }
    return flownav.fly(**how[request.param], seed=4)


@pytest.fixture(scope="module")
def landed():
    """One landing, which nobody changes."""
    return flownav.fly("landing", seed=4)


@pytest.fixture(scope="module")
def replayed(tmp_path_factory):
    log = log_of_flight(40.0)
    folder = log.write(tmp_path_factory.mktemp("log") / "garden")
    truth = dict(
        zip(("t_s", "x_m", "y_m", "z_m"), (log.t_s, *(log.position[:, [1, 0, 2]] * [1, -1, 1]).T), strict=True)
    )
    write_table(folder / "truth.csv", {name: values[::10] for name, values in truth.items()})
    return flownav.replay(folder, gps_outages=[(20, 26)], smooth=True)


def own(record):
    """The scored table of a flight."""
    return record.flown if "flown" in record else record.estimate


def test_our_own_estimate_has_our_own_scores(flown):
    assert flown.score() == flown.scores
    assert flown.rescore(estimate=own(flown)).scores == flown.scores


def test_a_rescored_record_is_a_record(flown, tmp_path):
    other = flown.rescore(estimate=own(flown), name="theirs")
    assert other.manifest["filter"] == "theirs"
    assert other.score() == other.scores
    assert not set(other.tables) & {"states", "innovation", "fed", "flown"}
    assert flownav.load(other.save(tmp_path / "other.fnr")).scores == other.scores
    assert other.report(tmp_path / "other.html").exists()
    assert flown.scores == flown.score(), "the record itself is changed"


@pytest.mark.parametrize("state", range(6))
def test_a_shifted_estimate_gives_the_shift(flown, state):
    column = STATES[state]
    shifted = {**own(flown), column: own(flown)[column] + 0.75}
    scores = flown.rescore(estimate=shifted).scores["states"]
    for name, entry in flown.scores["states"].items():
        moved = 0.75 if name == "xyzuvw"[state] else 0.0
        assert scores[name]["mean_error"] == pytest.approx(entry["mean_error"] + moved, abs=1e-9)
        assert scores[name]["std_error"] == pytest.approx(entry["std_error"], abs=1e-9)


def test_the_truth_itself_has_no_error(flown):
    scores = flown.rescore(estimate=flown.truth).scores
    assert scores["max_position_error_m"] == 0.0
    assert {value for entry in scores["states"].values() for value in entry.values()} == {0.0}
    if scores["touchdown"] is not None and scores["touchdown"]["limited_by"]:
        parts = scores["touchdown"]["limited_by"]
        assert (parts["estimate_m"], parts["pad_m"]) == (0.0, 0.0)
        assert parts["guidance_m"] == pytest.approx(scores["touchdown"]["contact"]["distance_m"])


def test_a_drift_before_the_touchdown_is_the_estimates_part(landed):
    contact_s = landed.scores["touchdown"]["contact"]["t_s"]
    ramp = np.clip((landed.truth["t_s"] - 6.0) / (contact_s - 6.0), 0.0, 1.0)
    drifting = {**landed.truth, "pos_n_m": landed.truth["pos_n_m"] + 0.5 * ramp}
    parts = landed.rescore(estimate=drifting).scores["touchdown"]["limited_by"]
    assert parts["estimate_m"] == pytest.approx(0.5, abs=1e-9)
    assert parts["pad_m"] == pytest.approx(0.0, abs=1e-9)


def test_an_estimate_counted_from_the_handover_loses_its_offset_in_place_and_nothing_else(landed):
    shifted = {**landed.flown, **{name: landed.flown[name] + 2.0 for name in POSITION_NED}}
    found = landed.rescore(estimate=shifted, from_handover=True).scores
    assert found["max_position_error_m"] == pytest.approx(landed.scores["max_position_error_m"], abs=1e-9)
    assert found["states"]["u"] == landed.scores["states"]["u"]


def test_positions_alone_are_scored_and_the_rest_is_null(flown):
    positions = {name: own(flown)[name] for name in ("t_s", *POSITION_NED)}
    scores = flown.rescore(estimate=positions).scores
    assert {name: scores["states"][name] for name in "xyz"} == {name: flown.scores["states"][name] for name in "xyz"}
    assert {value for name in "uvw" for value in scores["states"][name].values()} == {None}
    assert scores["touchdown"] == flown.scores["touchdown"]


def test_another_rate_is_scored_at_the_truths_instants(flown):
    sparse = {name: values[::5] for name, values in own(flown).items()}
    scores = flown.rescore(estimate=sparse).scores
    for name in "xyz":
        ours, theirs = flown.scores["states"][name], scores["states"][name]
        assert theirs["rms_error"] == pytest.approx(ours["rms_error"], abs=0.02)


def test_what_an_estimate_does_not_cover_does_not_count(landed):
    early = landed.flown["t_s"] <= 12.0
    part = {name: values[early] for name, values in landed.flown.items()}
    error = landed.flown["pos_n_m"] - landed.truth["pos_n_m"]
    counted = (landed.judging["counted"] > 0.0) & early
    found = landed.rescore(estimate=part).scores
    assert found["states"]["x"]["rms_error"] == pytest.approx(np.sqrt(np.mean(error[counted] ** 2)), rel=1e-12)
    parts = found["touchdown"]["limited_by"]
    assert (parts["estimate_m"], parts["guidance_m"]) == (None, None), "it says nothing of the touchdown"
    assert parts["pad_m"] == landed.scores["touchdown"]["limited_by"]["pad_m"]
    assert found["touchdown"]["contact"] == landed.scores["touchdown"]["contact"]


# -- replays ----------------------------------------------------------------------------------------------------------
def test_a_replays_own_estimate_has_the_scores_of_its_path(replayed):
    assert replayed.score() == replayed.scores
    assert replayed.scores["truth"]["yaw_rad"] == pytest.approx(np.pi / 2, abs=0.02)
    other = replayed.rescore(estimate=replayed.estimate)
    for name in OF_THE_PATH:
        assert other.scores[name] == replayed.scores[name], name
    assert other.score() == other.scores
    assert (other.scores["consistency"], other.scores["rejected"]) == ({}, {})


def test_a_smoothed_path_scores_as_it_does_beside_ours(replayed):
    scores = replayed.rescore(estimate=replayed.smoothed).scores
    smoothed = replayed.scores["smoothed"]
    assert {name: scores[name] for name in smoothed} == smoothed
    assert scores["protection"] is None


def test_where_a_replays_estimate_begins_does_not_matter(replayed):
    moved = {**replayed.estimate, "pos_n_m": replayed.estimate["pos_n_m"] + 30.0}
    other = replayed.rescore(estimate=moved)
    for name in ("horizontal_rms_m", "velocity_rms_m_s", "vertical_rms_m"):
        assert other.scores["truth"][name] == pytest.approx(replayed.scores["truth"][name], abs=1e-9)
    ours, theirs = replayed.scores["outages"][0], other.scores["outages"][0]
    assert theirs["horizontal_rms_m"] == pytest.approx(ours["horizontal_rms_m"], abs=1e-9)
    shift = np.mean(other.truth["pos_n_m"] - replayed.truth["pos_n_m"])
    assert shift == pytest.approx(30.0, abs=1e-6), "the truth of the record lies where the estimate does"


def test_a_drift_through_the_outage_shows_in_it_alone(replayed):
    t_s = replayed.estimate["t_s"]
    drifting = {**replayed.estimate, "pos_e_m": replayed.estimate["pos_e_m"] + np.clip(t_s - 21.0, 0.0, 4.0)}
    found = replayed.rescore(estimate=drifting).scores
    assert found["outages"][0]["horizontal_max_m"] == pytest.approx(4.0, abs=0.1)
    assert found["velocity_rms_m_s"] == replayed.scores["velocity_rms_m_s"]


def test_velocity_may_be_given_in_the_earths_axes(replayed):
    bare = {name: replayed.estimate[name] for name in ("t_s", *POSITION_NED)}
    assert replayed.rescore(estimate=bare).scores["velocity_rms_m_s"] is None
    states = {name: replayed.states[name] for name in ("vel_n_m_s", "vel_e_m_s", "vel_d_m_s")}
    given = replayed.rescore(estimate=bare | states).scores["velocity_rms_m_s"]
    assert given == pytest.approx(replayed.scores["velocity_rms_m_s"], rel=1e-9)


# -- mistakes ---------------------------------------------------------------------------------------------------------
ROWS = 2501


def columns(**changes):
    """Positions of the right length, with changes; None takes a column away."""
    t_s = np.arange(ROWS) * 0.02
    found = {"t_s": t_s, **{name: np.zeros(ROWS) for name in POSITION_NED}} | changes
    return {name: values for name, values in found.items() if values is not None}


@pytest.mark.parametrize(
    ("estimate", "message"),
    [
        (columns(t_s=None), "t_s is needed, and it is missing"),
        (columns(pos_d_m=None), "pos_d_m is needed, and it is missing"),
        (columns(pos_d_m=None, pos_d_ft=np.zeros(ROWS)), "it has pos_d_ft, which is in another unit"),
        (columns(pos_n_m=None, pos_n=np.zeros(ROWS)), "it has pos_n, which is in another unit or states none"),
        (columns(t_s=np.arange(ROWS) * 20.0), "the record lasts 50 s; give seconds"),
        (columns(t_s=1000.0 + np.arange(ROWS) * 0.02), "they share no time"),
        (columns(t_s=np.arange(ROWS)[::-1] * 0.02), "t_s must be finite and increase"),
        (columns(t_s=np.full(ROWS, np.nan)), "t_s must be finite and increase"),
        (columns(pos_n_m=np.zeros(7)), "column pos_n_m has 7 rows and t_s 2501"),
        (columns(pos_n_m=np.zeros((ROWS, 3))), "column pos_n_m has shape (2501, 3)"),
        (columns(pos_n_m=["north"] * ROWS), "column pos_n_m holds something that is no number"),
        (columns(vel_u_m_s=np.zeros(ROWS)), "it has vel_u_m_s, and vel_v_m_s is missing"),
        (columns(vel_u_km_h=np.zeros(ROWS)), "vel_u_km_h: a velocity is vel_u_m_s, in metres a second"),
        (columns(**{name: np.full(ROWS, 2.0) for name in QUATERNION}), "qw, qx, qy, qz of row 0 has length 4"),
        (columns(protection_horizontal_m=np.ones(ROWS)), f"{PROTECTION_LEVELS[1]} is missing"),
        ({name: values[:1] for name, values in columns().items()}, "1 rows; two or more are needed"),
        (np.zeros((5, 4)), "ndarray is given; a mapping of columns, or a data frame"),
    ],
)
def test_a_wrong_estimate_is_one_line(landed, estimate, message):
    with pytest.raises(InputError) as caught:
        landed.rescore(estimate=estimate)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_holds_nothing_to_score_against_is_said_in_one_line(replayed):
    live = flownav.Record({"kind": "live"}, {})
    with pytest.raises(InputError, match="'live' holds nothing to score"):
        live.score()
    with pytest.raises(InputError, match="'live' holds nothing to score"):
        live.rescore(estimate=columns())
    old = flownav.fly("landing", flight={"duration_s": 6.0})
    del old.tables["judging"]
    with pytest.raises(InputError, match="fly it again with this flownav"):
        old.score()
    with pytest.raises(InputError, match="only a simulated flight has a handover"):
        replayed.rescore(estimate=replayed.estimate, from_handover=True)
