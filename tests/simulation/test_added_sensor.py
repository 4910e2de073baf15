"""A sensor that one row adds (docs/how-to/add-a-sensor.py): drawn, dispersed, read by its clock, recorded, fused."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

PROJECT = Path(__file__).parents[2]
SCRIPT = """
import importlib.util, json, sys
import numpy as np

spec = importlib.util.spec_from_file_location("laser", sys.argv[1])
laser = importlib.util.module_from_spec(spec)
sys.modules["laser"] = laser
spec.loader.exec_module(laser)  # carries the sensor, and flies it

from flownav.core.compile import LANES, ONE_LANE
from flownav.core.measurement import Sensor
from flownav.simulation.assemble import assemble
from flownav.simulation.engine import fly_written
from flownav.simulation.scenario import load_scenario
from flownav.simulation.sources import sources_of, starts_of

setup = assemble(load_scenario("beside.toml"))
ensemble, flight = setup.ensemble(), 5
many, alone = fly_written(setup.flight, 3, 0, LANES, ensemble), fly_written(setup.flight, 3, flight, ONE_LANE, ensemble)
truths, clock = ensemble.truths(3, 0, 16), setup.flight.onboard.carried.laser.clock
fed = laser.record.tables["fed"]
ranged = (fed["sensor"] == Sensor.RANGE) & (fed["arrived"] > 0.0)
# the sonar reads in epochs 2, 7, 12 ..., the laser in every odd one
due = np.rint(fed["t_s"][ranged] / 0.02).astype(int)
truth = laser.record.tables["truth"]
own = ranged.copy()
own[ranged] = (due % 2 == 1) & ((due - 2) % 5 != 0)
height_m = np.interp(fed["t_s"][own], truth["t_s"], -truth["pos_d_m"])
judged = laser.record.tables["innovation"]
print("\\n" + json.dumps({
    "same history": many.history[:, :, flight].tobytes() == alone.history[:, :, 0].tobytes(),
    "same readings": many.fed[:, :, flight].tobytes() == alone.fed[:, :, 0].tobytes(),
    "sigmas_m": [one.carried.laser.sigma_m for one in truths],
    "late_s": [one.late.laser for one in truths],
    "clock": list(clock),
    "noise": [one.name for one in (*starts_of(setup.flight), *sources_of(setup.flight)) if "laser" in one.name],
    "counts": [int(ranged.sum()), int(own.sum())],
    "off_m": float(np.median(np.abs(height_m - 0.15 - fed["value_0"][own]))),
    "fused": float(np.sum(judged["fused"][judged["sensor"] == "range"])),
}))
"""


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """The result of a fresh interpreter in which the row was added before the simulator was imported."""
    script = PROJECT / "docs/how-to/add-a-sensor.py"
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(script)], cwd=tmp_path_factory.mktemp("laser"), capture_output=True,
        text=True, timeout=1200,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def test_a_flight_has_the_same_bytes_alone_and_among_sixteen(flown):
    assert flown["same history"]
    assert flown["same readings"]


def test_each_flight_of_an_ensemble_has_its_own(flown):
    assert len(set(flown["sigmas_m"])) == len(set(flown["late_s"])) == 16
    assert all(0.01 <= sigma_m <= 0.04 for sigma_m in flown["sigmas_m"])
    assert all(0.0 <= late_s <= 0.02 for late_s in flown["late_s"])


def test_its_noise_has_names(flown):
    assert flown["noise"] == ["start.laser.scale", "laser.noise"]


def test_it_reads_by_its_clock_what_lies_below(flown):
    assert flown["clock"] == [1, 2, 1]
    every, own = flown["counts"]
    assert own == pytest.approx(8.0 * 20.0, abs=4.0)
    assert every == pytest.approx(8.0 * 35.0, abs=12.0)  # the sonar loses some
    assert flown["off_m"] < 0.1


def test_the_navigator_fuses_it_as_it_does_the_sonar(flown):
    assert flown["fused"] > 0.8 * flown["counts"][0]
