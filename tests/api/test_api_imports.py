"""What `import flownav` costs: nothing that computes is loaded before it is asked for."""

from __future__ import annotations

import subprocess
import sys

import pytest

HEAVY = ("numpy", "numba", "scipy", "pandas", "polars", "xarray", "plotly", "pyarrow", "pydantic", "typer", "rich")


def loaded_by(code: str) -> set[str]:
    """The modules of HEAVY that a fresh interpreter has after this code."""
    said = f"{code}\nimport sys\nprint(*[name for name in {HEAVY!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", said], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


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
