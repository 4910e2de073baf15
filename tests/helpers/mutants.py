"""Small wrongs put into the package one at a time, and whether the tests named beside each notice: `make mutants`.

The lists are tests/mutants/*.toml, one file a room. A mutation is a file of src/flownav, a text that occurs in it
exactly once, what stands there instead, and the tests that must then fail. All of it happens in a copy of the tree,
whose compiled kernels go into a folder of their own. The named tests must first pass without any mutation.

    python tests/helpers/mutants.py [--jobs N] [PART OF A NAME OR FILE ...]

Exit status: 0 where at least 95 % are killed, 1 where fewer are, 2 where the list or the tests are not in order.
"""

from __future__ import annotations

import argparse
import os
import queue
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[2]
PACKAGE = Path("src") / "flownav"
LISTS = Path("tests") / "mutants"
ASKED_PERCENT = 95.0
LONGEST_S = 600.0  # a mutant that hangs longer is noticed
NOT_COPIED = (".git", ".venv", "out", "dist", "__pycache__", ".*_cache", ".hypothesis", ".benchmarks", "*.egg-info")
# no minutes spent on the smallest failing example, and no memory of the mutant before
CONFTEST = """import hypothesis

hypothesis.settings.register_profile(
    "mutants", database=None, derandomize=True, phases=(hypothesis.Phase.explicit, hypothesis.Phase.generate)
)
hypothesis.settings.load_profile("mutants")
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
    """pytest's exit status (1: a test failed; -1: too long) and the last of what it said."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *(f"tests/{t}" for t in tests)]
    data = os.environ.get("FLOWNAV_DATA") or str(project.parent / "shared" / "data")
    paper = os.environ.get("FLOWNAV_PAPER") or str(project.parent / "shared" / "paper")
    environment = {
        **os.environ,
        "PYTHONPATH": str(tree / "src"),
        "FLOWNAV_CACHE": str(tree.parent / "kernels"),
        "FLOWNAV_DATA": data,
        "FLOWNAV_PAPER": paper,
    }
    try:
        done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True, timeout=LONGEST_S)
    except subprocess.TimeoutExpired:
        return -1, f"took longer than {LONGEST_S:g} s"
    lines = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))] or [done.stdout[-300:]]
    return done.returncode, lines[0].strip()


def verdict(tree: Path, mutant: Mutant, project: Path) -> tuple[str, str, float]:
    """`killed`, `survived` or `broken` (no test could run), by whom, and the seconds it took."""
    path = tree / PACKAGE / mutant.file
    sound = path.read_text(encoding="utf-8")
    begun = time.monotonic()
    try:
        _put(path, mutant.text(tree))
        status, said = tested(tree, mutant.tests, project)
    finally:
        _put(path, sound)
    word = {0: "survived", 1: "killed", -1: "killed"}.get(status, "broken")
    return word, "" if word == "survived" else said, time.monotonic() - begun


def _put(path: Path, text: str) -> None:
    """Write a module; what Python compiled of it goes, since two texts of one length and second look alike to it."""
    path.write_text(text, encoding="utf-8")
    for compiled in (path.parent / "__pycache__").glob(f"{path.stem}.*"):
        compiled.unlink()


def run(project: Path, parts: Sequence[str], jobs: int) -> int:
    """Try every listed mutation and print what became of it; the exit status."""
    mutants = listed(project, parts)
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

    with ExitStack() as copies, ThreadPoolExecutor(jobs) as pool:
        trees = [copies.enter_context(copied(project)) for _ in range(jobs)]
        status, said = tested(trees[0], sorted({test for one in mutants for test in one.tests}), project)
        if status != 0:
            raise ListError(f"the tests fail without any mutation: {said}")
        for tree in trees:
            free.put(tree)
        for mutant, (word, said, seconds) in zip(mutants, pool.map(tried, mutants), strict=True):
            count[word] += 1
            print(f"{word:8}  {seconds:5.1f} s  {mutant.file:34}  {mutant.name:60}  {said}"[:240], flush=True)
    share = 100.0 * count["killed"] / len(mutants)
    survived, broken = count["survived"], count["broken"]
    print(
        f"{count['killed']} of {len(mutants)} killed ({share:.1f} %), {survived} survived, {broken} could not be tried"
    )
    return 0 if share >= ASKED_PERCENT and not broken else 1


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("parts", nargs="*", help="only mutations in whose name or file one of these occurs")
    parser.add_argument("--jobs", type=int, default=max(1, (os.cpu_count() or 1) // 2), help="how many at a time")
    arguments = parser.parse_args()
    try:
        return run(PROJECT, arguments.parts, arguments.jobs)
    except ListError as error:
        print(f"mutants: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
