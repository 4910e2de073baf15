"""Small wrongs put into the package one at a time, and whether the tests named beside each notice: `make mutants`.

The lists are tests/mutants/*.toml, one file a room. A mutation is a file of src/flownav, a text that occurs in it
exactly once, what stands there instead, and the tests that must then fail. All of it happens in a copy of the tree,
whose compiled kernels go into a folder of their own. The named tests must first pass without any mutation.

A whole run is hundreds of test runs, so each is made cheap: it is forked from a process that has imported what all
tests import, finds the kernels that do not depend on the mutated line compiled, draws each example of Hypothesis once
and shrinks none, and leaves out tests that are marked slow or that need real time.

    python tests/helpers/mutants.py [--jobs N] [--every K] [PART OF A NAME OR FILE ...]

Exit status: 0 where at least 95 % are killed, 1 where fewer are, 2 where the list or the tests are not in order.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import queue
import shutil
import signal
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import permutations
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[2]
PACKAGE = Path("src") / "flownav"
LISTS = Path("tests") / "mutants"
ASKED_PERCENT = 95.0
LONGEST_S = 600.0  # a mutant that hangs longer is noticed
CHEAP = "not slow and not real_time"
WARM = multiprocessing.get_context("forkserver")
WARM.set_forkserver_preload(["numba", "numpy", "scipy.optimize", "scipy.stats", "pydantic"])
NOT_COPIED = (".git", ".venv", "out", "dist", "__pycache__", ".*_cache", ".hypothesis", ".benchmarks", "*.egg-info")
# no minutes spent on the smallest failing example, and no memory of the mutant before
CONFTEST = """import hypothesis

hypothesis.settings.register_profile(
    "mutants", database=None, derandomize=True, deadline=None,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
    phases=(hypothesis.Phase.explicit, hypothesis.Phase.generate),
)
"""


class ListError(Exception):
    """The list of mutations is not in order, in one line."""


@dataclass(frozen=True)
class Mutant:
    """One wrong: `old` in `file` (below src/flownav) becomes `new`; `tests` (below tests/) must notice."""

    name: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]

    def text(self, project: Path) -> str:
        """The file's text with the wrong in it. ListError where the list does not fit the tree."""
        path = project / PACKAGE / self.file
        if not path.is_file():
            raise ListError(f"{self.name}: no such file: {self.file}")
        text = path.read_text(encoding="utf-8")
        if (count := text.count(self.old)) != 1:
            raise ListError(f"{self.name}: in {self.file} this occurs {count} times, not once: {self.old!r}")
        if self.old == self.new:
            raise ListError(f"{self.name}: changes nothing")
        for test in self.tests:
            if not (project / "tests" / test.partition("::")[0]).exists():
                raise ListError(f"{self.name}: no such test: tests/{test}")
        return text.replace(self.old, self.new)


def listed(project: Path = PROJECT, parts: Sequence[str] = ()) -> list[Mutant]:
    """Every mutation of the lists, or those in whose name or file one of the parts occurs; checked against the tree."""
    found = []
    for path in sorted((project / LISTS).glob("*.toml")):
        for entry in tomllib.loads(path.read_text(encoding="utf-8"))["mutant"]:
            found.append(Mutant(**{**entry, "tests": tuple(entry["tests"])}))
    names = [mutant.name for mutant in found]
    if twice := {name for name in names if names.count(name) > 1}:
        raise ListError(f"named twice: {', '.join(sorted(twice))}")
    for mutant in found:
        mutant.text(project)
    return [one for one in found if not parts or any(part in f"{one.file} {one.name}" for part in parts)]


@contextmanager
def copied(project: Path) -> Iterator[Path]:
    """A copy of the tree that lives as long as it is used."""
    with tempfile.TemporaryDirectory(prefix="flownav-mutants-") as folder:
        tree = Path(folder) / "tree"
        shutil.copytree(project, tree, ignore=shutil.ignore_patterns(*NOT_COPIED))
        (tree / "conftest.py").write_text(CONFTEST, encoding="utf-8")
        yield tree


def tested(tree: Path, tests: Sequence[str], project: Path) -> tuple[int, str]:
    """pytest's exit status (1: a test failed; -1: too long) and the end of its output."""
    said = tree.parent / "said"
    process = WARM.Process(target=_run_tests, args=(tree, [f"tests/{test}" for test in tests], project, said))
    process.start()
    process.join(LONGEST_S)
    if process.exitcode is None:
        os.killpg(process.pid or 0, signal.SIGKILL)
        process.join()
        return -1, f"took longer than {LONGEST_S:g} s"
    text = said.read_text(encoding="utf-8", errors="replace")
    lines = [line for line in text.splitlines() if line.startswith(("FAILED", "ERROR"))] or [text[-300:]]
    return process.exitcode, lines[0].strip()


