"""The fast path: equations of one's own, compiled into the loop, are the same equations called from Python."""

from __future__ import annotations

import math

import numpy as np
import pytest

import flownav.parts.protocols as own
from flownav.api.campaigning import campaign
from flownav.api.flying import fly
from flownav.api.replaying import replay
from flownav.core.compile import equation, replacing
from flownav.core.errors import InputError
from flownav.core.record import QUATERNION
from flownav.parts.equations import EquationEstimate, EquationFilter, EquationVehicle
from flownav.parts.examples.equation_filter import Memory, equation_filter, say, step
from flownav.simulation.assemble import assemble
from flownav.simulation.scenario import load_scenario
from flownav.vehicle.helicopter import derivative, outputs

SHORT = {"duration_s": 8.0}
with_north = replacing(EquationEstimate, "pos_n")
PATH = ("pos_n_m", "pos_e_m", "pos_d_m", "vel_u_m_s", "vel_v_m_s", "vel_w_m_s", *QUATERNION)
START = assemble(load_scenario("landing")).flight.plan.start
VEHICLE = assemble(load_scenario("landing")).flight.vehicle


class InPython:
    """The same filter on the slow path."""

    name = "in python"

    def __init__(self):
        self.filter = EquationFilter("in python", Memory(), step, say)

    def start(self, told):
        self.filter.start(told)

    def predict(self, t_s, imu):
        self.filter.predict(t_s, imu)

    def update(self, reading):
        return self.filter.update(reading)

    def estimate(self):
        return self.filter.estimate()


@equation
def rate(state, controls, around):
    return derivative(state, controls, around, VEHICLE)


@equation
def seen(state, controls, around):
    out = outputs(state, around, VEHICLE)
    return own.Outputs(out.thrust_n, out.contact_force_n, out.power_w)


def test_a_filter_of_equations_flies_compiled_as_it_does_in_python():
    fast, slow = fly("landing", filter=equation_filter, flight=SHORT), fly("landing", filter=InPython, flight=SHORT)
    assert fast.manifest["filter"] == "equations"
    np.testing.assert_array_equal(fast.tables["estimate"]["t_s"], slow.tables["estimate"]["t_s"])
    for name in PATH:
        np.testing.assert_allclose(
            fast.tables["estimate"][name], slow.tables["estimate"][name], atol=1e-9, err_msg=name
        )


@equation
def says_nan_later(memory):
    said = say(memory)
    return with_north(said, pos_n=math.nan if memory.imu_s > 5.6 else said.pos_n)


@equation
def says_something_else(memory):
    return memory.known, memory.pos_n


def test_a_number_that_is_none_ends_a_flight_and_a_campaign_and_a_replay(tmp_path):
    fly("landing", filter=equation_filter, flight=SHORT).save(tmp_path / "own.fnr")
    late = EquationFilter("late", Memory(), step, says_nan_later)
    for begin in (
        lambda: fly("landing", filter=late, flight=SHORT),
        lambda: campaign("landing", filter=late, flights=16, flight=SHORT, folder=tmp_path / "late"),
        lambda: replay(tmp_path / "own.fnr", filter=late),
    ):
        with pytest.raises(InputError, match=r"^filter late: its estimate of 5\.\d\d s is not finite, or beyond"):
            begin()


def test_equations_that_cannot_be_compiled_are_told_in_one_line():
    with pytest.raises(InputError, match=r"^filter short: its equations cannot be compiled: \w+: .*; mend it") as told:
        fly("landing", filter=EquationFilter("short", Memory(), step, says_something_else), flight=SHORT)
    assert "\n" not in str(told.value)


def test_its_record_replays_to_the_same_bits(tmp_path):
    flown = fly("pad_return", filter=equation_filter, flight=SHORT)
    flown.save(tmp_path / "own.fnr")
    again = replay(tmp_path / "own.fnr", filter=equation_filter)
    for name in PATH:
        np.testing.assert_array_equal(again.tables["estimate"][name], flown.tables["estimate"][name])


def test_sixteen_flights_side_by_side_are_the_flights_one_by_one(tmp_path):
    many = campaign("landing", filter=equation_filter, flights=3, flight=SHORT, folder=tmp_path / "many")
    errors = many.to_pandas()["max_position_error_m"]
    for k in range(3):
        assert many.record(k).scores["max_position_error_m"] == errors[k]


def test_a_vehicle_of_equations_flies_as_ours_does():
    vehicle = EquationVehicle("again", START, rate, seen)
    ours = fly("landing", flight={"duration_s": 3.0}).tables["truth"]
    theirs = fly("landing", vehicle=vehicle, flight={"duration_s": 3.0}).tables["truth"]
    for name in PATH:
        np.testing.assert_allclose(theirs[name], ours[name], atol=2e-5, err_msg=name)


def test_what_has_no_room_is_told():
    from collections import namedtuple

    large = namedtuple("large", [f"x{i}" for i in range(700)])
    with pytest.raises(InputError, match="its memory has 700 numbers; at most 512"):
        EquationFilter("large", large(*range(700)), step, say)
    small = namedtuple("small", ["x", "y"])
    with pytest.raises(InputError, match="its state has 2 numbers; 13 to 26"):
        EquationVehicle("small", small(0.0, 0.0), rate, seen)
