"""Memory over many flights in one process, and over hours of `live` on a virtual clock: it comes to an end.

FLOWNAV_MEMORY_FLIGHTS and FLOWNAV_MEMORY_HOURS set how many: 1000 and 10 are what was asked.
"""

from __future__ import annotations

import gc
import math
import os
from pathlib import Path

import pytest

import flownav
import live_ends
from live_ends import Hover, Wire

FLIGHTS = int(os.environ.get("FLOWNAV_MEMORY_FLIGHTS", "60"))
HOURS = float(os.environ.get("FLOWNAV_MEMORY_HOURS", "0.2"))
MOST_MB, MOST_OBJECTS = 16.0, 1000  # more than at the first look

pytestmark = pytest.mark.slow


def held() -> tuple[float, int]:
    """Megabytes of this process in memory, and objects that the collector knows."""
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") * 1e-6, len(gc.get_objects())


def assert_bounded(before: tuple[float, int], what: str) -> None:
    megabytes, objects = held()
    print(f"{what}: {before[0]:.1f} MB then, {megabytes:.1f} now; {before[1]} objects then, {objects} now")
    assert megabytes < before[0] + MOST_MB
    assert objects < before[1] + MOST_OBJECTS


def test_a_thousand_flights_in_one_process_take_the_memory_of_twenty(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    scenario = flownav.Scenario.load("landing").changed(flight={"duration_s": 4.0})
    for seed in range(20):
        flownav.fly(scenario, seed=seed)
    before = held()
    for seed in range(20, FLIGHTS):
        flownav.fly(scenario, seed=seed)
    assert_bounded(before, f"{FLIGHTS} flights")


def test_hours_of_live_take_the_memory_of_three_minutes(monkeypatch):
    monkeypatch.setattr(live_ends, "STEP_S", 0.04)  # readings at a quarter of their usual rates, for the time it takes
    wire, worst_m, sent = Wire(Hover(answers=True)), 0.0, 0
    for minute in range(max(round(60 * HOURS), 4)):
        wire.fly(60.0)
        told = wire.estimates()
        worst_m = max([worst_m, *(math.hypot(message.x, message.y) for message in told[-100:])])
        sent += len(told)
        for kept in (wire.heard, wire.heard_s, wire.frames):
            kept.clear()
        if minute == 2:
            before = held()
    assert_bounded(before, f"{HOURS} h, {sent} estimates, {worst_m:.2f} m off at most")
    assert sent > 0.9 * 25.0 * wire.t_s
    assert worst_m < 1.5
    assert wire.session.resets == 1
    wire.close()
