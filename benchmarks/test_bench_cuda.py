"""The CUDA engine beside the cores of this machine: `pytest -s benchmarks/test_bench_cuda.py`, skipped without a GPU.

It prints what was asked of it: flights a second over the local engine's in the same run, dynamics steps a second, the
largest difference of any score from the CPU's, and how rate depends on the block and on how many flights fly at once.
"""

from __future__ import annotations

import os
import time

import numpy as np
import pytest

from flownav.campaigns.cuda import AT_ONCE, Cuda, truths_of
from flownav.campaigns.device_flight import take_here
from flownav.campaigns.local import fly_many, rows_of
from flownav.core.compile import NoDeviceError, device_runner
from flownav.simulation.assemble import assemble
from flownav.simulation.engine import fly_blocks
from flownav.simulation.plan import ATTITUDE_STEPS, PHYSICS_STEPS
from flownav.simulation.scenario import load_scenario, with_filter

SEED, COMPARED = 1, 256
ASKED_OVER_CPU, ASKED_STEPS_PER_S, ASKED_DIFFERENCE = 50.0, 5e8, 1e-9
FLIGHTS = int(os.environ.get("FLOWNAV_CUDA_BENCH_FLIGHTS", 4 * AT_ONCE))
CPU_FLIGHTS = int(os.environ.get("FLOWNAV_CUDA_BENCH_CPU_FLIGHTS", 512))


@pytest.fixture(scope="module")
def runner():
    """The GPU."""
    try:
        found = device_runner(take_here)
    except NoDeviceError as error:
        pytest.skip(f"{error}")
    if found.in_python:
        pytest.skip("a simulated device has no rate")
    return found


def rate_on(engine, flight, flights):
    """Flights a second, once everything is compiled and loaded."""
    list(engine.rows(flight, SEED, 0, 32, truths_of(flight, SEED, None)))
    began_s = time.perf_counter()
    flown = sum(map(len, engine.rows(flight, SEED, 0, flights, truths_of(flight, SEED, None))))
    return flown / (time.perf_counter() - began_s)


def rate_here(flight, flights):
    """The same on two threads of this machine."""
    fly_many(flight, SEED, 32, threads=2)
    began_s = time.perf_counter()
    fly_many(flight, SEED, flights, threads=2)
    return flights / (time.perf_counter() - began_s)


def largest_difference(engine, flight):
    """The largest difference of any score of COMPARED flights from the CPU's, relative where it is above one."""
    ours = np.concatenate(list(engine.rows(flight, SEED, 0, COMPARED, truths_of(flight, SEED, None))))
    blocks = fly_blocks(flight, SEED, 0, COMPARED, lambda history: rows_of(flight, history))
    theirs = np.concatenate([rows for _, rows in blocks])
    assert np.array_equal(np.isnan(ours), np.isnan(theirs))
    return float(np.nanmax(np.abs(ours - theirs) / np.maximum(np.abs(theirs), 1.0)))


def said(row):
    """A line of the table."""
    name, figure, unit, asked = row
    return f"{name:<58} {figure:>12.4g} {unit:<12} {asked}"


def measured(runner, name):
    """The table's lines for one filter; its last entry is the largest difference."""
    flight = assemble(with_filter(load_scenario("landing"), name)).flight
    engine = Cuda(runner)
    difference = largest_difference(engine, flight)
    device, here = rate_on(engine, flight, FLIGHTS), rate_here(flight, CPU_FLIGHTS)
    steps = flight.plan.epochs * ATTITUDE_STEPS * PHYSICS_STEPS
    lines = [
        (f"{name}: {FLIGHTS} flights on the device, scored", device, "flights/s", ""),
        (f"{name}: two threads of this machine", here, "flights/s", ""),
        (f"{name}: device over two threads", device / here, "x", f">= {ASKED_OVER_CPU:g} x"),
        (f"{name}: dynamics steps with sensors and filter", device * steps, "steps/s", f">= {ASKED_STEPS_PER_S:g}"),
        (f"{name}: largest difference, float64", difference, "", f"<= {ASKED_DIFFERENCE:g}"),
    ]
    for at_once in (AT_ONCE // 8, AT_ONCE // 2, 2 * AT_ONCE):
        rate = rate_on(Cuda(runner, at_once=at_once), flight, 2 * AT_ONCE if FLIGHTS > AT_ONCE else FLIGHTS)
        lines.append((f"{name}: {at_once} flights at once", rate, "flights/s", ""))
    return lines, difference


@pytest.mark.parametrize("name", ["paper", "landing"], ids=["the paper's filter", "the navigator"])
def test_device_beside_the_cpu(runner, name, capsys):
    lines, difference = measured(runner, name)
    with capsys.disabled():
        print("\n" + "\n".join(map(said, lines)))
    assert difference <= ASKED_DIFFERENCE


@pytest.mark.parametrize("block", [32, 64, 128])
def test_block(runner, block, capsys):
    from flownav.core.compiling.launch import Gpu

    flight = assemble(with_filter(load_scenario("landing"), "paper")).flight
    rate = rate_on(Cuda(Gpu(take_here, block=block)), flight, min(FLIGHTS, 2 * AT_ONCE))
    with capsys.disabled():
        print("\n" + said((f"paper: {block} threads a block", rate, "flights/s", "")))
    assert rate > 0.0
