"""The cost of a campaign besides its flights: the store, going on, a cluster on one node, memory."""

import json
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

from flownav.campaigns.engines import Engine, Local, Part
from flownav.campaigns.plan import Plan, planned
from flownav.campaigns.run import run_campaign
from flownav.campaigns.store import PART, Store
from flownav.simulation.scenario import load_scenario
from flownav.studies.benchmark import Figure

ROUNDS = 3
MEMORY_FLIGHTS = (1024, 10_000)
NAVIGATORS_SHARE = 4  # its campaign is smaller by this factor


def campaigns(flights: int) -> list[Figure]:
    """Rates with scores and store, what store and resume add, Ray's overhead, and memory."""
    count = max(PART, flights // PART * PART)
    paper, navigator = _plan("paper", count), _plan("landing", max(64, flights // NAVIGATORS_SHARE))
    works = [lambda: _fly(paper, Local()), lambda: _stored(paper), lambda: _stored(paper, twice=True)]
    bare, stored, again = _by_turns(works)
    what = "campaign flights a second, scored and stored"
    note = f"{paper.flights} flights, ensemble"
    figures = [
        Figure(f"{what}, the paper's filter", paper.flights / stored, "1/s", None, True, note),
        Figure(f"{what}, the navigator", navigator.flights / _stored(navigator), "1/s", None, True,
               f"{navigator.flights} flights, ensemble"),
        Figure("overhead of the store", 100.0 * (stored / bare - 1.0), "%", 3.0, False, "the same rows kept nowhere"),
        Figure("going on where nothing is missing", 100.0 * again / stored, "%", 3.0, False, "of the time to fly it"),
    ]  # fmt: skip
    return [*figures, *_cluster(paper), *(_memory(many) for many in MEMORY_FLIGHTS if many <= max(flights * 10, 1024))]


def _plan(filter_name: str, flights: int) -> Plan:
    return planned(
        [load_scenario("landing")], {}, truth_models=["ensemble"], seed=1, flights=flights,
        changes={"filter.name": filter_name},
    )  # fmt: skip


def _by_turns(works: list[Callable[[], float]]) -> list[float]:
    """The shortest time of each work [s], all tried by turns; the first round, which may compile, is not counted."""
    rounds = [[work() for work in works] for _ in range(ROUNDS + 1)][1:]
    return [min(times) for times in zip(*rounds, strict=True)]


def _fly(plan: Plan, engine: Engine) -> float:
    """How long an engine takes for a campaign's rows [s]."""
    ready = plan.ready(0)
    parts = [Part(first // PART, first, min(PART, plan.flights - first)) for first in range(0, plan.flights, PART)]
    began = time.perf_counter()
    for _ in engine.fly(ready, plan.seed, parts, lambda flown: None):
        pass
    return time.perf_counter() - began


def _stored(plan: Plan, *, twice: bool = False) -> float:
    """How long a campaign takes with its folder [s]; twice: only the second time, when all is there."""
    folder = Path(tempfile.mkdtemp())
    try:
        for _ in range(2 if twice else 1):
            with Store(folder / "campaign").opened(plan) as store:
                began = time.perf_counter()
                run_campaign(plan, Local(), store)
                took = time.perf_counter() - began
        return took
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _cluster(plan: Plan) -> list[Figure]:
    """Ray on one node against threads, both warm; nothing without Ray."""
    if find_spec("ray") is None:
        return []
    from flownav.campaigns.engines import RayCluster

    cluster = RayCluster()
    local, ray = _by_turns([lambda: _fly(plan, Local()), lambda: _fly(plan, cluster)])
    cluster.close()
    return [
        Figure(
            "Ray's overhead on one node", 100.0 * (ray / local - 1.0), "%", 10.0, False, "against threads, both warm"
        )
    ]


def _memory(flights: int) -> Figure:
    """Peak memory of a process that flies a campaign on the paper's filter."""
    with tempfile.TemporaryDirectory() as out:
        given = ["campaign", "landing", "--set", "filter.name=paper", "--flights", str(flights), "--records", "0"]
        script = (
            "import json, re, sys\n"
            "from flownav.cli import main\n"
            f"sys.argv = ['flownav', *{json.dumps([*given, '--json', '--out', str(Path(out) / 'campaign')])}]\n"
            "try:\n    main()\nexcept SystemExit:\n    pass\n"
            "print(re.search(r'VmHWM:\\s*(\\d+)', open('/proc/self/status').read())[1])\n"  # of this process alone
        )
        done = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True)
    mebibytes = int(done.stdout.split()[-1]) / 1024.0
    return Figure(f"peak memory, a campaign of {flights} flights with its page", mebibytes, "MiB", 300.0, False)
