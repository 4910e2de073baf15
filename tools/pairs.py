"""Two trees of flownav timed in turn, A B A B: processor time of the same work and the ratio pair by pair.

`python tools/pairs.py OTHER` compares this tree with the one whose `src` folder is OTHER (a worktree of another
commit). In every round each tree has a new process (where its memory lies moves times by several per cent); a line
gives the shortest times [ms] and their ratio this/other, and the median and quartiles of the ratios of the pairs. What
else runs makes times longer, never shorter, so the shortest are the code's own.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

HERE = Path(__file__).parents[1] / "src"


def works() -> dict[str, Callable[[], object]]:
    """The works that are timed, by name; kernels are compiled by a first call."""
    from flownav.core.compile import LANES
    from flownav.simulation.assemble import assemble
    from flownav.simulation.engine import buffers_of, fly_into, fly_one
    from flownav.simulation.scenario import load_scenario, with_filter
    from flownav.studies.benchmark.vehicles import navigator_run, recorded_flight

    found: dict[str, Callable[[], object]] = {}
    for name in ("paper", "landing"):
        flight = assemble(with_filter(load_scenario("landing"), name)).flight
        buffers = buffers_of(flight, LANES, flight.plan.epochs, written=False)
        found[f"1 flight, {name}"] = lambda flight=flight: fly_one(flight, 1)
        found[f"{len(LANES)} flights, {name}"] = lambda flight=flight, b=buffers: fly_into(flight, 1, 0, LANES, b)
    if folder := recorded_flight():
        found["a log through the navigator"] = navigator_run(folder)
    return found


def serve() -> None:
    """Answers a name on standard input by the processor time of the work [s]."""
    answers = sys.stdout
    sys.stdout = sys.stderr
    known = works()
    for work in known.values():
        work()
    print("|".join(known), file=answers, flush=True)
    for line in sys.stdin:
        start = time.process_time()
        known[line.strip()]()
        print(time.process_time() - start, file=answers, flush=True)


class Tree:
    """A process that flies one tree's code."""

    def __init__(self, source: Path) -> None:
        self._process = subprocess.Popen(
            [sys.executable, __file__, "--serve"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            env=os.environ | {"PYTHONPATH": str(source)},
        )  # fmt: skip
        assert self._process.stdin
        assert self._process.stdout
        self._asked, self._told = self._process.stdin, self._process.stdout
        self.names = self._told.readline().strip().split("|")

    def seconds(self, name: str) -> float:
        """Processor time of a work."""
        print(name, file=self._asked, flush=True)
        return float(self._told.readline())

    def end(self) -> None:
        """Its process ends."""
        self._asked.close()
        self._process.wait()


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("other", type=Path, nargs="?", default=HERE, help="the other tree's src folder")
    parser.add_argument("--rounds", type=int, default=6, help="how often the processes are started")
    parser.add_argument("--pairs", type=int, default=5, help="how many pairs of each work in a round")
    parser.add_argument("--only", default="", help="works whose name holds this word")
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.serve:
        serve()
        return
    pairs: dict[str, list[tuple[float, float]]] = {}
    for _ in range(given.rounds):
        this, other = Tree(HERE), Tree(given.other.resolve())
        for name in (name for name in this.names if given.only in name):
            pairs.setdefault(name, []).extend((this.seconds(name), other.seconds(name)) for _ in range(given.pairs))
        this.end()
        other.end()
    print(f"{'work':32s} {'this ms':>9s} {'other ms':>9s} {'ratio':>7s} {'median':>7s}   quartiles")
    for name, found in pairs.items():
        low, middle, high = statistics.quantiles([mine / theirs for mine, theirs in found], n=4)
        mine, theirs = (1e3 * min(column) for column in zip(*found, strict=True))
        print(f"{name:32s} {mine:9.2f} {theirs:9.2f} {mine / theirs:7.3f} {middle:7.3f}   {low:.3f} to {high:.3f}")


if __name__ == "__main__":
    main()
