"""Laws tried beside the shipped one: their margins, their exact sampled loops, and what INDI's outer loop is."""

from __future__ import annotations

import json

import numpy as np
import pytest

from flownav.control.autopilot import Estimate, hovering, outer_loop
from flownav.control.design import gains_for, nominal_model
from flownav.control.gains import AutopilotGains
from flownav.control.guidance import Knowledge, Reference
from flownav.control.loops import OUTER_S, spectral_radius
from flownav.control.margins import margins
from flownav.core.frames import GRAVITY_M_S2, quaternion_from_euler, rotation_from_quaternion
from flownav.vehicle.kinds import load_vehicle
from flownav.vehicle.linearize import INPUTS, OUTPUTS, frequency_response, gust_input, hover_plant
from flownav.vehicle.trim import trim
from gain_search import flight_laws, other_laws, shape_gains

VEHICLE = load_vehicle()
HOVER = trim(VEHICLE)
PLANT = hover_plant(VEHICLE, HOVER)
GAINS = gains_for(VEHICLE, HOVER, 0.0)
STATED = nominal_model(VEHICLE, HOVER, -1)
# near what the searches found: every law is stable with these
NUMBERS = {
    "observer (shipped)": (0.15, 0.1, 0.02, 0.9, 0.36, 0.2, 0.28, 1.0, 1.0),
    "without the observer": (0.15, 0.1, 0.02, 0.9, 0.36, 0.2, 1.0, 1.0, 1.0),
    "observer, wind state": (0.15, 0.1, 0.02, 0.9, 0.36, 0.2, 0.28, 0.3, 0.1),
    "observer, INDI": (6.0, 2.0, 1.0, 0.9, 0.36, 0.2, 0.28, 25.0, 1.0),
}


def of_the_vehicle_as_stated(name):
    """An axis of the nominal vehicle alone."""
    seen, cyclic, _ = shape_gains.AXES[name]
    rows = [OUTPUTS.index(output) for output in seen]
    by_gust = gust_input(VEHICLE, HOVER)[:, [0 if name == "forward" else 1]]
    answers = frequency_response(PLANT, shape_gains.OMEGA_RAD_S)[:, rows, INPUTS.index(cyclic)].T
    blown = frequency_response(PLANT._replace(b=by_gust), shape_gains.OMEGA_RAD_S)[:, rows, 0].T
    axis = shape_gains.Axis(name, answers[None], blown[None], (PLANT,))
    return other_laws.Case("nominal", axis, STATED, GAINS)


def test_the_least_margins_of_many_loops_are_those_of_each():
    generator, w = np.random.default_rng(7), shape_gains.OMEGA_RAD_S
    loops = []
    for _ in range(40):
        gain, corner, late = generator.uniform((0.3, 0.5, 0.0), (30.0, 20.0, 0.2))
        loops.append(gain * np.exp(-1j * w * late) / (1j * w * (1.0 + 1j * w / corner)))
    each = [margins(loop, w) for loop in loops]
    phase, gain = other_laws.least_of(np.array(loops))
    assert phase == pytest.approx(min(one.phase_deg for one in each), abs=1e-9)
    assert gain == pytest.approx(min(one.gain_db for one in each), abs=1e-9)


@pytest.mark.parametrize("name", ["forward", "right"])
@pytest.mark.parametrize("law", flight_laws.LAWS, ids=lambda law: law.name)
def test_the_exact_loop_of_a_law_comes_to_its_edge_where_its_margin_says(law, name):
    """Two derivations: frequency responses of one axis, and the whole vehicle sampled with the law's filters in it."""
    case, numbers = of_the_vehicle_as_stated(name), flight_laws.Searched(*NUMBERS[law.name])
    loop = other_laws.cuts_of(law.paths(numbers, case.axis, STATED), case.axis)[0, 0]
    w = shape_gains.OMEGA_RAD_S
    edge_db = margins(loop, w).gain_db
    gains = shape_gains.with_shape(GAINS, law.shape(numbers, name, STATED), name)
    cyclic = INPUTS.index(shape_gains.AXES[name][1])

    def radius(decibels):
        b = PLANT.b.copy()
        b[:, cyclic] *= 10.0 ** (decibels / 20.0)
        return spectral_radius(law.inside(numbers, name, PLANT._replace(b=b), STATED), gains)

    assert radius(0.0) < 1.0
    edges = [sign * edge_db for sign in (-1.0, 1.0)]
    assert all(radius(0.9 * edge) < 1.0 for edge in edges)
    assert any(radius(1.1 * edge) > 1.0 for edge in edges)


