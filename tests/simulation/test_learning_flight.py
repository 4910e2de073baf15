"""A helicopter that learns itself in hover: when it may, when it breaks off, what a record says of it."""

from __future__ import annotations

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from flownav.campaigns.local import fly_recorded
from flownav.cli import app
from flownav.control.autopilot import hovering
from flownav.control.design import gains_for, nominal_model
from flownav.control.guidance import Knowledge
from flownav.control.learning import AGAIN_EPOCHS, LONGEST_EPOCHS, TRIES, Learnt
from flownav.control.learnt_gains import loop_gains_of
from flownav.control.learnt_margins import SIDED_95, margins_of_record
from flownav.control.margins import LEAST_GAIN_DB, LEAST_PHASE_DEG
from flownav.core.compile import LANES
from flownav.core.errors import InputError
from flownav.simulation.assemble import assemble
from flownav.simulation.engine import fly_written
from flownav.simulation.learning import mind
from flownav.simulation.records import Estimated, Home
from flownav.simulation.scenario import load_scenario, with_filter
from flownav.vehicle.kinds import load_vehicle
from flownav.vehicle.trim import trim

VEHICLE = load_vehicle()
HOVER = trim(VEHICLE)
GAINS = gains_for(VEHICLE, HOVER, 0.0)
NOTHING = Learnt(*(0.0,) * len(Learnt._fields))
KNOWS = Knowledge(pad_found=1.0, ground_found=1.0, pad_unseen_s=0.0, sigma_m=0.02, doubted=0.0)
HOME = Home(*(0.0,) * len(Home._fields))
HIGH = Estimated(0.0, 0.0, -5.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
FLIES = hovering(GAINS)._replace(pitch_sine=0.0, roll_sine=0.0)


def minded(before=NOTHING, autopilot=FLIES, stated=HIGH, known=KNOWS, passed=10):
    """One epoch of a vehicle that may learn."""
    return mind.law(before, autopilot, stated, HOME, known, gains=GAINS, passed=passed)


def test_it_counts_the_epochs_of_a_stir_and_a_landing_waits_for_it():
    after = minded(NOTHING._replace(since=41.0))
    assert after.learnt.since == 42.0
    assert after.learnt.state == 0.0
    assert after.autopilot.learns == 1.0
    done = minded(NOTHING._replace(since=900.0, state=1.0))
    assert done.autopilot.learns == 0.0


@pytest.mark.parametrize(
    "changed",
    [
        {"autopilot": FLIES._replace(flying=0.0)},
        {"autopilot": FLIES._replace(away=1.0)},
        {"autopilot": FLIES._replace(pitch_sine=0.3)},
        {"autopilot": FLIES._replace(roll_sine=-0.3)},
        {"stated": HIGH._replace(pos_d_m=-0.9 + GAINS.pad_pos_d_m)},
    ],
)
def test_on_the_skids_going_around_far_from_its_tilt_or_low_it_breaks_off_and_begins_anew(changed):
    broken = minded(NOTHING._replace(since=300.0), **changed).learnt
    assert (broken.state, broken.tries, broken.since) == (0.0, 1.0, -float(AGAIN_EPOCHS))
    waits = minded(broken, **changed).learnt
    assert (waits.tries, waits.since) == (1.0, -float(AGAIN_EPOCHS))  # it counts once
    again = broken
    for _ in range(AGAIN_EPOCHS + 1):
        again = minded(again).learnt
    assert again.since == 1.0
    last = minded(NOTHING._replace(since=300.0, tries=TRIES - 1.0), **changed)
    assert last.learnt.state == -2.0


def test_a_height_that_is_only_gps_is_no_height_to_break_off_for():
    low = HIGH._replace(pos_d_m=-0.5 + GAINS.pad_pos_d_m)
    assert minded(NOTHING._replace(since=300.0), stated=low, known=KNOWS._replace(ground_found=0.0)).learnt.tries == 0.0


def test_it_is_given_up_after_a_minute_and_a_landing_waits_no_longer():
    late = minded(NOTHING._replace(since=-5.0), passed=LONGEST_EPOCHS + 1)
    assert late.learnt.state == -2.0
    assert late.autopilot.learns == 0.0


# -- in flight ----------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def approach():
    return assemble(load_scenario("approach"))


@pytest.fixture(scope="module")
def recorded(approach):
    return fly_recorded(approach, 3, 0, approach.ensemble())


def test_a_flights_record_says_what_it_learnt_which_gives_the_margins_that_its_gains_keep(recorded):
    learnt = recorded.manifest["learnt"]
    assert learnt["verdict"] == "learnt"
    assert learnt["gains"]["pitch_gain"] > 1.3 * GAINS.pitch_gain  # what the whole box leaves
    found = margins_of_record(recorded.manifest, "the flight").rows
    assert {row.loop for row in found} >= {"pitch", "roll", "velocity forward", "position right"}
    assert LEAST_PHASE_DEG - 1.0 < min(row.margins.phase_deg for row in found) < 90.0
    assert LEAST_GAIN_DB - 0.2 < min(row.margins.gain_db for row in found) < 20.0


def test_the_command_prints_them_of_a_record(recorded, tmp_path):
    path = tmp_path / "approach.fnr"
    recorded.save(path)
    told = CliRunner().invoke(app, ["vehicle", str(path), "--margins", "--json"])
    rows = json.loads(told.stdout)["margins"]
    asked = margins_of_record(recorded.manifest, "the flight").rows
    assert [(row["loop"], row["corner"], row["phase_deg"]) for row in rows] == [
        (row.loop, row.corner, row.margins.phase_deg) for row in asked
    ]
    shown = CliRunner().invoke(app, ["vehicle", str(path), "--margins"])
    assert "11 corners; signs: stiffness, lag, drag" in shown.stdout


def test_a_flight_that_learnt_nothing_has_no_margins_of_it():
    with pytest.raises(InputError, match=r"the flight: no vehicle was learnt \(too unsure\); `flownav fly approach`"):
        margins_of_record({"learnt": {"verdict": "too unsure"}, "parameters": {}}, "the flight")
    with pytest.raises(InputError, match="not to learn its vehicle"):
        margins_of_record({"parameters": {}}, "the flight")


def test_what_it_learns_is_its_own_vehicle_within_what_it_says(approach):
    ensemble = approach.ensemble()
    flown = fly_written(approach.flight, 5, 0, LANES, ensemble)
    truths = ensemble.truths(5, 0, len(LANES))
    off, said = [], []
    for (learnt, gains), truth in zip(flown.learnt, truths, strict=True):
        assert learnt.state == 1.0
        assert gains != loop_gains_of(approach.flight.gains)
        own = nominal_model(truth.vehicle, trim(truth.vehicle), -1)
        lag = 1.0 / own.flap_rate_1_s + 2.0 * own.servo_damping / own.servo_rad_s
        true = np.array([own.pitch_stiffness_1_s2, own.roll_stiffness_1_s2, lag])
        off.append(np.log(np.array([learnt.pitch_stiffness_1_s2, learnt.roll_stiffness_1_s2, learnt.lag_s]) / true))
        said.append([learnt.std_pitch_stiffness, learnt.std_roll_stiffness, learnt.std_lag])
    inside = np.abs(off) < SIDED_95 * np.array(said)
    assert inside.mean() > 0.85
    assert np.sqrt(np.mean(np.square(off), axis=0)).max() < 0.05


def test_the_papers_filter_and_multirotors_learn_nothing():
    assert assemble(load_scenario("landing")).flight.learns.begins == 0
    assert assemble(load_scenario("takeoff")).flight.learns.begins < 0
    assert assemble(with_filter(load_scenario("landing"), "paper")).flight.learns is None
    scenario = load_scenario("approach")
    quad = scenario.vehicle.model_copy(update={"file": "quad-450"})
    assert assemble(scenario.model_copy(update={"vehicle": quad})).flight.learns is None


def test_the_gate_is_finer_for_a_vehicle_that_learns():
    scenario = load_scenario("approach")
    quad = scenario.model_copy(update={"vehicle": scenario.vehicle.model_copy(update={"file": "quad-450"})})
    learning = scenario.autopilot.model_copy(update={"learning": None})
    never = scenario.model_copy(update={"autopilot": learning})
    assert assemble(scenario).flight.gains.align_radius_m == scenario.autopilot.learning.align_radius_m == 0.012
    for other in (quad, never):
        assert assemble(other).flight.gains.align_radius_m == scenario.autopilot.precision.align_radius_m == 0.025
