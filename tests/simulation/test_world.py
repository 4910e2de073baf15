"""A world that the navigator does not know, flown: slopes, steps and edges, an engine that is cut."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flownav.campaigns.local import score_history
from flownav.core.compile import LANES
from flownav.core.errors import InputError
from flownav.core.parameter_files import check
from flownav.scoring.errors import SCORE_COLUMNS
from flownav.scoring.touchdown import names_of
from flownav.simulation.assemble import assemble
from flownav.simulation.engine import fly_blocks, fly_written
from flownav.simulation.flight_record import record_of
from flownav.simulation.history import column
from flownav.simulation.scenario import Scenario, load_scenario, with_filter


def flown(name, count=16, **tables):
    """A shipped scenario with other tables: its flight, the scores by name and the histories of its flights."""
    entries = load_scenario(name).model_dump(exclude_unset=True) | tables
    flight = assemble(check(entries, Scenario, name)).flight
    histories = [history.copy() for _, history in fly_blocks(flight, 1, 0, count, lambda found: found.copy())]
    history = np.concatenate(histories, axis=2)
    return flight, dict(zip(SCORE_COLUMNS, score_history(flight, history).T, strict=True)), history


def landed(scores):
    return (scores["touchdown.broken"] == 0.0) & np.isfinite(scores["touchdown.rest.t_s"])


# -- ground --------------------------------------------------------------------------------------------------------
def test_on_a_slope_it_lands_comes_to_rest_along_it_and_is_no_crash():
    slope = {"slope_deg": 3.0, "uphill_deg": 90.0, "rough_rms_m": 0.003}
    flight, scores, history = flown("landing", ground=slope)
    assert landed(scores).all()
    east = history[-1, column("truth", "pos_e_m")]
    ground = history[-1, column("truth", "ground_m")]
    assert np.abs(ground - math.tan(math.radians(3.0)) * east).max() < 0.01
    roll = np.degrees(2.0 * np.arcsin(history[-1, column("truth", "qx")]))
    assert roll == pytest.approx(-3.3, abs=1.2)
    height = -history[-1, column("truth", "pos_d_m")] - ground
    assert height == pytest.approx(flight.vehicle.cg_above_skid_m, abs=0.02)


def test_down_the_hill_below_the_pads_height_is_not_below_the_ground():
    """Ten metres downhill of the pad the ground is half a metre lower than the pad; a crash is below that."""
    path = [
        {"t_s": 0.0, "north_m": -10.0, "height_m": 2.5}, {"t_s": 10.0, "north_m": -10.0, "height_m": 2.5},
        {"t_s": 50.0, "north_m": -10.0, "height_m": -9.5},
    ]  # fmt: skip
    entries = load_scenario("landing").flight.model_dump(exclude_unset=True) | {"path": path}
    _, scores, history = flown("landing", flight=entries, ground={"slope_deg": 3.0, "uphill_deg": 0.0})
    assert (history[-1, column("truth", "pos_d_m")] > 0.1).all()
    assert landed(scores).all()


def test_over_a_decks_edge_and_back_the_range_jumps_and_the_landing_holds():
    """From the pad on a deck out over the edge, a metre down, and back: the navigator's range sees two grounds.

    Until it believes in each, flow is taken over a height that is wrong by a metre: it lands some 0.7 m off, 0.5 m
    farther than over one ground.
    """
    path = [
        {"t_s": 0.0, "height_m": 0.0}, {"t_s": 5.0, "height_m": 0.0}, {"t_s": 8.0, "height_m": 2.0},
        {"t_s": 14.0, "north_m": 6.0, "height_m": 2.0}, {"t_s": 17.0, "north_m": 6.0, "height_m": 2.0},
        {"t_s": 23.0, "height_m": 2.0}, {"t_s": 25.0, "height_m": 2.0}, {"t_s": 50.0, "height_m": -5.5},
    ]  # fmt: skip
    entries = load_scenario("pad_return").flight.model_dump(exclude_unset=True) | {"path": path}
    edge = {"step_m": -1.0, "edge_north_m": 4.0, "edge_toward_deg": 0.0}
    _, scores, history = flown("pad_return", flight=entries, ground=edge)
    out = history[:, column("truth", "pos_n_m")].max(axis=0)
    assert (out > 5.0).all()
    assert (history[900, column("truth", "ground_m")] == -1.0).all()
    over = -history[:, column("truth", "pos_d_m")] - history[:, column("truth", "ground_m")]
    assert over[840:900].mean(axis=0) == pytest.approx(2.2, abs=0.3)  # it flies over the ground that it finds
    assert over[100:].min() > 0.15  # and meets neither the edge's face nor the deck but with its skids
    assert landed(scores).all()
    assert np.median(scores["touchdown.rest.distance_m"]) < 1.2


# -- the engine ------------------------------------------------------------------------------------------------------
def test_an_engine_cut_in_hover_comes_down_on_what_the_rotor_still_turns():
    """From 2.5 m a fall would be 7 m/s at the skids."""
    cut = [{"at_s": 12.0, "kind": "engine cut"}]
    _, scores, history = flown("landing", event=cut)
    contact = scores["touchdown.contact.t_s"]
    assert ((contact > 12.5) & (contact < 15.0)).all()
    assert (scores["touchdown.contact.sink_rate_m_s"] < 2.5).all()
    assert landed(scores).mean() > 0.7
    assert np.isfinite(history[:, column("truth", "pos_d_m")]).all()


def test_a_crash_after_an_engine_cut_says_so():
    _, scores, _ = flown("sortie", event=[{"at_s": 45.0, "kind": "engine cut"}])
    crashed = scores["touchdown.broken"] > 0.0
    assert crashed.any()
    assert all(names_of(bits) for bits in scores["touchdown.broken"][crashed])


def test_slow_servos_and_a_stuck_tail_rotor_are_flown_and_a_record_tells_of_them():
    _, slow, _ = flown("landing", event=[{"at_s": 12.0, "kind": "cyclic servos slow"}])
    assert landed(slow).all()
    _, _, history = flown("landing", event=[{"at_s": 12.0, "kind": "tail rotor stuck"}])
    pedal = history[:, column("command", "ped_rad")]
    assert (pedal[602:] == pedal[602]).all()
    assert pedal[:600].std() > 0.0
    entries = load_scenario("landing").model_dump(exclude_unset=True)
    both = [{"at_s": 12.0, "kind": "cyclic servos slow"}, {"at_s": 13.0, "kind": "tail rotor stuck"}]
    setup = assemble(check(entries | {"event": both}, Scenario, "both"))
    events = record_of(setup, fly_written(setup.flight, 1, 0, LANES), 1, 0).tables["events"]
    told = {kind: t for kind, t in zip(events["kind"], events["t_s"], strict=True)}
    assert (told["cyclic servos slow"], told["tail rotor stuck"]) == (pytest.approx(12.0), pytest.approx(13.0))


def test_a_motor_that_is_out_turns_a_hexa_over():
    """No law of ours flies on five: the outcome is reported as it is."""
    _, scores, _ = flown("landing", vehicle="hexa-550", event=[{"at_s": 12.0, "kind": "motor out"}])
    assert (scores["touchdown.broken"] > 0.0).all()


@pytest.mark.parametrize(
    ("vehicle", "kind", "of"),
    [
        ("maxi-joker-3", "motor out", "multirotor"),
        ("quad-450", "tail rotor stuck", "helicopter"),
        ("hexa-550", "cyclic servos slow", "helicopter"),
    ],
)
def test_what_cannot_befall_a_vehicle_is_refused(vehicle, kind, of):
    entries = load_scenario("landing").model_dump(exclude_unset=True)
    event = [{"at_s": 12.0, "kind": kind}]
    with pytest.raises(InputError, match=rf"\[\[event\]\] {kind}: of a {of} only; this vehicle has none"):
        assemble(check(entries | {"vehicle": vehicle, "event": event}, Scenario, "refused"))


def test_a_descent_of_three_metres_a_second_is_flown_slower_than_a_vortex_ring():
    path = [{"t_s": 0.0, "height_m": 20.0}, {"t_s": 5.0, "height_m": 20.0}, {"t_s": 15.0, "height_m": -10.0}]
    entries = load_scenario("landing").flight.model_dump(exclude_unset=True) | {"path": path}
    flight, scores, history = flown("landing", flight=entries)
    down = np.diff(history[:, column("truth", "pos_d_m")], axis=0) / 0.02
    assert np.median(down[300:450]) == pytest.approx(flight.gains.sink_limit_m_s, rel=0.15)
    assert np.percentile(down[250:], 99.0) < 2.4  # a ring begins at 1.6 and is whole at 3.2
    assert landed(scores).all()


def test_a_record_says_when_the_engine_was_cut():
    entries = load_scenario("landing").model_dump(exclude_unset=True)
    setup = assemble(check(entries | {"event": [{"at_s": 12.005, "kind": "engine cut"}]}, Scenario, "cut"))
    record = record_of(setup, fly_written(setup.flight, 1, 0, LANES), 1, 3, lane=3)
    events = record.tables["events"]
    at = list(events["kind"]).index("engine cut")
    assert events["t_s"][at] == pytest.approx(12.02)
    assert events["value"][at] == pytest.approx(2.6, abs=0.4)  # half a metre below 3 m, and the skids' 0.22


def test_a_cut_after_the_landing_breaks_nothing():
    _, scores, _ = flown("landing", event=[{"at_s": 40.0, "kind": "engine cut"}])
    assert landed(scores).all()


def test_a_quads_motors_stop_too():
    cut = [{"at_s": 12.0, "kind": "engine cut"}]
    _, scores, _ = flown("landing", vehicle="quad-450", event=cut)
    assert (scores["touchdown.contact.sink_rate_m_s"] > 2.0).all()


# -- the paper's flights stay the paper's -----------------------------------------------------------------------
def test_the_papers_filter_flies_the_papers_helicopter():
    """No slop, no wake, inflow in balance, a rotor that keeps its speed: its flights have the bytes that they had."""
    own, papers = (assemble(with_filter(load_scenario("landing"), name)).flight for name in ("landing", "paper"))
    assert own.vehicle.cyclic_dead_band_rad > 0.0
    assert papers.vehicle.cyclic_dead_band_rad == papers.vehicle.pedal_dead_band_rad == 0.0
    assert (papers.recirculation.loss, papers.recirculation.unsteady) == (0.0, 0.0)
    assert own.recirculation.unsteady > 0.0
    assert not papers.plan.draws.recirculation


def test_the_linear_truth_has_no_ground_and_no_engine():
    entries = load_scenario("landing").model_dump(exclude_unset=True) | {"truth": "linear", "filter": {"name": "paper"}}
    for extra in ({"ground": {"slope_deg": 1.0}}, {"event": [{"at_s": 1.0, "kind": "engine cut"}]}):
        with pytest.raises(InputError, match=r"remove \[ground\], \[\[event\]\]"):
            assemble(Scenario.model_validate(entries | extra))
