"""Margins against python-control, against the exact sampled loop, and over the vehicle's uncertainty box."""

from __future__ import annotations

from pathlib import Path

import control as ct
import numpy as np
import pytest
from scipy.linalg import expm

from flownav.control.design import gains_for
from flownav.control.gains import AutopilotGains
from flownav.control.loops import CUTS, LOOPS, Timing, exponential, loop_gains, period_map, spectral_radius
from flownav.control.margins import (
    LEAST_GAIN_DB,
    LEAST_PHASE_DEG,
    margins,
    margins_of,
    margins_over_box,
    short_of_margin,
)
from flownav.core.frames import GRAVITY_M_S2
from flownav.vehicle.kinds import load_vehicle
from flownav.vehicle.linearize import INPUTS, OUTPUTS, frequency_response, hover_plant
from flownav.vehicle.trim import trim
from gain_search import shape_gains

VEHICLE = load_vehicle()
HOVER = trim(VEHICLE)
PLANT = hover_plant(VEHICLE, HOVER)
GAINS = gains_for(VEHICLE, HOVER, 0.0)
OMEGA = np.geomspace(0.02, 400.0, 800)
S = ct.tf("s")


# -- margins of a known loop --------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    "loop",
    [
        4.0 / (S * (S + 1.0) * (0.2 * S + 1.0)),
        20.0 * (S + 1.0) / (S * S * (0.05 * S + 1.0) ** 2),
        0.8 * (S * S + 2.0 * S + 5.0) / (S * (S * S + 0.4 * S + 4.0)),
    ],
)
def test_margins_are_those_of_python_control(loop):
    w = np.geomspace(0.01, 1000.0, 6000)
    found = margins(np.asarray(ct.frequency_response(loop, w).complex), w)
    _, every_phase, _, _, at_phase, _ = ct.stability_margins(loop, returnall=True)
    every_gain = ct.stability_margins(loop, returnall=True)[0]
    assert found.phase_deg == pytest.approx(np.min(np.abs((every_phase + 180.0) % 360.0 - 180.0)), abs=0.1)
    gains_db = 20.0 * np.abs(np.log10(every_gain[np.isfinite(every_gain)]))
    assert found.gain_db == pytest.approx(np.min(gains_db, initial=np.inf), abs=0.05)
    assert found.delay_s == pytest.approx(np.min(np.radians(np.mod(every_phase, 360.0)) / at_phase), rel=1e-3)


def test_a_loop_that_lead_brings_to_its_edge_sooner_than_lag_counts_the_lead():
    """Its phase is pi - a at |L| = 1, so that a of lead, and 2 pi - a of lag, are the edge."""
    omega = np.geomspace(0.1, 10.0, 2001)
    for lead_rad in (0.3, 1.0):
        loop = -omega * np.exp(-1j * lead_rad)
        found = margins(loop.astype(complex), omega)
        assert found.phase_deg == pytest.approx(np.degrees(lead_rad), rel=1e-3)
        assert found.delay_s == pytest.approx(2.0 * np.pi - lead_rad, rel=1e-3)


def test_a_loop_that_never_reaches_one_has_no_phase_or_delay_to_lose():
    w = np.geomspace(0.01, 100.0, 500)
    found = margins(0.5 / (1.0 + 1j * w), w)
    assert found == (np.inf, np.inf, np.inf)


# -- the loops ----------------------------------------------------------------------------------------------------
def _continuous_laws(g: AutopilotGains) -> dict[str, dict[str, ct.TransferFunction]]:
    """The autopilot without sampling: each signal's transfer functions, written out once more for python-control."""
    pitch, roll = g.pitch_gain + g.pitch_integral / S, g.roll_gain + g.roll_integral / S
    yaw = g.yaw_rate_gain + g.yaw_rate_integral / S
    lift = g.collective_gain + g.collective_integral / S
    forward, right = g.forward_gain + g.forward_integral / S, g.right_gain + g.right_integral / S
    one = ct.tf(1.0, 1.0)
    return {
        "lon": {"pitch": -pitch, "pitch_command": pitch, "q_felt": -g.pitch_damping * one},
        "lat": {"roll": -roll, "roll_command": roll, "p_felt": -g.roll_damping * one},
        "ped": {"heading": -g.heading_gain * yaw, "r_felt": -yaw, "col_command": g.pedal_per_collective * one},
        "col": {"vel_d_command": -lift, "vel_d": lift},
        "pitch_command": {"vel_n_command": -forward / GRAVITY_M_S2, "vel_n": forward / GRAVITY_M_S2},
        "roll_command": {"vel_e_command": right / GRAVITY_M_S2, "vel_e": -right / GRAVITY_M_S2},
        "vel_n_command": {"pos_n": -g.position_gain * one},
        "vel_e_command": {"pos_e": -g.position_gain * one},
        "vel_d_command": {"pos_d": -g.height_gain * one},
        "q": {"q_true": one},
        "p": {"p_true": one},
        "r": {"r_true": one},
    }


