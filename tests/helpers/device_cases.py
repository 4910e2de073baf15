"""Flights and noise for a CUDA device: what is flown, how it is flown there, and what the CPU makes of the same.

`python tests/helpers/device_cases.py FILE` flies the short cases on Numba's simulator (NUMBA_ENABLE_CUDASIM=1) and
writes their rows and the noise to an .npz file.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from flownav.campaigns.cuda import Cuda, truths_of
from flownav.campaigns.local import rows_of
from flownav.core.compile import equation, kernel
from flownav.core.parameter_files import check
from flownav.simulation.assemble import Setup, assemble
from flownav.simulation.engine import fly_one
from flownav.simulation.noise import CHANNELS_PER_STEP, ZERO, normal_pair, threefry
from flownav.simulation.scenario import Scenario, load_scenario

SEED, FIRST = 5, 3
# scenario, sections of its file, flights, whether each has a truth of its own
SHORT: dict[str, tuple[str, dict[str, Any], int, bool]] = {
    "paper": ("landing", {"filter": {"name": "paper"}, "flight": {"duration_s": 0.5}}, 3, False),
    "drawn": ("gusty", {"filter": {"name": "paper"}, "flight": {"duration_s": 0.4}}, 3, True),
    "navigator": ("landing", {"filter": {"handover_s": 0.2}, "flight": {"duration_s": 1.3}}, 2, False),
}
STEPS = (0, 1, 2500, 1 << 40)
CHANNELS = (0, 17, 255)
FLIGHTS = (0, 1, 999_999)


def ready(name: str, sections: dict[str, Any]) -> Setup:
    """A shipped scenario with some entries of its sections changed."""
    entries = load_scenario(name).model_dump(exclude_unset=True)
    for key, value in sections.items():
        entries[key] = {**entries.get(key, {}), **value}
    return assemble(check(entries, Scenario, "test"))


def on_device(runner: Any, setup: Setup, flights: int, drawn: bool) -> Any:
    """The rows of some flights, two at a time, so that a device is used more than once and no warp is full."""
    truths = truths_of(setup.flight, SEED, setup.ensemble() if drawn else None)
    return np.concatenate(list(Cuda(runner, at_once=2).rows(setup.flight, SEED, FIRST, flights, truths)))


def on_cpu(setup: Setup, flights: int, drawn: bool) -> Any:
    """The same flights, each alone, scored from their histories."""
    ensemble = setup.ensemble() if drawn else None
    histories = (fly_one(setup.flight, SEED, FIRST + k, ensemble) for k in range(flights))
    return np.concatenate([rows_of(setup.flight, history) for history in histories])


# -- noise ---------------------------------------------------------------------------------------------------
def counters() -> Any:
    """Flight, step and channel of some draws, (n, 3) int64."""
    return np.array([(f, s, c) for f in FLIGHTS for s in STEPS for c in CHANNELS], np.int64)


@equation
def draw_thread(thread: int, threads: int, seed: int, asked: Any, words: Any, normals: Any) -> None:
    """Draw number `thread`: the two words of Threefry, and the two normals that they become."""
    flight, step, channel = asked[thread, 0], asked[thread, 1], asked[thread, 2]
    counter = np.uint64(step) * CHANNELS_PER_STEP + np.uint64(channel)
    words[thread, 0], words[thread, 1] = threefry(np.uint64(flight), counter, np.uint64(seed), ZERO)
    normals[thread, 0], normals[thread, 1] = normal_pair(seed, flight, step, channel)


@kernel
def draw_all(seed: int, asked: Any, words: Any, normals: Any) -> None:
    """The same on the CPU."""
    for k in range(len(asked)):
        draw_thread(k, len(asked), seed, asked, words, normals)


def noise_on_cpu() -> tuple[Any, Any]:
    """Words (n, 2) uint64 and normals (n, 2)."""
    asked = counters()
    words, normals = np.zeros((len(asked), 2), np.uint64), np.zeros((len(asked), 2))
    draw_all(SEED, asked, words, normals)
    return words, normals


def noise_on_device(runner: Any) -> tuple[Any, Any]:
    """The same, drawn by threads."""
    asked = counters()
    words, normals = runner.new((len(asked), 2), np.uint64), runner.new((len(asked), 2), np.float64)
    told = {"seed": SEED, "asked": runner.put(asked), "words": words, "normals": normals}
    runner.run(draw_thread, len(asked), told, {})
    return runner.fetch(words), runner.fetch(normals)


def main(file: str) -> None:
    """All of it on the simulator."""
    from flownav.campaigns.device_flight import take_here
    from flownav.core.compile import device_runner

    runner = device_runner(take_here)
    words, normals = noise_on_device(runner)
    rows = {name: on_device(runner, ready(scenario, sections), flights, drawn)
            for name, (scenario, sections, flights, drawn) in SHORT.items()}  # fmt: skip
    np.savez(file, words=words, normals=normals, **rows)


if __name__ == "__main__":
    main(sys.argv[1])
