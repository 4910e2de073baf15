"""`flownav build` and `flownav verify` as an integrator meets them: the folder, its example run, errors."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import subprocess
from pathlib import Path

import jsonschema
import pytest

import flownav
from command import run
from fed_records import queue_of_flight, record_of
from flownav.api.building import flight_of, interface
from flownav.cli import options
from flownav.cli.schemas import schema_of
from flownav.export.onboard import targets
from flownav.export.onboard.board import Board
from flownav.export.onboard.code import WITHOUT
from flownav.export.onboard.package import pace_of, packed_settings, rates_of, readings_of

FILES = {
    "linux-x86_64": {"libflownav.a", "libflownav.so"},
    "linux-aarch64": {"libflownav.a", "libflownav.so"},
    "cortex-m7": {"libflownav.a"},
}
SOURCES = {
    "flownav.h",
    "flownav_settings.c",
    "flownav_vectors.h",
    "main.c",
    "CMakeLists.txt",
    "README.md",
    "manifest.json",
}
BROWSER = {
    "flownav.wasm",
    "flownav.html",
    "flownav.js",
    "flownav.h",
    "flownav_settings.c",
    "flownav_vectors.h",
    "README.md",
    "manifest.json",
}


@pytest.fixture(scope="module")
def record(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("flight") / "flight.fnr"
    record_of(queue_of_flight()).save(path)
    return path


@pytest.fixture(scope="module")
def built(record, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("built") / "native"
    done = run("build", "--target", "linux-x86_64", "--record", record, "--out", folder)
    assert done.returncode == 0, done.stderr
    assert re.search(r"Code \d+\.\d kB, constants \d", done.stdout)
    assert f"`flownav verify {folder}` looks at it again, and runs it" in " ".join(done.stdout.split())
    return folder


def compiled(folder: Path, to: Path, *more: str) -> Path:
    """The example, by the README's own line."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler `cc` here: Debian's gcc")
    files = [folder / "main.c", folder / "flownav_settings.c", folder / "libflownav.a"]
    subprocess.run([compiler, "-O2", "-Wall", "-Werror", *more, *files, "-o", to], check=True)
    return to


# -- what is written ------------------------------------------------------------------------------------------
@pytest.mark.parametrize("target", [name for name in options.TARGETS if name != "c-header"])
def test_a_folder_holds_what_a_project_needs(target, record, tmp_path):
    done = run("build", "--target", target, "--record", record, "--out", tmp_path / "out", "--json")
    assert done.returncode == 0, done.stderr
    facts = json.loads(done.stdout)
    jsonschema.validate(facts, schema_of("build"))
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == (BROWSER if target == "wasm32" else FILES[target] | SOURCES)
    assert facts["folder"] == str(tmp_path / "out")
    assert facts["target"] == target
    for name, digest in facts["files"].items():
        assert hashlib.sha256((tmp_path / "out" / name).read_bytes()).hexdigest() == digest
    assert facts["build"] in (tmp_path / "out" / "flownav.h").read_text()
    readme = (tmp_path / "out" / "README.md").read_text()
    assert str(facts["navigator_bytes"]) in readme
    assert "{{" not in readme
    assert "None" not in readme


def test_the_example_says_the_digests_that_python_said(built, tmp_path):
    done = subprocess.run([compiled(built, tmp_path / "check")], capture_output=True, text=True, check=False)
    manifest = json.loads((built / "manifest.json").read_text())
    lines = done.stdout.splitlines()
    assert done.returncode == 0, done.stdout
    assert [line.split()[1] for line in lines[:-1]] == manifest["digests"]
    assert "north" in lines[-1]


