"""Kernels for a wheel, and the wheel itself: installed, it flies without compiling anything (`make wheel-test`)."""

from __future__ import annotations

import json
import os
import pickle
import re
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest

import build_wheel
import compile_again
from flownav.core.compiling import cache, closure
from places import PROJECT

PARTS = """
from flownav.core.compile import LANES, ONE_LANE, kernel, unit

def double(p, lanes):
    for lane in range(len(lanes)):
        p[lane] = p[lane] * 2.0

ONE, MANY = unit(double, "p", lanes=ONE_LANE), unit(double, "p", lanes=LANES)

@kernel
def total(a):
    return a[0] + a[1]
"""
USE = "import numpy as np; import parts; parts.ONE(np.ones(1)); parts.MANY(np.ones(16)); print(parts.total(np.ones(2)))"
AGAIN = str(PROJECT / "tools" / "compile_again.py")


def in_python(place: Path, cache: str, level: str, *command: str) -> str:
    paths = os.pathsep.join([str(closure.PACKAGE.parent), str(place)])
    told = {"PYTHONPATH": paths, "FLOWNAV_CACHE": str(place / cache), "FLOWNAV_LEVEL": level}
    done = subprocess.run(
        [sys.executable, "-B", *command], env={**os.environ, **told}, capture_output=True, text=True, check=True
    )
    assert done.stderr == ""
    return done.stdout.strip()


@pytest.mark.skipif(sysconfig.get_platform() != "linux-x86_64", reason="wheels with kernels are built there")
def test_kernels_are_compiled_for_a_level_without_being_run(tmp_path):
    (tmp_path / "parts.py").write_text(PARTS)
    assert in_python(tmp_path, "v3", "x86-64-v3", "-c", USE) == "2.0"
    assert in_python(tmp_path, "v4", "x86-64-v4", AGAIN, str(tmp_path / "v3")) == "3"
    of_v3, of_v4 = ({path.name for path in (tmp_path / level / "kernels").iterdir()} for level in ("v3", "v4"))
    assert len(of_v4) == 3
    assert not of_v3 & of_v4
    for name in of_v4:
        shutil.copy(tmp_path / "v4" / "kernels" / name, tmp_path / "v3" / "kernels")
    # what was compiled for the other level is what that level would have compiled
    again = in_python(tmp_path, "v3", "x86-64-v4", AGAIN, str(tmp_path / "v4"))
    assert again == "3"
    assert {path.name for path in (tmp_path / "v3" / "kernels").iterdir()} == of_v3 | of_v4


def test_a_kernel_and_units_of_a_function_are_found():
    from flownav.navigation.take import navigate_lanes, navigate_one

    found = list(compile_again.parts_of("flownav.navigation.take", "take_one"))
    assert found[:2] == [navigate_one, navigate_lanes]
    assert list(compile_again.parts_of("flownav.navigation.take", "navigate")) == []


def test_an_installed_library_is_one_wherever_it_lies():
    assert closure.is_of_library("/home/user/.local/lib/python3.11/site-packages/pydantic/__init__.py")
    assert closure.is_of_library("/usr/lib/python3/dist-packages/scipy/__init__.py")
    assert not closure.is_of_library("/home/user/project/law.py")


def test_a_kernel_names_no_folder_of_this_machine(tmp_path):
    store = cache.Store(tmp_path / "own", tmp_path / "shipped")
    places = [PROJECT / "src" / "law.py", tmp_path / "work", Path.home() / "law.py"]
    store.save("named.kernel", pickle.dumps([str(place) for place in places]))
    kernel = (store.own / "named.kernel").read_bytes()
    store.shipped.mkdir()
    (store.shipped / "named.kernel").write_bytes(build_wheel.nameless(kernel, tmp_path))
    payload = store.load("named.kernel")  # its checksum is right
    slashes = ["/" * len(f"{folder}/") for folder in (PROJECT, tmp_path, Path.home())]
    expected = [slashes[0] + "src/law.py", slashes[1] + "work", slashes[2] + "law.py"]
    assert payload is not None
    assert pickle.loads(payload) == expected


