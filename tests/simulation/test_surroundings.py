"""The surroundings on lanes: each lane has its own ground, its own wind, and what its feet and rotors find."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flownav.core.compile import LANES, kernel
from flownav.core.frames import quaternion_from_euler, rotation_from_quaternion, to_earth
from flownav.sensors.geometry import roughness, stepped
from flownav.simulation import layout
from flownav.simulation.assemble import assemble
from flownav.simulation.block import key_lanes, plain_noise
from flownav.simulation.ensemble import believed
from flownav.simulation.ground import GroundSettings
from flownav.simulation.layout import load_around, store_helicopter
from flownav.simulation.scenario import load_scenario, with_vehicle
from flownav.simulation.surroundings import Runs, draw_recirculation, start_surroundings, surround
from flownav.simulation.truth import packed_truth
from flownav.simulation.wind import WindSettings
from flownav.vehicle.state import HelicopterState

COUNT = len(LANES)
RUNS = Runs(engine=1.0, motor_out=0.0, tail_stuck=0.0)


@kernel
def around_of(work, lanes, noise, rotors, recirculates, now, epochs):
    key_lanes(work, lanes, noise.streams, 0)
    draw_recirculation(work, lanes, 3, 0, 0, recirculates)
    start_surroundings(work, lanes, rotors)
    for epoch in range(epochs):
        surround(work, lanes, 3, 0, epoch, rotors, recirculates, now)


@kernel
def put(work, lanes, lane, state):
    store_helicopter(work, lanes, lane, state)


def surrounded(flight, truths, states, *, recirculates=False, now=RUNS, epochs=1, thrust_n=0.0):
    """The surroundings of each lane's vehicle: a list of Around."""
    work = np.zeros(layout.ROWS * COUNT)
    work[layout.AS_IS_BEGIN * COUNT : layout.AS_IS_END * COUNT] = packed_truth(truths)
    work[layout.THRUST * COUNT : (layout.THRUST + 1) * COUNT] = thrust_n
    for lane, state in enumerate(states):
        put(work, LANES, lane, state)
    around_of(work, LANES, plain_noise(COUNT), flight.rotors, recirculates, now, epochs)
    return [load_around(work, LANES, lane) for lane in range(COUNT)]


def at(height, north=0.0, east=0.0, roll=0.0, yaw=0.0):
    zeros = dict.fromkeys(HelicopterState._fields, 0.0)
    turned = dict(zip(("qw", "qx", "qy", "qz"), quaternion_from_euler(roll, 0.0, yaw), strict=True))
    return HelicopterState(**(zeros | turned | {"pos_n": north, "pos_e": east, "pos_d": -height}))


@pytest.fixture(scope="module")
def flight():
    return assemble(load_scenario("approach")).flight


def test_each_lane_has_the_wind_of_its_own_rotor_over_its_own_ground(flight):
    wind = WindSettings(speed_20ft_m_s=6.0, gusts=False).parameters()
    grounds = [GroundSettings(slope_deg=0.5 * lane).parameters() for lane in range(COUNT)]
    truths = [believed(flight)._replace(wind=wind, ground=ground) for ground in grounds]
    rolls = [0.1 * lane for lane in range(COUNT)]
    found = surrounded(flight, truths, [at(1.0, north=2.0, roll=roll) for roll in rolls])
    for lane, one in enumerate(found):
        hub = 1.0 + flight.vehicle.hub_above_cg_m * math.cos(rolls[lane])
        height = hub - 2.0 * math.tan(math.radians(0.5 * lane))
        assert -one.wind_n_m_s == pytest.approx(6.0 * math.log(height / 0.04572) / math.log(6.096 / 0.04572))
        assert one.slope_n == pytest.approx(math.tan(math.radians(0.5 * lane)))
        assert one.cosine == pytest.approx(math.cos(math.radians(0.5 * lane)))


def test_feet_and_rotor_find_what_lies_under_them(flight):
    ground = GroundSettings(step_m=-1.5, edge_north_m=0.1, rough_rms_m=0.005, rough_place_m=4.0).parameters()
    truths = [believed(flight)._replace(ground=ground)] * COUNT
    states = [at(0.3 + 0.1 * lane, east=0.2 * lane, roll=0.02 * lane, yaw=0.4 * lane) for lane in range(COUNT)]
    v = flight.vehicle
    places = [(x, y) for x in (v.skid_half_length_m, -v.skid_half_length_m)
              for y in (v.skid_half_track_m, -v.skid_half_track_m)]  # fmt: skip
    kinds = set()
    for state, one in zip(states, surrounded(flight, truths, states), strict=True):
        rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
        for foot, (x, y) in enumerate(places, 1):
            arm = to_earth(rotation, x, y, v.cg_above_skid_m)
            north, east = state.pos_n + arm[0], state.pos_e + arm[1]
            expected = stepped(north, east, ground) + roughness(north, east, ground)
            assert getattr(one, f"foot_{foot}_m") == pytest.approx(expected, abs=1e-12)
            kinds.add(expected < -1.0)
        assert -1.5 < one.rotor_1_m < 0.0
    assert kinds == {False, True}


def test_a_quads_rotors_each_find_their_own_ground():
    quad = assemble(with_vehicle(load_scenario("approach"), "quad-450")).flight
    ground = GroundSettings(step_m=-1.5, edge_north_m=0.0, edge_toward_deg=0.0).parameters()
    truths = [believed(quad)._replace(ground=ground)] * COUNT
    found = surrounded(quad, truths, [at(0.2)] * COUNT)[5]
    assert found.rotor_1_m < -1.0  # in front, over the edge
    assert found.rotor_4_m < -1.0
    assert (found.rotor_2_m, found.rotor_3_m) == (0.0, 0.0)
    assert (found.foot_1_m, found.foot_2_m, found.foot_3_m, found.foot_4_m) == (-1.5, -1.5, 0.0, 0.0)


def test_the_wake_comes_back_near_the_ground_only_and_differs_from_flight_to_flight(flight):
    calm = believed(flight)._replace(wind=WindSettings().parameters())
    heights = [0.25 if lane < 8 else 5.0 for lane in range(COUNT)]
    found = surrounded(flight, [calm] * COUNT, [at(h) for h in heights], recirculates=True, epochs=3, thrust_n=77.0)
    down = np.array([one.wind_d_m_s for one in found])
    assert len(set(down[:8])) == 8
    assert 0.01 < np.std(down[:8]) < 0.4
    assert (down[8:] == 0.0).all()
    again = surrounded(flight, [calm] * COUNT, [at(h) for h in heights], epochs=3, thrust_n=77.0)
    assert all(one.wind_d_m_s == 0.0 for one in again)


def test_what_runs_is_what_the_epoch_says(flight):
    truths = [believed(flight)] * COUNT
    for now in (RUNS, Runs(0.0, 1.0, 0.0), Runs(1.0, 0.0, 1.0)):
        found = surrounded(flight, truths, [at(1.0)] * COUNT, now=now)
        assert {(one.engine, one.motor_out, one.tail_stuck) for one in found} == {now}
