"""No kernel and no unit calls the C library, so that its version and the processor's instructions change no bit."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest
from typer.testing import CliRunner

from flownav.cli import app
from flownav.core.compile import LANES, ONE_LANE, kernel
from flownav.live.loop import warm_up
from flownav.navigation.take import navigator_unit
from machine_code import asked_for, borrowed, codes, compiled_functions, parts

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="reads ELF object files")

# what is one instruction, exact, or no function of floats
EXACT = {
    "abs", "ceil", "degrees", "empty", "empty_like", "float32", "floor", "full", "inf", "int64", "isfinite", "isinf",
    "isnan", "nan", "ones", "pi", "rint", "sqrt", "sum", "uint16", "uint64", "uint8", "zeros",
}  # fmt: skip
PLAIN_C_LIBRARY = "glibc.cpu.hwcaps=-FMA,-FMA_Usable,-AVX2,-AVX2_Usable"
FLIGHT = """
import hashlib
from pathlib import Path
import numpy as np
from flownav.logs.open_log import open_flight
from flownav.replays.fed import as_fed
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import replay
from flownav.simulation.assemble import assemble
from flownav.simulation.engine import fly_written
from flownav.simulation.flight_record import record_of
from flownav.simulation.scenario import load_scenario

setup = assemble(load_scenario("pad_return"))
flown = fly_written(setup.flight, 7, 3)
record_of(setup, flown, 7, 3).save(Path("flight.fnr"), replacing=True)
log = open_flight(Path("flight.fnr"))
again = replay(log, *as_fed(log, ReplayOptions(), None))
for table in (flown.history, flown.fed, again.estimate, again.innovation):
    print(hashlib.sha256(np.where(np.isnan(table), np.nan, table).tobytes()).hexdigest())
"""


@kernel
def sine_of_c(x):
    return np.sin(x) + x**0.3


def test_the_check_finds_a_call():
    sine_of_c(1.0)
    (code,) = codes(sine_of_c)
    assert asked_for(code) == {"sin", "pow"}
    assert borrowed(sine_of_c.py_func) == {"sin"}


@pytest.fixture(scope="module")
def used(tmp_path_factory):
    """The kernels and units that fly, replay, smooth, live, rig and identify have used, with their machine code."""
    place = tmp_path_factory.mktemp("used")
    for line in (
        f"fly landing --no-report --out {place}/one.fnr",
        f"fly landing --flights 17 --no-report --out {place}/many.fnr",
        f"fly landing --filter paper --no-report --out {place}/paper.fnr",
        f"sample csv --out {place}/samples",
        f"replay {place}/samples/flight-csv --smooth --out {place}/again.fnr",
        f"rig --out {place}/rig --duration 6",
        f"identify {place}/rig --out {place}/sensor.toml",
    ):
        done = CliRunner().invoke(app, line.split())
        assert done.exit_code in (0, 1), (line, done.output)
    warm_up()
    assert all(navigator_unit(lanes, lag).address for lanes in (ONE_LANE, LANES) for lag in (False, True))
    return [(part.__name__, code) for part in parts().values() for code in codes(part)]


def test_no_kernel_asks_for_a_function_of_the_c_library(used):
    asked = {(name, symbol) for name, code in used for symbol in asked_for(code)}
    assert asked == set()
    names = [name for name, _ in used]
    assert {"feed_all", "_fill_now", "_release", "go_back", "put_error_statistics", "swing"} <= set(names)
    assert {"response", "film_of_stripes"} <= set(names)
    assert names.count("fly_block") >= 3
    assert names.count("take_one") == 4


def test_no_equation_borrows_a_function_that_the_c_library_computes():
    found = {f"{f.__module__}.{f.__qualname__}": borrowed(f) - EXACT for f in compiled_functions()}
    assert len(found) > 700
    assert {name: names for name, names in found.items() if names} == {}


def test_another_level_of_the_c_library_changes_no_bit(tmp_path):
    def digests(**more):
        done = subprocess.run(
            [sys.executable, "-c", FLIGHT], cwd=tmp_path, env={**os.environ, **more}, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        return done.stdout.split()

    expected = digests()
    assert len(set(expected)) == 4
    assert digests(GLIBC_TUNABLES=PLAIN_C_LIBRARY) == expected