def test_the_example_tells_of_a_processor_that_differs(built, tmp_path):
    spoilt = tmp_path / "spoilt"
    shutil.copytree(built, spoilt)
    settings = (spoilt / "flownav_settings.c").read_text()
    changed = settings.replace(".horizon_s = 0.27", ".horizon_s = 0.2")
    assert changed != settings
    (spoilt / "flownav_settings.c").write_text(changed)
    done = subprocess.run([compiled(spoilt, tmp_path / "check")], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "differs" in done.stdout.splitlines()[0]


AT_REST = """
#include <math.h>
#include "own.c"
int main(void) {
  const double gyro[3] = {0.0, 0.0, 0.0}, accel[3] = {0.0, 0.0, -9.80665}, pos[3] = {10.0, 20.0, -1.0};
  flownav_state state;
  int i, said = 0;
  start();
  if (where(0.0, &state)) return 1;
  for (i = 1; i <= 3000; ++i) {
    said += on_imu(0.01 * i, gyro, accel) != FLOWNAV_TAKEN;
    if (i % 20 == 0) said += on_gps(0.01 * i, pos) != FLOWNAV_TAKEN;
    between();
  }
  if (said != 0 || !where(30.0, &state)) return 2;
  return fabs(state.pos_ned_m[0] - pos[0]) < 0.5 && fabs(state.pos_ned_m[2] - pos[2]) < 0.5 && state.aid == 0.0 ? 0 : 3;
}
"""


def test_the_readme_is_a_program_that_navigates(built, tmp_path):
    """With nothing but the header, the library and the README: its source, called at rest under GPS."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler `cc` here: Debian's gcc")
    (source,) = re.findall(r"```c\n(.*?)```", (built / "README.md").read_text(), re.DOTALL)
    (tmp_path / "own.c").write_text(source)
    (tmp_path / "rest.c").write_text(AT_REST)
    strict = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", f"-I{built}"]
    libraries = [built / "flownav_settings.c", built / "libflownav.a", "-lm"]
    subprocess.run([compiler, *strict, tmp_path / "rest.c", *libraries, "-o", tmp_path / "rest"], check=True)
    assert subprocess.run([tmp_path / "rest"], check=False).returncode == 0


@pytest.mark.skipif(shutil.which("cmake") is None, reason="no cmake here: Debian's cmake")
def test_cmake_builds_the_example(built, tmp_path):
    made = tmp_path / "made"
    subprocess.run(["cmake", "-S", built, "-B", made], check=True, capture_output=True)
    subprocess.run(["cmake", "--build", made, "--target", "flownav_check"], check=True, capture_output=True)
    assert subprocess.run([made / "flownav_check"], check=False, capture_output=True).returncode == 0


def test_the_same_call_writes_the_same_bytes(built, record, tmp_path):
    again = flownav.build("linux-x86_64", tmp_path / "again", record=record)
    assert again["files"] == json.loads((built / "manifest.json").read_text())["files"]


def test_c_header_alone_prints_the_interface(built):
    done = run("build", "--target", "c-header")
    assert done.returncode == 0
    assert done.stdout.startswith("/* flownav:")
    assert "flownav_take(flownav_nav *nav" in done.stdout
    assert done.stdout == interface()


def test_another_processor_by_its_triple(record, tmp_path):
    facts = flownav.build(
        "riscv64-unknown-linux-gnu", tmp_path / "out", record=record, cpu="generic-rv64", features="+m,+d"
    )
    assert (tmp_path / "out" / "libflownav.a").read_bytes().startswith(b"!<arch>\n")
    assert facts["code_bytes"] > 30_000
    assert "Tested: not run by anybody" in (tmp_path / "out" / "README.md").read_text()


def test_settings_and_rates_that_are_asked_for(record, tmp_path):
    (tmp_path / "own.toml").write_text("start_wait_s = 3.5\n")
    facts = flownav.build(
        "cortex-m7", tmp_path / "out", record=record, settings=tmp_path / "own.toml", without=["protection"],
        horizon_s=0.1, imu_hz=400.0, others_hz=20.0,
    )  # fmt: skip
    assert ".start_wait_s = 3.5" in (tmp_path / "out" / "flownav_settings.c").read_text()
    assert facts["rates"] == {
        "horizon_s": 0.1,
        "imu_hz": 400.0,
        "others_hz": 20.0,
        "attitude_hz": 0.0,
        "exposure_s": 0.05,
    }
    assert facts["without"] == ["protection"]
    assert run("verify", tmp_path / "out", record).returncode == 0


def test_options_are_those_that_there_are():
    assert targets.NAMES == options.TARGETS
    assert tuple(WITHOUT) == options.PARTS


# -- what is verified -------------------------------------------------------------------------------------------
def digests(record: Path, every: int) -> list[tuple[int, int]]:
    flight = flight_of(record)
    rates = rates_of(flight.segment, 0.27)
    settings, _ = packed_settings(flight, pace_of(flight.settings, rates.horizon_s))
    board, found = Board(settings, rates.sizes), []
    for count, given in enumerate(readings_of(flight), 1):
        board.take(given)
        if count % every == 0:
            found.append((count, board.digest()))
    board.finish()
    return [*found, (0, board.digest())]


def test_a_folder_is_verified(built, record):
    done = run("verify", built, record)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("8 of 8 digests are equal")


def test_force_replaces_what_was_built_and_nothing_else(record, tmp_path):
    def built(*more: str):
        return run("build", "--target", "linux-x86_64", "--record", record, "--out", tmp_path / "out", *more)

    assert built().returncode == 0
    assert "out is there already (--force replaces it); writing" in " ".join(built().stderr.split())
    assert (tmp_path / "out-1" / "flownav.h").is_file()
    (tmp_path / "out" / "main.c").write_text("changed\n")
    assert built("--force").returncode == 0
    assert run("verify", tmp_path / "out", record).returncode == 0
    (tmp_path / "out" / "mine.c").write_text("int mine;\n")
    done = built("--force")
    assert done.returncode == 2
    assert "mine.c is not of `flownav build`; give another name, or move it away" in " ".join(done.stderr.split())
    assert (tmp_path / "out" / "mine.c").is_file()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "out-1"]


def test_a_file_that_was_changed(built, record, tmp_path):
    shutil.copytree(built, tmp_path / "changed")
    (tmp_path / "changed" / "flownav.h").write_text("")
    done = run("verify", tmp_path / "changed", record)
    assert done.returncode == 1
    assert "not as it was written: flownav.h" in " ".join(done.stderr.split())


def test_what_a_board_says_line_by_line(record, tmp_path):
    found = digests(record, 500)
    (tmp_path / "said.txt").write_text("board 1\n" + "".join(f"{n} {digest:016X} ok\n" for n, digest in found[:-1]))
    assert run("verify", tmp_path / "said.txt", record).returncode == 0
    assert run("verify", f"{found[-1][1]:016x}", record).returncode == 0
    wrong = [(n, digest ^ (1 if n == 1500 else 0)) for n, digest in found[:-1]]
    (tmp_path / "said.txt").write_text("".join(f"{n} 0x{digest:016x}\n" for n, digest in wrong))
    done = run("verify", tmp_path / "said.txt", record)
    said = " ".join(done.stderr.split())
    assert done.returncode == 1
    assert "the first difference is after 1500 readings" in said
    assert f"here {found[2][1]:016x}, there {wrong[2][1]:016x}; after 1000 all was equal" in said
    facts = json.loads(run("verify", tmp_path / "said.txt", record, "--json").stdout)
    jsonschema.validate(facts, schema_of("verify"))
    assert (facts["equal"], facts["same"], facts["differs"]) == (False, 1000, 1500)


# -- what cannot be -----------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("build", "--target", "pdp11"), "--target pdp11"),
        (("build", "--target", "cortex-m7", "--without", "wheels"), "--without"),
        (("build", "--target", "cortex-m7", "--horizon", "3"), "--horizon 3.0: must be from 0.0 to 1.0"),
        (("build", "--target", "c-header", "--out", "x"), "--target c-header: it prints the header and nothing else"),
        (("build", "--target", "cortex-m7", "--record", "absent.fnr"), "absent.fnr"),
        (("verify", "absent"), "absent: neither 16 hexadecimal digits, nor a file of digests, nor a folder"),
        (("verify", "."), "not a folder of `flownav build`"),
        (("verify", "empty.txt"), "no line of it is a number of readings and 16 hexadecimal digits"),
        (("verify", "twice.txt"), "the numbers of readings do not grow; it holds more than one run"),
    ],
)
def test_what_cannot_be_is_said_in_one_line(arguments, said, tmp_path):
    (tmp_path / "empty.txt").write_text("nothing\n")
    (tmp_path / "twice.txt").write_text("5 0123456789abcdef\n5 0123456789abcdef\n")
    done = run(*arguments, cwd=tmp_path)
    assert done.returncode == 2, done.stdout
    assert said in " ".join(done.stderr.split())
    assert {path.name for path in tmp_path.iterdir()} == {"empty.txt", "twice.txt"}


def test_a_digest_of_more_readings_than_there_are(record, tmp_path):
    (tmp_path / "said.txt").write_text("999999 0123456789abcdef\n")
    done = run("verify", tmp_path / "said.txt", record)
    assert done.returncode == 2
    assert "a digest is reported after 999999 readings, and the flight has" in " ".join(done.stderr.split())