def test_the_observer_is_the_outer_loop_of_indi():
    """Tilt commanded from the tilt that is measured, by the acceleration that lacks over g, both low-passed alike."""
    decay = 0.9
    gains = AutopilotGains(gust_share=1.0, gust_decay_forward=decay, gust_decay_right=decay, tilt_limit=1.0)
    known = Knowledge(pad_found=1.0, ground_found=1.0, pad_unseen_s=0.0, sigma_m=0.0, doubted=0.0)
    state, generator = hovering(gains), np.random.default_rng(11)
    accel, tilt = np.zeros(2), np.zeros(2)  # low-passed
    for _ in range(40):
        roll, pitch, vel_n, vel_e, force_n, force_e = generator.normal(0.0, 0.05, 6)
        rotation = rotation_from_quaternion(*quaternion_from_euler(roll, pitch, 0.0))
        to_body = np.array(rotation).reshape(3, 3).T
        force, velocity = to_body @ [force_n, force_e, -GRAVITY_M_S2], to_body @ [vel_n, vel_e, 0.0]
        asked = np.array(
            [gains.forward_gain * -vel_n + state.accel_forward, gains.right_gain * -vel_e + state.accel_right]
        )
        state = outer_loop(
            state, Reference(0.0, 0.0, -3.0, 0.0, 0.0, 0.0), Estimate(0.0, 0.0, -3.0, *velocity, *force), known,
            rotation, gains, 0.0, OUTER_S,
        )  # fmt: skip
        accel = decay * accel + (1.0 - decay) * np.array([force_n, force_e])
        tilt = decay * tilt + (1.0 - decay) * np.array([-rotation[6], rotation[7]])
        lacking = (asked - accel) / GRAVITY_M_S2
        assert state.pitch_sine == pytest.approx(tilt[0] - lacking[0], abs=1e-12)
        assert state.roll_sine == pytest.approx(tilt[1] + lacking[1], abs=1e-12)


def test_a_state_of_the_wind_that_is_known_at_once_takes_the_gust_off_the_disc():
    """With the wind's state nearly at the gyros' rate a gust moves the vehicle less, the other gains as they are."""
    case = of_the_vehicle_as_stated("forward")
    law = next(one for one in flight_laws.LAWS if one.name == "observer, wind state")
    plain, fed = (flight_laws.Searched(*NUMBERS[law.name])._replace(own=own, own_s=0.01) for own in (1e-6, 0.5))
    drifts = [shape_gains.drift_by(law.paths(one, case.axis, STATED), case.axis) for one in (plain, fed)]
    assert drifts[1] < 0.9 * drifts[0]


def test_the_table_is_printed_with_what_was_found(tmp_path, capsys):
    path = tmp_path / "laws.json"
    other_laws.main(1, path, ["INDI"])
    rows = json.loads(path.read_text())
    assert [(row["box"], row["axis"]) for row in rows] == [
        ("sheet", "forward"), ("learnt", "forward"), ("sheet", "right"), ("learnt", "right")
    ]  # fmt: skip
    printed = capsys.readouterr().out
    for row in rows:
        assert f"{1e3 * row['drift_m']:.1f} | {row['phase_deg']:.1f} | {row['gain_db']:.1f}" in printed
        assert row["drift_m"] > 0.0
