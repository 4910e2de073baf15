"""The cost of `import flownav`: nothing that computes is loaded before it is needed."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

HEAVY = ("numpy", "numba", "scipy", "pandas", "polars", "xarray", "plotly", "pyarrow", "pydantic", "typer", "rich")
# what a command that flies, replays or shows one flight has no use for, though it is installed
NEVER = ("numba", "llvmlite", "pandas", "plotly", "scipy.special", "scipy.linalg", "scipy.signal", "scipy.spatial",
         "scipy.stats", "scipy.ndimage", "scipy.optimize", "scipy.interpolate", "numpy.f2py", "PIL", "ray",
         "matplotlib")  # fmt: skip

SIMULATOR = ("flownav.simulation", "flownav.campaigns", "flownav.control", "flownav.parts")


def loaded_by(code: str, of: tuple[str, ...] = HEAVY) -> set[str]:
    """The modules among these that a fresh interpreter has after this code, all of whose kernels are compiled: the
    compiler itself loads more.
    """
    said = f"{code}\nimport sys\nprint(*[name for name in {of!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", said], capture_output=True, text=True, check=True)
    if "compiling" in done.stderr:
        done = subprocess.run([sys.executable, "-c", said], capture_output=True, text=True, check=True)
    return set(done.stdout.splitlines()[-1].split()) if done.stdout.strip() else set()


def loaded_by_command(*words: str, of: tuple[str, ...] = HEAVY) -> set[str]:
    """The same of a command that ends well."""
    code = f"""
import sys
from flownav.cli import main
sys.argv = ['flownav', *{words!r}]
try:
    main()
except SystemExit as ended:
    assert not ended.code, ended.code
print()"""
    return loaded_by(code, of)


@pytest.mark.parametrize("code", ["import flownav", "import flownav; flownav.__version__; dir(flownav)",
                                  "from flownav import InputError"])  # fmt: skip
def test_the_package_loads_nothing_that_computes(code):
    assert loaded_by(code) == set()


def test_a_function_is_loaded_when_it_is_named():
    assert "numpy" in loaded_by("from flownav import Record")


def test_identify_looks_for_its_logs_before_it_loads_anything(tmp_path):
    code = f"""
import flownav
try:
    flownav.identify([{str(tmp_path / "none.csv")!r}])
except flownav.InputError as error:
    assert 'none.csv: no such file' in str(error), error
else:
    raise SystemExit('found')"""
    assert loaded_by(code) == set()


def test_the_command_looks_for_its_logs_before_it_loads_anything_that_computes(tmp_path):
    code = f"""
import sys
from flownav.cli import main
sys.argv = ['flownav', 'identify', {str(tmp_path / "none.csv")!r}]
try:
    main()
except SystemExit as ended:
    assert ended.code == 2, ended.code"""
    assert not loaded_by(code) & {"numpy", "numba", "scipy"}


@pytest.mark.parametrize("words", [["--help"], ["--version"], ["fly", "--help"], ["campaign", "--help"]])
def test_help_loads_nothing_that_computes(words):
    assert not loaded_by_command(*words) & {"numpy", "numba", "scipy", "pyarrow", "pandas", "plotly"}


@pytest.mark.parametrize("words", [["--list"], ["--list", "--json"]])
def test_the_list_of_samples_is_told_without_flying_any(words):
    assert not loaded_by_command("sample", *words) & {"numpy", "numba", "scipy", "pyarrow", "pandas", "plotly"}


def test_a_flight_its_report_and_its_replay_load_only_what_they_use(tmp_path):
    """By name, not by time: pandas comes with the first array that pyarrow is given, scipy.signal was half of info."""
    record = str(tmp_path / "flight.fnr")
    assert loaded_by_command("fly", "landing", "--no-report", "--out", record, of=NEVER) == set()
    assert loaded_by_command("info", record, of=NEVER) == set()
    again = str(tmp_path / "again.fnr")
    assert loaded_by_command("replay", record, "--no-report", "--out", again, of=(*NEVER, *SIMULATOR)) == set()
    report = loaded_by_command("report", record, "--out", str(tmp_path / "page.html"), of=NEVER)
    assert report <= {"scipy.special", "numpy.f2py"}  # the limits of chi squared


def test_a_log_of_csv_files_is_looked_at_with_no_more(tmp_path):
    made = str(tmp_path / "made")
    loaded_by_command("sample", "csv", "--out", made)
    assert loaded_by_command("info", f"{made}/flight-csv", of=NEVER) == set()


def test_a_log_is_replayed_and_shown_without_the_simulator(tmp_path):
    """Half a second of processor time went into a simulator that no replay by our own navigator flies in."""
    made, record = str(tmp_path / "made"), str(tmp_path / "log.fnr")
    assert "flownav.simulation" in loaded_by_command("sample", "csv", "--out", made, of=SIMULATOR)
    assert loaded_by_command("replay", f"{made}/flight-csv", "--out", record, of=SIMULATOR) == set()
    assert loaded_by_command("info", f"{made}/flight-csv", of=SIMULATOR) == set()
    assert loaded_by_command("report", record, "--out", str(tmp_path / "page.html"), of=SIMULATOR) == set()
    assert loaded_by("from flownav import Record, Sensor, replay", of=SIMULATOR) == set()


@pytest.mark.parametrize(
    "code",
    [
        "import flownav.simulation.engine, flownav.parts.flying, flownav.replays.session",
        "import flownav.cli.fly, flownav.cli.replay, flownav.cli.live, flownav.cli.bench",
    ],
)
def test_benchmark_samples_and_example_parts_are_loaded_where_they_are_asked_for_alone(code):
    apart = ("flownav.studies.benchmark.measures", "flownav.export.samples.kinds", "flownav.parts.examples")
    assert loaded_by(code, apart) == set()


def test_a_command_gives_arrow_no_memory_pool_of_its_own():
    """A flight keeps 14 MB less; who asks for another pool gets it."""
    code = """
import os, sys
from flownav.__main__ import main
sys.argv = ["flownav", "--version"]
try:
    main()
except SystemExit:
    pass
import pyarrow
print(pyarrow.default_memory_pool().backend_name)"""
    for asked, expected in ({}, "system"), ({"ARROW_DEFAULT_MEMORY_POOL": "mimalloc"}, "mimalloc"):
        outside = {name: value for name, value in os.environ.items() if name != "ARROW_DEFAULT_MEMORY_POOL"} | asked
        done = subprocess.run([sys.executable, "-c", code], env=outside, capture_output=True, text=True, check=True)
        assert done.stdout.splitlines()[-1] == expected