def _cut_open(g: AutopilotGains, cut: str) -> ct.StateSpace:
    """All loops closed but one: from what follows the cut to what comes back to it."""
    rename = {"p": "p_true", "q": "q_true", "r": "r_true"}
    blocks = [
        ct.ss(
            PLANT.a, PLANT.b, PLANT.c, 0, inputs=[f"{name}_command" for name in INPUTS],
            outputs=[rename.get(name, name) for name in OUTPUTS], name="plant",
        )
    ]  # fmt: skip
    for signal, sources in _continuous_laws(g).items():
        out = f"{signal}_command" if signal in INPUTS else f"{signal}_felt" if signal in "pqr" else signal
        for source, law in sources.items():
            block = ct.ss(law, inputs=[source], outputs=[f"{signal}_by_{source}"], name=f"{signal}_{source}")
            blocks.append(block)
        terms = [f"{signal}_by_{source}" for source in sources]
        comes = "comes_back" if signal == cut else out
        blocks.append(ct.summing_junction(terms, comes, name=f"{signal}_sum"))
    follows = f"{cut}_command" if cut in INPUTS else f"{cut}_felt" if cut in "pqr" else cut
    return ct.interconnect(blocks, inputs=[follows], outputs=["comes_back"], warn_duplicate=False)


@pytest.mark.parametrize("loop", LOOPS)
def test_each_loop_is_python_controls_where_sampling_is_fast(loop):
    """Without sampling, delay and observer the loops are those of an interconnection by python-control."""
    plain = GAINS._replace(gust_share=0.0)
    w = np.geomspace(0.05, 100.0, 40)
    ours = loop_gains(frequency_response(PLANT, w), w, plain, Timing(1e-7, 1e-7, 0.0))[:, LOOPS.index(loop)]
    theirs = -_cut_open(plain, CUTS[loop])(1j * w)
    assert np.abs(ours - theirs).max() < 1e-3 * np.abs(theirs).max()
    assert ours == pytest.approx(theirs, rel=2e-3, abs=1e-6)


@pytest.mark.parametrize("loop", LOOPS)
@pytest.mark.parametrize("feels", [True, False])
def test_the_sampled_loop_is_at_its_edge_where_the_gain_margin_says(loop, feels):
    """Scaled by a little less than its gain margin the exact loop is stable, by a little more it is not."""
    gains = gains_for(VEHICLE, HOVER, 0.0, feels_gusts=feels)
    assert spectral_radius(PLANT, gains) < 1.0
    found = margins(loop_gains(frequency_response(PLANT, OMEGA), OMEGA, gains)[:, LOOPS.index(loop)], OMEGA)

    def radius(gain_db):
        scaled = {CUTS[loop]: 10.0 ** (gain_db / 20.0)}
        return np.abs(np.linalg.eigvals(period_map(PLANT, gains, scaled=scaled))).max()

    inside, outside = 0.95 * found.gain_db, 1.05 * found.gain_db
    assert radius(inside) < 1.0
    assert radius(-inside) < 1.0
    assert max(radius(outside), radius(-outside)) > 1.0


@pytest.mark.parametrize("feels", [True, False])
def test_every_loop_keeps_its_margins_at_every_corner_of_the_box(feels):
    box = margins_over_box(feels_gusts=feels)
    assert box.cannot_hover == ()
    corners = {row.corner for row in box.rows}
    assert len(corners) == 3 * (1 + 2**5 + 2 * 4)
    assert len(box.rows) == len(corners) * len(LOOPS)
    least_phase = min(box.rows, key=lambda row: row.margins.phase_deg)
    least_gain = min(box.rows, key=lambda row: row.margins.gain_db)
    assert least_phase.margins.phase_deg >= LEAST_PHASE_DEG, least_phase
    assert least_gain.margins.gain_db >= LEAST_GAIN_DB, least_gain