# pages are drawn by the script that the wheel brings; what needs more says so in one line
WITHOUT_EXTRAS = """
from pathlib import Path
import flownav
from flownav.lab.optics.frame_files import read_frames
from flownav.report import html, panels
assert "plotly.js" in html.plotly_script()[:200]
for lacking in (panels.plotly, lambda: read_frames([Path("frame.png")])):
    try:
        lacking()
    except flownav.InputError as error:
        print(error)
"""


# -- a wheel without kernels -------------------------------------------------------------------------------------
def built(place: Path, **environment: str) -> Path:
    """A wheel with these variables set. It takes a second to build."""
    outside = {name: value for name, value in os.environ.items() if name != "FLOWNAV_KERNELS"} | environment
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(place)]
    subprocess.run(command, cwd=PROJECT, env=outside, capture_output=True, check=True)
    (wheel,) = place.glob("flownav-*.whl")
    return wheel


def required(wheel: Path) -> list[str]:
    """The packages that it needs without any extra."""
    with zipfile.ZipFile(wheel) as file:
        (name,) = (name for name in file.namelist() if name.endswith(".dist-info/METADATA"))
        lines = file.read(name).decode().splitlines()
    found = [line.removeprefix("Requires-Dist: ") for line in lines if line.startswith("Requires-Dist: ")]
    return [one for one in found if "extra ==" not in one]


