"""Without anything of Numba replaced (`FLOWNAV_PLAIN=1`) kernels are compiled all the same, and give the same bits."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

from flownav.core.compiling import memo
from flownav.core.compiling.level import Leanness

# records in a lane buffer and as arguments, a branch, two loops; then a flight of the vehicle alone, without pilot
PROGRAM = """
import hashlib, json, sys
from typing import NamedTuple

import numpy as np

from flownav.core.compile import LANES, Layout, equation, kernel, pointer, replacing
from flownav.core.frames import rotation_from_quaternion


class Place(NamedTuple):
    north_m: float = 0.0
    east_m: float = 0.0
    height_m: float = 2.0


class Attitude(NamedTuple):
    w: float = 1.0
    x: float = 0.1
    y: float = 0.2
    z: float = 0.3


class Flight(NamedTuple):
    start: Place
    gains: Attitude
    steps: int
    climbs: bool


for record in (Place, Attitude, Flight):
    record.__module__ = "flownav.tests"  # as if it were the package's
layout = Layout()
layout.keep(Place)
layout.keep(Attitude)
with_height = replacing(Place, "height_m")


@equation
def turned(a, gains):
    r = rotation_from_quaternion(a.w, a.x, a.y, a.z)
    x, y = r[0] * a.x + r[1] * a.y + gains.x, r[3] * a.w - r[4] * a.x / (1.0 + r[5] * r[5]) + gains.y
    return Attitude(x / (1.0 + x * x), y / (1.0 + y * y), a.y / (1.0 + a.z * a.z), a.w * gains.w)


@layout.loop
def move(place: Place, attitude: Attitude, *, f: Flight) -> tuple[Place, Attitude]:
    after = turned(attitude, f.gains)
    place = with_height(place, height_m=place.height_m + (after.w if f.climbs else -after.w))
    if place.height_m < 0.0:
        place = with_height(f.start, height_m=0.5 * place.height_m)
    return Place(place.north_m + after.x, place.east_m + after.y, place.height_m), after


@kernel
def fly(work, lanes, f):
    p = pointer(work)
    for _ in range(f.steps):
        move(p, lanes, f)


def digest(values):
    return hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()


work = np.random.default_rng(7).normal(size=layout.next * len(LANES))
fly(work, LANES, Flight(Place(1.0, 2.0, 3.0), Attitude(), 200, True))
assert np.isfinite(work).all()

from numba.core import types
from numba.core.datamodel.registry import default_manager

from flownav.core.compiling import memo, target

with target.lean():
    replaced = [name for owner, name, other in memo.PATCHES if vars(owner).get(name) is other]
again = [name for owner, name, other in memo.PATCHES if vars(owner).get(name) is other]
whole = default_manager._handlers[types.NamedTuple].__module__.startswith("flownav.")
written = "flownav.core.compiling.intrinsics" in sys.modules
found = {"kernel": digest(work), "replaced": replaced, "again": again, "whole": whole, "written": written}
from flownav.studies.benchmark.vehicles import landing_of, plant_after

flight = landing_of("quad-450")
flown = plant_after(flight._replace(plan=flight.plan._replace(epochs=50)))
assert np.isfinite(flown).all()
print(json.dumps({**found, "flight": digest(flown)}))
"""


@pytest.fixture(scope="module")
def computed(tmp_path_factory):
    """Results of the program, by whether Numba stays as it is; each way compiles into a cache of its own."""
    place = tmp_path_factory.mktemp("plain")
    program = place / "program.py"
    program.write_text(PROGRAM)
    running = {}
    for asked in ("", "1"):
        environment = {**os.environ, "FLOWNAV_PLAIN": asked, "FLOWNAV_CACHE": str(place / f"cache{asked}")}
        command = [sys.executable, str(program)]
        running[asked == "1"] = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)
    printed = {plain: process.communicate()[0] for plain, process in running.items()}
    assert [process.returncode for process in running.values()] == [0, 0]
    return {plain: json.loads(text) for plain, text in printed.items()}


def test_with_the_switch_nothing_of_numba_is_replaced(computed):
    plain, usual = computed[True], computed[False]
    assert (plain["replaced"], plain["whole"], plain["written"]) == ([], False, False)
    assert len(usual["replaced"]) == len(memo.PATCHES)
    assert (usual["whole"], usual["written"], usual["again"]) == (True, True, [])


@pytest.mark.parametrize("what", ["kernel", "flight"])
def test_what_is_computed_is_the_same_to_the_bit(computed, what):
    assert computed[True][what] == computed[False][what]


class Owner:
    """A part of a Numba of another version."""

    @staticmethod
    def kept():
        return "own"


def test_a_part_that_numba_does_not_have_is_left_alone(monkeypatch):
    wanted = ((Owner, "kept", staticmethod(lambda: "ours")), (Owner, "gone", staticmethod(lambda: "ours")))
    monkeypatch.setattr(memo, "PATCHES", wanted)
    with memo.memoising():
        assert Owner.kept() == "ours"
        assert not hasattr(Owner, "gone")
    assert Owner.kept() == "own"
    monkeypatch.setattr(Leanness, "wanted", False)
    with memo.memoising():
        assert Owner.kept() == "own"