def test_an_unstable_loop_has_negative_margins():
    wild = GAINS._replace(pitch_gain=10.0 * GAINS.pitch_gain)
    assert all(row.margins.phase_deg < 0.0 for row in margins_of(PLANT, wild, "nominal"))


def test_the_plant_is_the_reduced_model_where_attitude_is_held():
    """Velocity by collective, by two derivations: the whole plant and the paper's reduced one."""
    from flownav.vehicle.linearize import reduced_model

    for frozen in (True, False):
        plant = hover_plant(VEHICLE, HOVER, freeze_inflow=frozen)
        reduced = reduced_model(VEHICLE, HOVER, freeze_inflow=frozen)
        assert plant.a[3:6, 3:6] == pytest.approx(reduced.a[3:, 3:], abs=1e-9)
        servo = list(range(14, 18))  # the servos' positions as blade angles
        assert plant.a[3:6, servo][:, 2:] == pytest.approx(reduced.b[3:, 2:], abs=1e-9)


# -- the search that shaped the gains -----------------------------------------------------------------------------
@pytest.mark.parametrize("name", ["forward", "right"])
def test_the_search_sees_the_loops_that_are_flown(name):
    """Its own cuts of one axis are those of the whole autopilot on the vehicle as stated, but for what couples axes."""
    axis = shape_gains.axis_of(name)
    ours = shape_gains.loops_of(shape_gains.shape_in(GAINS, name), axis)[0]
    whole = loop_gains(frequency_response(PLANT, shape_gains.OMEGA_RAD_S), shape_gains.OMEGA_RAD_S, GAINS)
    tilt = "pitch" if name == "forward" else "roll"
    fast = shape_gains.OMEGA_RAD_S > 3.0
    for i, loop in enumerate((tilt, f"{tilt} rate", f"velocity {name}", f"position {name}")):
        theirs = whole[:, LOOPS.index(loop)]
        assert np.abs(ours[i] - theirs)[fast].max() < 0.08 * np.abs(theirs[fast]).max(), loop


@pytest.mark.parametrize("name", ["forward", "right"])
def test_the_designed_gains_are_where_less_drift_costs_a_margin(name):
    """Turned up by a sixth, the velocity's gain drifts less, and the box no longer keeps 45 degrees and 6 dB."""
    axis, shape = shape_gains.axis_of(name), shape_gains.shape_in(GAINS, name)
    drift = shape_gains.drift_m(shape, axis)
    more = shape._replace(velocity_1_s=1.17 * shape.velocity_1_s)
    phase, gain = shape_gains.least_margins(more, axis)
    assert shape_gains.drift_m(more, axis) < drift
    assert phase < LEAST_PHASE_DEG or gain < LEAST_GAIN_DB
    assert shape_gains.drift_m(shape._replace(gust_s=1e3), axis) > 1.2 * drift  # without the observer


def test_a_shape_goes_into_the_gains_and_comes_out_again():
    shape = shape_gains.Shape(0.1, 0.02, 0.03, 1.0, 0.4, 0.2, 0.3)
    for name in ("forward", "right"):
        assert shape_gains.shape_in(shape_gains.with_shape(GAINS, shape, name), name) == pytest.approx(shape)


@pytest.mark.parametrize("name", ["quad-450", "hexa-550"])
def test_a_multirotor_keeps_its_margins_at_every_corner(name):
    box = margins_over_box(Path(name))
    assert not box.cannot_hover
    assert [(row.loop, row.corner, row.margins) for row in box.rows if short_of_margin(row)] == []
    assert len({row.corner for row in box.rows}) > 80


@pytest.mark.parametrize("size", [1e-9, 0.02, 0.7, 30.0])
def test_the_exponential_of_a_matrix_is_scipys(size):
    matrix = size * np.random.default_rng(5).normal(size=(12, 12)) / np.sqrt(12)
    known = expm(matrix)
    np.testing.assert_allclose(exponential(matrix), known, rtol=1e-11, atol=1e-13 * np.abs(known).max())


def test_the_exponential_of_nothing_is_one():
    assert np.array_equal(exponential(np.zeros((3, 3))), np.eye(3))
