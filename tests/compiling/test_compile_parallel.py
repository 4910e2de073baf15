"""A unit compiled in a second process: that it is, that nothing depends on it, and that nothing is left of it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from flownav.core.compiling import closure, parallel
from flownav.core.compiling.units import unit
from forking import Nursery, interruptible, nursery

HUNG_S = 120.0  # whatever takes so long hangs
PARTS = """
from flownav.core.compile import invoke, kernel, pointer, unit

def shift(p, n):
    for i in range(n):
        p[i] = p[i] + 1.0

SHIFT = unit(shift, "p", n=2)
OTHER = unit(shift, "p", n=3)

@kernel
def apply(take, p):
    p[0] = 2.0 * p[0]
    invoke(take, pointer(p))
"""
PROGRAM = """
import os, sys
import numpy as np
from flownav.core.compile import announce_compilation, begin_in_parallel, compile_in_parallel, meanwhile
from flownav.core.compiling import parallel
from flownav.core.compiling.cache import STORE
from parts import SHIFT, apply

os.sched_getaffinity = lambda pid: set(range(int(os.environ.get("CORES", "2"))))
sys.executable = os.environ.get("OTHER", sys.executable)
p = np.array([3.0, 4.0])
early = os.environ.get("BEGIN", "")
if early:
    begin_in_parallel("parts", early)
begun = list(parallel._begun.values())
done = []
with meanwhile(lambda: done.append("meanwhile")), announce_compilation("test", os.environ.get("FOR", "")):
    compile_in_parallel(SHIFT, apply, 0, p, whole=os.environ.get("WHOLE", ""))
    made = "elsewhere" if not SHIFT.is_ready and STORE.holds(SHIFT.file_name()) else "here"
    apply(SHIFT.address, p)
print(*p, made, *(done if early else ()), *("begun" for one in begun if one.poll() is not None))
"""
SIDE_BY_SIDE = ["flownav: compiling shift (1 of 2) ...", "flownav: compiling shift, apply (1 of 2) ..."]
TWO = ["flownav: compiled 2 kernels"]
ONE_BY_ONE = ["flownav: compiling shift ...", "flownav: compiling apply ..."]


@pytest.fixture
def place(tmp_path: Path) -> Path:
    (tmp_path / "parts.py").write_text(PARTS)
    (tmp_path / "program.py").write_text(PROGRAM)
    return tmp_path


@pytest.fixture(scope="module")
def mother() -> Iterator[Nursery]:
    with nursery() as running:
        yield running


@pytest.fixture
def run(mother: Nursery) -> Callable[..., tuple[str, list[str]]]:
    return partial(ran, mother)


def environment_of(place: Path, more: dict[str, str]) -> dict[str, str]:
    paths = os.pathsep.join([str(closure.PACKAGE.parent), str(place)])
    return {**os.environ, "FLOWNAV_CACHE": str(place / "cache"), "PYTHONPATH": paths, **more}


def started(place: Path, *command: str, **environment: str) -> subprocess.Popen[str]:
    env = environment_of(place, environment)
    pipes: Any = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.Popen([sys.executable, "-B", *command], env=env, text=True, preexec_fn=interruptible, **pipes)


def ran(mother: Nursery, place: Path, **environment: str) -> tuple[str, list[str]]:
    """The program's output, and its lines about compilation without the time."""
    done = mother.run(place / "program.py", environment_of(place, environment))
    assert done.returncode == 0, done.stderr
    return done.stdout.strip(), [line.partition(" (test) in")[0] for line in done.stderr.splitlines()]


def left_over(place: Path) -> list[Path]:
    return [path for path in (place / "cache").rglob("*") if path.is_file() and path.suffix not in (".kernel", ".json")]


def test_what_both_are_together_is_said_once_in_words_for_people(run, place):
    said = run(place, WHOLE="the simulator, once, about 30 s")[1]
    assert said == ["flownav: compiling the simulator, once, about 30 s ...", "flownav: compiled 2 kernels"]


