"""The measurements behind `flownav bench`, each a function that times real work and says what it asked for."""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Literal

import numpy as np

from flownav.core.compile import LANES, ONE_LANE
from flownav.estimation.paper_filter import PaperModel
from flownav.simulation.engine import fly_blocks, fly_one
from flownav.simulation.plan import Flight
from flownav.studies.benchmark import REPEATS, Figure, best_of
from flownav.studies.benchmark.campaigns import campaigns

PART_STEPS, PART_ROUNDS = 1000, 50
NAVIGATORS_SHARE = 4  # the navigator's batch is smaller by this factor


def measurements(flights: int) -> list[tuple[str, Callable[[], list[Figure]]]]:
    """The measurements in order, each with its name in words; `flights` is the size of the batch."""
    paper, navigated = _landing("paper"), _landing("landing")
    return [
        ("single flights", lambda: single_flights(paper, navigated)),
        ("batches of flights", lambda: batches(paper, navigated, flights)),
        ("lanes against single flights", lambda: lanes_against_scalar(paper, navigated)),
        ("vehicles", lambda: vehicles(flights)),
        ("parts of the filter", filter_parts),
        ("steps of the filter", lambda: [filter_step(), *filter_against_filterpy()]),
        ("a replay", lambda: list(replay_of_recorded_flight())),
        ("help", lambda: [help_time()]),
        ("compilation into an empty cache", cold_compiles),
        ("campaigns", lambda: campaigns(flights)),
    ]


def _landing(name: Literal["paper", "landing"]) -> Flight:
    """The paper's landing on one of the filters."""
    from flownav.simulation.assemble import assemble
    from flownav.simulation.scenario import load_scenario, with_filter

    return assemble(with_filter(load_scenario("landing"), name)).flight


def _papers_model() -> PaperModel:
    """The matrices of the paper's filter, discretised."""
    model = _landing("paper").paper
    if model is None:
        raise RuntimeError("the landing scenario flies the paper's filter")
    return model


# -- flights -----------------------------------------------------------------------------------------------
def single_flights(paper: Flight, navigated: Flight) -> list[Figure]:
    """One 50 s flight with its whole history, kernels warm."""
    papers_ms = 1e3 * best_of(lambda: fly_one(paper, 1))
    navigators_ms = 1e3 * best_of(lambda: fly_one(navigated, 1))
    return [
        Figure("one warm 50 s flight, the paper's filter", papers_ms, "ms", 25.0, False),
        Figure("one warm 50 s flight, the navigator", navigators_ms, "ms", None, False),
    ]