def _run_tests(tree: Path, tests: list[str], project: Path, said: Path) -> None:
    """pytest on the tree's package, in this process, which is made anew for it; `said`: where its words go."""
    import pytest

    os.setsid()
    os.environ["PYTHONPATH"] = str(tree / "src")
    os.environ["FLOWNAV_CACHE"] = str(tree.parent / "kernels")
    for name in ("data", "paper"):
        os.environ.setdefault(f"FLOWNAV_{name.upper()}", str(project.parent / "shared" / name))
    sys.path.insert(0, str(tree / "src"))
    os.chdir(tree)
    file = os.open(said, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    for stream in (1, 2):
        os.dup2(file, stream)
    options = ["-x", "-q", "-m", CHEAP, "-p", "no:cacheprovider", "-p", "no:benchmark"]
    sys.exit(int(pytest.main([*options, "--hypothesis-profile=mutants", *tests])))


def warmed(tree: Path, kernels: Path) -> None:
    """The kernels of a cache for the tree's own: files are named after all that they are made of, so none is wrong."""
    own = tree.parent / "kernels" / "kernels"
    own.mkdir(parents=True, exist_ok=True)
    for file in (kernels / "kernels").glob("*.kernel"):
        if not (own / file.name).exists():
            shutil.copy2(file, own)


def verdict(tree: Path, mutant: Mutant, project: Path) -> tuple[str, str, float]:
    """`killed`, `survived` or `broken` (no test could run), by whom, and the seconds it took."""
    path = tree / PACKAGE / mutant.file
    sound = path.read_text(encoding="utf-8")
    kernels = tree.parent / "kernels" / "kernels"
    kept = set(kernels.glob("*"))
    begun = time.monotonic()
    try:
        _put(path, mutant.text(tree))
        status, said = tested(tree, mutant.tests, project)
    finally:
        _put(path, sound)
        for file in set(kernels.glob("*")) - kept:
            file.unlink()  # nobody will ask for a mutant's kernels again
    word = {0: "survived", 1: "killed", -1: "killed"}.get(status, "broken")
    return word, "" if word == "survived" else said, time.monotonic() - begun


def _put(path: Path, text: str) -> None:
    """Write a module; what Python compiled of it goes, since two texts of one length and second look alike to it."""
    path.write_text(text, encoding="utf-8")
    for compiled in (path.parent / "__pycache__").glob(f"{path.stem}.*"):
        compiled.unlink()


def run(project: Path, parts: Sequence[str], jobs: int, every: int = 1, kernels: Path | None = None) -> int:
    """Try every listed mutation, or each `every`-th, and print what became of it; the exit status.

    kernels: a cache of kernels that are compiled already.
    """
    mutants = listed(project, parts)[::every]
    if not mutants:
        raise ListError(f"no mutation is called {' or '.join(parts) or 'anything'}")
    count = {"killed": 0, "survived": 0, "broken": 0}
    free: queue.SimpleQueue[Path] = queue.SimpleQueue()

    def tried(mutant: Mutant) -> tuple[str, str, float]:
        tree = free.get()
        try:
            return verdict(tree, mutant, project)
        finally:
            free.put(tree)

    def sound(test: str) -> tuple[int, str]:
        tree = free.get()
        try:
            return tested(tree, [test], project)
        finally:
            free.put(tree)

    begun = time.monotonic()
    with ExitStack() as copies, ThreadPoolExecutor(jobs) as pool:
        trees = [copies.enter_context(copied(project)) for _ in range(jobs)]
        for tree in trees:
            if kernels is not None:
                warmed(tree, kernels)
            free.put(tree)
        named = sorted({test for one in mutants for test in one.tests})
        for test, (status, said) in zip(named, pool.map(sound, named), strict=True):
            if status != 0:
                raise ListError(f"the tests fail without any mutation: {said or f'{test}, exit status {status}'}")
        for one, other in permutations(trees, 2):
            warmed(one, other.parent / "kernels")
        left: list[str] = []
        for mutant, (word, said, seconds) in zip(mutants, pool.map(tried, mutants), strict=True):
            count[word] += 1
            left += [f"  {word}: {mutant.file}: {mutant.name}"] if word != "killed" else []
            print(f"{word:8}  {seconds:5.1f} s  {mutant.file:34}  {mutant.name:60}  {said}"[:240], flush=True)
    share = 100.0 * count["killed"] / len(mutants)
    survived, broken = count["survived"], count["broken"]
    print("\n".join([*left, f"{(time.monotonic() - begun) / 60.0:.0f} min"]))
    print(
        f"{count['killed']} of {len(mutants)} killed ({share:.1f} %), {survived} survived, {broken} could not be tried"
    )
    return 0 if share >= ASKED_PERCENT and not broken else 1


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("parts", nargs="*", help="only mutations in whose name or file one of these occurs")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="how many at a time")
    parser.add_argument("--every", type=int, default=1, help="only each N-th of them, as a sample")
    arguments = parser.parse_args()
    try:
        kernels = Path(os.environ.get("FLOWNAV_CACHE") or Path.home() / ".cache" / "flownav")
        return run(PROJECT, arguments.parts, arguments.jobs, arguments.every, kernels)
    except ListError as error:
        print(f"mutants: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
