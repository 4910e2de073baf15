"""The measurements behind `flownav bench`, each a function that times real work and says what it asked for."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flownav.compile import LANES, ONE_LANE
from flownav.estimation.paper_filter import PaperModel
from flownav.simulation.engine import fly_blocks, fly_one
from flownav.simulation.flight import Flight

REPEATS = 5


@dataclass(frozen=True)
class Figure:
    """One measured figure: what it is, its value and unit, what was asked, and whether more or less is better."""

    name: str
    value: float
    unit: str
    asked: float
    more_is_better: bool
    note: str = ""

    @property
    def reached(self) -> bool:
        """Whether the figure is at least as good as asked."""
        return self.value >= self.asked if self.more_is_better else self.value <= self.asked


def measure_all(flights: int) -> Iterator[Figure]:
    """Every figure, one after the other; `flights` is the size of the batch."""
    flight = _landing()
    yield single_flight(flight)
    yield from batch(flight, flights)
    yield filter_step()
    yield from filter_against_filterpy()
    yield from replay_of_recorded_flight()
    yield help_time()
    yield cold_compile()
    yield memory_of_many_flights()


def best_of(work: Callable[[], object], repeats: int = REPEATS) -> float:
    """The shortest of several wall times [s]; the first call, which may compile, is not counted."""
    work()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def _landing() -> Flight:
    """The paper's landing with the paper's filter."""
    from flownav.simulation.assemble import assemble
    from flownav.simulation.scenario import load_scenario, with_filter

    return assemble(with_filter(load_scenario("landing"), "paper")).flight


def _papers_model() -> PaperModel:
    """The matrices of the paper's filter, discretised."""
    model = _landing().paper
    if model is None:
        raise RuntimeError("the landing scenario flies the paper's filter")
    return model


def single_flight(flight: Flight) -> Figure:
    """One 50 s flight with its whole history, kernels warm."""
    return Figure("one warm 50 s flight", 1e3 * best_of(lambda: fly_one(flight, 1)), "ms", 25.0, False)


def batch(flight: Flight, flights: int) -> Iterator[Figure]:
    """Flights a second with scores, on every core; and one core's lanes against one core's scalar build."""
    from flownav.campaign.local import fly_many

    def rate_of(threads: int, count: int) -> float:
        return count / best_of(lambda: fly_many(flight, 1, count, threads=threads), 2)

    cores = os.cpu_count() or 1
    yield Figure(
        "flights a second, scored", rate_of(cores, flights), "1/s", 500.0, True, f"{flights} flights, {cores} threads"
    )
    lanes = sum(flown for flown, _ in fly_blocks(flight, 1, 0, len(LANES), lambda history: None, 1))
    wide = best_of(lambda: list(fly_blocks(flight, 1, 0, lanes, lambda history: None, 1)), 3) / lanes
    alone = best_of(lambda: fly_one(flight, 1), 3)
    yield Figure(f"{len(LANES)} lanes against scalar, one core", alone / wide, "x", 4.0, True)


def _filter_runner() -> Callable[[int], float]:
    """Seconds for n predict+update steps of the paper's filter on one lane."""
    from flownav.benchmark.filter_loop import ROWS, run_paper_filter

    model = _papers_model()
    work = np.zeros(ROWS)

    def run(steps: int) -> float:
        work[:] = 0.0
        start = time.perf_counter()
        run_paper_filter(work, ONE_LANE, steps, model)
        return time.perf_counter() - start

    return run


def filter_step() -> Figure:
    """One predict+update of the six-state filter in the engine."""
    run = _filter_runner()
    run(10)
    steps = 50_000
    per_step = min(run(steps) for _ in range(REPEATS)) / steps
    return Figure("filter step (6 states, predict + 6 updates)", 1e6 * per_step, "us", 5.0, False)


def filter_against_filterpy() -> Iterator[Figure]:
    """How many times faster than FilterPy's predict+update in this run; left out where FilterPy is absent."""
    try:
        from filterpy.kalman import KalmanFilter
    except ImportError:
        return
    run = _filter_runner()
    run(10)
    ours = min(run(20_000) for _ in range(REPEATS)) / 20_000
    model = _papers_model()
    other = KalmanFilter(dim_x=6, dim_z=6, dim_u=4)
    other.F, other.B, other.H = model.transition, model.input_matrix, np.eye(6)
    other.Q, other.R = np.diag(model.process_noise), np.diag(model.measurement_noise)
    inputs, measured = np.zeros((4, 1)), np.zeros((6, 1))

    def steps() -> None:
        for _ in range(500):
            other.predict(u=inputs)
            other.update(measured)

    theirs = best_of(steps, 3) / 500
    note = f"FilterPy {1e6 * theirs:.1f} us, ours {1e6 * ours:.2f} us a step"
    yield Figure("filter step against FilterPy", theirs / ours, "x", 20.0, True, note)


def replay_of_recorded_flight() -> Iterator[Figure]:
    """Reading and replaying the recorded 849 s flight; left out where the data folder is absent."""
    from flownav.benchmark.recorded import recorded_flight, replay_once

    folder = recorded_flight()
    if folder is not None:
        seconds = best_of(lambda: replay_once(folder), 3)
        yield Figure("replay of the 849 s log", seconds, "s", 1.0, False, "read, replayed, bundled into a record")


def _subprocess(arguments: list[str], environment: dict[str, str] | None = None) -> float:
    """Wall time [s] of a flownav command as a whole process."""
    start = time.perf_counter()
    subprocess.run(
        [sys.executable, "-m", "flownav", *arguments],
        check=True,
        capture_output=True,
        env={**os.environ, **(environment or {})},
    )
    return time.perf_counter() - start


def help_time() -> Figure:
    """`flownav --help` as a whole process."""
    seconds = best_of(lambda: _subprocess(["--help"]))
    return Figure("flownav --help, whole process", seconds, "s", 0.3, False)


def cold_compile() -> Figure:
    """The first flight with an empty cache, less the same with a full one."""
    with tempfile.TemporaryDirectory() as cache, tempfile.TemporaryDirectory() as out:
        command = ["fly", "landing", "--no-report", "--json", "--out", str(Path(out) / "cold.fnr")]
        cold = _subprocess(command, {"FLOWNAV_CACHE": cache})
        warm = _subprocess(command, {"FLOWNAV_CACHE": cache})
    return Figure("cold first compile", cold - warm, "s", 20.0, False, f"whole process {cold:.1f} s, warm {warm:.2f} s")


def memory_of_many_flights(flights: int = 10_000) -> Figure:
    """Peak memory of a process that flies and scores many flights."""
    script = (
        "import resource\n"
        "from flownav.benchmark.measures import _landing\n"
        "from flownav.campaign.local import fly_many\n"
        f"fly_many(_landing(), 1, {flights})\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True)
    megabytes = int(done.stdout.split()[-1]) / 1024.0
    return Figure(f"peak memory, {flights} flights' scores", megabytes, "MB", 500.0, False)