def test_a_block_says_once_what_it_compiles_for_and_no_names_of_parts(run, place):
    said = run(place, FOR="what a replay needs, once, about 20 s", WHOLE="the simulator")[1]
    assert said == ["flownav: compiling what a replay needs, once, about 20 s ...", "flownav: compiled 2 kernels"]


def test_both_are_compiled_side_by_side_and_only_once(run, place):
    assert run(place) == ("7.0 5.0 elsewhere", [*SIDE_BY_SIDE, "flownav: compiled 2 kernels"])
    assert len(list((place / "cache" / "kernels").glob("*.kernel"))) == 2
    assert run(place) == ("7.0 5.0 elsewhere", [])
    assert left_over(place) == []


def test_a_unit_is_begun_before_it_is_asked_for_where_nothing_has_been_compiled(run, place):
    assert run(place, BEGIN="SHIFT") == ("7.0 5.0 elsewhere meanwhile begun", [*SIDE_BY_SIDE, *TWO])
    assert run(place, BEGIN="SHIFT") == ("7.0 5.0 elsewhere", [])
    assert left_over(place) == []


def test_a_unit_that_was_begun_and_is_not_needed_is_given_up(run, place):
    assert run(place, BEGIN="OTHER") == ("7.0 5.0 elsewhere meanwhile begun", [*SIDE_BY_SIDE, *TWO])
    assert left_over(place) == []


def test_one_core_begins_nothing(run, place):
    assert run(place, BEGIN="SHIFT", CORES="1")[0] == "7.0 5.0 here"


def test_one_core_compiles_one_after_the_other(run, place):
    assert run(place, CORES="1") == ("7.0 5.0 here", [*ONE_BY_ONE, "flownav: compiled 2 kernels"])


def test_what_is_in_the_cache_is_not_compiled_beside(run, place):
    run(place)
    (kernel,) = (place / "cache" / "kernels").glob("*apply*")
    kernel.unlink()
    assert run(place)[1] == ["flownav: compiling apply ...", "flownav: compiled 1 kernel"]


def test_without_a_cache_all_is_compiled_here(run, place):
    out, said = run(place, FLOWNAV_CACHE="/proc/flownav")
    assert out == "7.0 5.0 here"
    assert sum("are not kept in" in line for line in said) == 1
    assert [line for line in said if "compiling" in line] == ONE_BY_ONE


def test_another_process_that_fails_costs_time_only(run, place):
    out, said = run(place, OTHER="/bin/false")
    assert out == "7.0 5.0 here"
    assert said == [*SIDE_BY_SIDE, "flownav: compiling shift ...", "flownav: compiled 2 kernels"]


def test_another_process_that_cannot_be_started_is_done_without(run, place):
    assert run(place, OTHER=str(place / "none"))[0] == "7.0 5.0 here"


def test_an_interrupted_program_leaves_no_process(place):
    script = place / "slow"
    script.write_text(f"#!/bin/sh\necho $$ > {place}/pid.part\nmv {place}/pid.part {place}/pid\nexec sleep 1000\n")
    script.chmod(0o755)
    with started(place, str(place / "program.py"), OTHER=str(script)) as program:
        until = time.monotonic() + HUNG_S
        while not (place / "pid").exists():
            assert time.monotonic() < until
            time.sleep(0.05)
        while program.poll() is None:  # one that LLVM's callback swallows is pressed again
            assert time.monotonic() < until
            program.send_signal(signal.SIGINT)
            time.sleep(0.5)
        program.communicate(timeout=HUNG_S)
    assert program.returncode != 0
    with pytest.raises(ProcessLookupError):
        os.kill(int((place / "pid").read_text()), 0)


def test_the_other_process_ends_with_its_parent(place):
    with started(place, "-m", "flownav.core.compiling.parallel", "parts", "SHIFT") as other:
        assert other.wait(HUNG_S) == 1
    assert left_over(place) == []


def test_a_unit_that_no_other_process_finds_has_no_name():
    def nothing(p):
        p[0] = 0.0

    assert parallel.name_of(unit(nothing, "p")) is None