@pytest.fixture(scope="module")
def plain_wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel that an index would have: for all machines, without kernels."""
    return built(tmp_path_factory.mktemp("built"))


def test_a_wheel_asks_for_a_compiler_where_it_has_no_kernels_alone(plain_wheel, tmp_path):
    kernels = tmp_path / "kernels"
    kernels.mkdir()
    (kernels / "one.kernel").write_bytes(b"kernel")
    able = required(built(tmp_path, FLOWNAV_KERNELS=str(kernels)))
    assert sorted(required(plain_wheel)) == sorted([*able, "numba>=0.61"])
    assert not any(one.startswith(("numba", "llvmlite")) for one in able)


def test_everything_that_is_no_code_ships_too(plain_wheel):
    package = closure.PACKAGE
    data = {path.relative_to(package.parent).as_posix() for path in package.rglob("*")
            if path.is_file() and path.suffix not in (".py", ".pyc") and "kernels" not in path.parts}  # fmt: skip
    kinds = {Path(name).suffix for name in data}
    assert {".toml", ".json", ".j2", ".css", ".js", ".csv"} <= kinds
    with zipfile.ZipFile(plain_wheel) as file:
        shipped = set(file.namelist())
    assert data <= shipped
    assert {"flownav/data/samples/flight.toml", "flownav/data/schemas/commands.json", "flownav/py.typed"} <= shipped
    assert {"flownav/report/vendor/plotly.min.js", "flownav/report/vendor/plotly.LICENSE"} <= shipped
    assert not any(name.startswith(("tests/", "docs/")) for name in shipped)


@pytest.mark.slow
def test_the_wheel_works_in_an_empty_environment(plain_wheel, tmp_path):
    """Installed with its dependencies and nothing else: the commands of the README that need no compiler's minutes."""
    place = tmp_path / "empty"
    subprocess.run([sys.executable, "-m", "venv", str(place)], check=True)
    pip = [str(place / "bin" / "python"), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, "--constraint", str(PROJECT / "constraints.txt"), str(plain_wheel)], check=True)
    outside = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "FLOWNAV_CACHE")}
    outside |= {"FLOWNAV_CACHE": str(tmp_path / "cache"), "COLUMNS": "80"}

    def flownav(*arguments: str) -> str:
        command = [str(place / "bin" / "flownav"), *arguments]
        done = subprocess.run(command, env=outside, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout

    assert flownav("--version").startswith("flownav 0.")
    assert "--gps" in flownav("fly", "--help")
    said = flownav("sample", "csv", "ulog", "dataflash", "rig")
    assert "samples/flight-csv" in said
    for name in ("flight-csv", "flight.ulg", "flight.bin"):
        assert "flow and" in flownav("info", f"samples/{name}")
    left_out = json.loads(flownav("sample", "--json"))["notes"]
    assert left_out == ["tlog is left out: `pip install 'flownav[live]'` adds it"]
    python = [str(place / "bin" / "python"), "-c"]
    lacking = subprocess.run(
        [*python, WITHOUT_EXTRAS], env=outside, cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert lacking.stdout.splitlines() == [
        "plots in Python need the package plotly: pip install 'flownav[plots]'",
        "pictures need Pillow: pip install 'flownav[pictures]'",
    ]


# -- the wheel itself --------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def wheel() -> Path:
    named = os.environ.get("FLOWNAV_WHEEL")
    if not named:
        pytest.skip("`make wheel-test` builds the wheel that this test installs")
    return PROJECT / named


@pytest.fixture(scope="module")
def flownav(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The command in a fresh environment that borrows this one's libraries, not its flownav."""
    place = tmp_path_factory.mktemp("installed")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(place)], check=True)
    (site,) = place.glob("lib/python*/site-packages")
    pip = [sys.executable, "-m", "pip", "--python", str(place / "bin" / "python"), "install", "--quiet"]
    subprocess.run([*pip, "--disable-pip-version-check", "--no-deps", "--no-index", str(wheel)], check=True)
    borrowed = [path for path in sys.path if path.endswith("-packages")]  # after pip, which would find a flownav there
    (site / "borrowed.pth").write_text("\n".join(borrowed) + "\n")
    where = [str(place / "bin" / "python"), "-P", "-c", "import flownav; print(flownav.__file__)"]
    outside = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    found = subprocess.run(where, env=outside, capture_output=True, text=True, check=True).stdout.strip()
    assert Path(found).is_relative_to(place)
    return place / "bin" / "flownav"


@pytest.mark.slow
@pytest.mark.parametrize("level", ["", "x86-64-v3"])
@pytest.mark.parametrize(
    "more", [["sortie"], ["landing"], ["landing", "--filter", "paper"], ["landing", "--flights", "2"]], ids="-".join
)
def test_an_installed_wheel_flies_without_compiling(flownav, tmp_path, level, more):
    environment = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "FLOWNAV_LEVEL")}
    environment |= {"FLOWNAV_CACHE": str(tmp_path / "cache")} | ({"FLOWNAV_LEVEL": level} if level else {})
    command = [str(flownav), "fly", *more, "--no-report", "--json", "--out", str(tmp_path / "flight.fnr")]
    done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout)["scenario"] == more[0]
    assert "compil" not in done.stderr
    assert not list((tmp_path / "cache").rglob("*.kernel"))


@pytest.mark.slow
def test_the_wheel_is_for_this_python_and_names_no_folder_of_this_machine(wheel):
    version = f"cp{sys.version_info[0]}{sys.version_info[1]}"
    assert wheel.name.endswith(f"-{version}-{version}-linux_x86_64.whl")
    kernels = 0
    with zipfile.ZipFile(wheel) as file:
        for name in file.namelist():
            content = file.read(name)
            kernels += name.endswith(".kernel")
            for folder in (PROJECT, Path.home(), Path(sys.prefix), Path(sys.base_prefix)):
                # the folder itself, not one of Numba's builders that ends alike (/opt/rh/gcc-toolset-14/root/)
                named = rb"(?<![\w.-])" + re.escape(os.fsencode(folder)) + b"/"
                assert not re.search(named, content), f"{name} names {folder}"
    assert kernels >= 40