def batches(paper: Flight, navigated: Flight, flights: int) -> list[Figure]:
    """Flights a second with scores, on every core: with the paper's filter, with the navigator, and their ratio."""
    from flownav.studies.benchmark.vehicles import CORES, rate_of

    fewer = max(len(LANES), flights // NAVIGATORS_SHARE)
    papers, navigators = rate_of(paper, flights), rate_of(navigated, fewer)
    what, on = "flights a second, scored", f"flights, {CORES} threads"
    return [
        Figure(f"{what}, the paper's filter", papers, "1/s", 500.0, True, f"{flights} {on}"),
        Figure(f"{what}, the navigator", navigators, "1/s", None, True, f"{fewer} {on}"),
        Figure("the navigator's rate over the paper's filter's", navigators / papers, "x", 0.20, True, "the same run"),
    ]


def lanes_against_scalar(paper: Flight, navigated: Flight) -> list[Figure]:
    """How many times faster a flight is as one of a block than alone, on one core."""

    def ratio_of(flight: Flight) -> float:
        block = best_of(lambda: list(fly_blocks(flight, 1, 0, len(LANES), lambda history: None, 1)), 3)
        return len(LANES) * best_of(lambda: fly_one(flight, 1), 3) / block

    what = f"{len(LANES)} lanes against scalar, one core"
    return [
        Figure(f"{what}, the paper's filter", ratio_of(paper), "x", 4.0, True),
        Figure(f"{what}, the navigator", ratio_of(navigated), "x", None, True),
    ]


def vehicles(flights: int) -> list[Figure]:
    """The quad's rate over the helicopter's, both on the navigator, and what a block of either spends its time on."""
    from flownav.studies.benchmark.vehicles import KINDS, landing_of, parts_of, rate_of

    fewer = max(len(LANES), flights // NAVIGATORS_SHARE)
    helicopter, quad = (rate_of(landing_of(name), fewer) for name in KINDS)
    times = {name: parts_of(landing_of(name)) for name in KINDS}
    figures = [
        Figure("flights a second, scored, quad-450", quad, "1/s", None, True, f"{fewer} flights, on the navigator"),
        Figure("quad-450's rate over maxi-joker-3's", quad / helicopter, "x", 2.0, True, "the same run"),
    ]
    for name, parts in times.items():
        what = f"{len(LANES)} flights on one core, {name}"
        figures.append(Figure(what, 1e3 * parts.whole_s, "ms", None, False))
        figures += [
            Figure(f"{what}: {part}", 1e3 * seconds, "ms", None, False, note)
            for part, seconds, note in (
                ("plant", parts.plant_s, ""),
                ("navigator", parts.navigator_s, "what is saved when nobody takes the readings"),
                ("rest", parts.rest_s, "sensors, wind, autopilot, history"),
            )
        ]
    shared_s = times[KINDS[1]].whole_s - times[KINDS[1]].plant_s
    bound = 1.0 + times[KINDS[0]].plant_s / shared_s
    note = f"{KINDS[0]}'s plant on top of what {KINDS[1]} spends on all else"
    return [*figures, Figure("the rate's ratio if the quad's plant cost nothing", bound, "x", None, True, note)]


# -- the filters' steps --------------------------------------------------------------------------------------
def filter_parts() -> list[Figure]:
    """Prediction, correction, and one that nobody offers, of the navigator's filter: scalar, and a lane of sixteen."""
    from flownav.studies.benchmark.vehicles import SETTINGS, correct_often, offer_nothing, predict_often, standing

    def us_of(part: Callable[..., Any], lanes: tuple[int, ...]) -> float:
        start = standing(lanes)
        buffer, best = start.copy(), np.inf
        for _ in range(PART_ROUNDS):
            buffer[:] = start
            begun = time.process_time()
            part(buffer, lanes, PART_STEPS, SETTINGS)
            best = min(best, time.process_time() - begun)
        return 1e6 * best / (PART_STEPS * len(lanes))

    rows: tuple[tuple[str, Callable[..., Any], float | None, float | None], ...] = (
        ("prediction of the navigator's filter", predict_often, 1.5, None),
        ("correction of the navigator's filter", correct_often, 0.45, 0.35),
        ("correction that nobody offers", offer_nothing, 0.05, 0.05),
    )
    figures = []
    for name, part, alone, of_lanes in rows:
        figures.append(Figure(f"{name}, scalar", us_of(part, ONE_LANE), "us", alone, False))
        figures.append(Figure(f"{name}, a lane of {len(LANES)}", us_of(part, LANES), "us", of_lanes, False))
    return figures


def _filter_runner() -> Callable[[int], float]:
    """Seconds for n predict+update steps of the paper's filter on one lane."""
    from flownav.studies.benchmark.vehicles import PAPER_ROWS, run_paper_filter

    model = _papers_model()
    work = np.zeros(PAPER_ROWS)

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
    return Figure("step of the paper's filter (predict + 6 updates)", 1e6 * per_step, "us", 5.0, False)


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
    yield Figure("step of the paper's filter against FilterPy", theirs / ours, "x", 20.0, True, note)


# -- whole jobs -----------------------------------------------------------------------------------------------
def replay_of_recorded_flight() -> Iterator[Figure]:
    """Reading and replaying the recorded 849 s flight; left out where the data folder is absent."""
    from flownav.studies.benchmark.vehicles import navigator_run, recorded_flight, replay_once

    folder = recorded_flight()
    if folder is not None:
        engine_s, note = best_of(navigator_run(folder), 3), "in the engine, streams prepared"
        yield Figure("the 849 s log through the navigator", engine_s, "s", 0.25, False, note)
        whole_s = best_of(lambda: replay_once(folder), 3)
        yield Figure("replay of the 849 s log", whole_s, "s", 1.0, False, "read, replayed, bundled into a record")


def _subprocess(arguments: list[str], environment: dict[str, str] | None = None) -> float:
    """Wall time [s] of a flownav command as a whole process."""
    whole = {**os.environ, **(environment or {})}
    start = time.perf_counter()
    subprocess.run([sys.executable, "-m", "flownav", *arguments], check=True, capture_output=True, env=whole)
    return time.perf_counter() - start


def help_time() -> Figure:
    """`flownav --help` as a whole process."""
    seconds = best_of(lambda: _subprocess(["--help"]))
    return Figure("flownav --help, whole process", seconds, "s", 0.3, False)


def cold_compiles() -> list[Figure]:
    """The first `fly landing` with an empty cache, less the same with a full one, on each filter."""
    figures = []
    for name, more, asked in (("", [], 12.0), (" --filter paper", ["--filter", "paper"], 20.0)):
        with tempfile.TemporaryDirectory() as cache, tempfile.TemporaryDirectory() as out:
            command = ["fly", "landing", *more, "--no-report", "--json", "--out", str(Path(out) / "cold.fnr")]
            cold = _subprocess(command, {"FLOWNAV_CACHE": cache})
            warm = _subprocess(command, {"FLOWNAV_CACHE": cache})
        note = f"whole process {cold:.1f} s, warm {warm:.2f} s"
        figures.append(Figure(f"cold compile of `fly landing{name}`", cold - warm, "s", asked, False, note))
    return figures
