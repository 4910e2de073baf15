"""`flownav verify DIR`: a folder's own code runs its vectors wherever this machine can, and what differs is found."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import jsonschema
import numpy as np
import pytest

import flownav
from browsing import CHROMIUM
from command import run
from fed_records import queue_of_flight, record_of
from flownav.api.building import flight_of
from flownav.cli.schemas import schema_of
from flownav.core.errors import InputError
from flownav.export.onboard import runs
from flownav.export.onboard.interface import Rates
from flownav.export.onboard.manifest import manifest_of
from flownav.export.onboard.package import pace_of, packed_settings, readings_of
from flownav.export.onboard.vectors import vectors_of
from flownav.export.onboard.verify import logged_digests

NATIVE = "linux-x86_64"
RATES = Rates()._asdict()
here = pytest.mark.skipif(sys.platform != "linux", reason="the library of this processor is one of Linux")


@pytest.fixture(scope="module")
def record(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("flight") / "flight.fnr"
    record_of(queue_of_flight()).save(path)
    return path


@pytest.fixture(scope="module")
def folders(record, tmp_path_factory) -> dict[str, Path]:
    place = tmp_path_factory.mktemp("built")
    for target in (NATIVE, "linux-aarch64", "cortex-m7", "wasm32"):
        flownav.build(target, place / target, record=record)
    return {path.name: path for path in place.iterdir()}


@pytest.fixture
def copy(folders, tmp_path) -> Path:
    return Path(shutil.copytree(folders[NATIVE], tmp_path / "copy"))


def test_constants_of_c_are_read_back_to_the_last_bit(folders, record):
    flight = flight_of(record)
    settings, readings = vectors_of(folders[NATIVE])
    expected, _ = packed_settings(flight, pace_of(flight.settings, 0.27))
    np.testing.assert_array_equal(settings, expected)
    assert len(readings) == 400
    for read, given in zip(readings, readings_of(flight), strict=False):
        assert (read.t_s, read.sensor) == (given.t_s, given.sensor)
        np.testing.assert_array_equal(read.numbers, given.numbers)


@pytest.mark.parametrize(
    ("target", "where"),
    [
        pytest.param(NATIVE, {"this process", "its main.c, compiled here", "unicorn"}, marks=here),
        ("linux-aarch64", {"unicorn"}),
        ("cortex-m7", {"unicorn"}),
        ("wasm32", {"wasmtime"}),
    ],
)
def test_a_folders_own_code_runs_its_vectors(target, where, folders):
    done = run("verify", folders[target], "--json")
    assert done.returncode == 0, done.stderr
    facts = json.loads(done.stdout)
    jsonschema.validate(facts, schema_of("verify"))
    ran = {each["where"]: each for each in facts["ran"] if each["why"] is None}
    assert where - set(ran) <= (set() if shutil.which("cc") else {"its main.c, compiled here"})
    assert all((each["compared"], each["equal"], each["differs"]) == (8, 8, None) for each in ran.values())


@pytest.mark.browser
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here")
def test_a_browser_runs_the_vectors_from_a_file(folders):
    manifest = manifest_of(folders["wasm32"])
    built = runs.Built(folders["wasm32"], "wasm32", None, vectors_of(folders["wasm32"]))  # type: ignore[arg-type]
    assert list(runs.in_browser(built)) == manifest["digests"]


def test_the_same_by_the_option_of_build(folders):
    done = run("build", "--verify", folders["cortex-m7"])
    assert done.returncode == 0, done.stderr
    assert done.stdout == run("verify", folders["cortex-m7"]).stdout
    assert "unicorn: 8 of 8 digests are equal" in done.stdout
    refused = run("build", "--verify", folders["cortex-m7"], "--target", NATIVE)
    assert (refused.returncode, "--verify: it builds nothing" in " ".join(refused.stderr.split())) == (2, True)
    assert "--target: choose from linux-x86_64" in " ".join(run("build").stderr.split())


def test_code_that_differs_is_named_with_the_reading(copy, monkeypatch):
    digests = manifest_of(copy)["digests"]
    monkeypatch.setattr(runs, "in_unicorn", lambda _: [*digests[:3], "0" * 16, *digests[4:]])
    facts = flownav.verify(copy)
    found = {each["where"]: each for each in facts["ran"]}["unicorn"]
    assert (facts["equal"], facts["differs"]) == (False, None)
    assert (found["compared"], found["equal"], found["differs"]) == (8, 7, 200)


def test_digests_that_are_not_reported_differ():
    assert runs.compared("a board", ["a"], ["a", "b", "c"]) == runs.Ran("a board", 3, 1, 100)
    assert runs.compared("a board", ["a", "b"], ["a", "b"]).differs is None


def test_settings_of_another_flight_do_not_pass(copy):
    """The library takes the settings that lie in the folder: changed ones give other digests, wherever it runs."""
    settings = copy / "flownav_settings.c"
    settings.write_text(settings.read_text().replace(".horizon_s = 0.27", ".horizon_s = 0.2"))
    found = list(runs.runs_of(copy, manifest_of(copy)))
    assert all(each.differs == 50 for each in found if each.why is None)
    assert any(each.why is None for each in found)


@here
@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler here")
@pytest.mark.parametrize("main", ["int main(void) { return }", "int main(void) { return 3; }"])
def test_a_program_that_does_not_compile_or_ends_is_no_pass(main, copy):
    """It counted as a place that is not here, and the folder as verified."""
    (copy / "main.c").write_text(main)
    found = {each.where: each for each in runs.runs_of(copy, manifest_of(copy))}["its main.c, compiled here"]
    assert (found.compared, found.equal, found.differs) == (8, 0, 50)
    assert "has failed" in found.why


def test_what_was_changed_is_not_run(copy):
    (copy / "main.c").write_text("changed\n")
    facts = flownav.verify(copy)
    assert (facts["changed"], facts["ran"], facts["equal"]) == (["main.c"], [], False)


def test_what_is_not_installed_is_named_and_no_error(folders, copy, monkeypatch):
    monkeypatch.setenv("PATH", "")
    monkeypatch.setitem(sys.modules, "flownav.export.onboard.emulated", None)
    monkeypatch.setitem(sys.modules, "wasmtime", None)
    why = {each["where"]: each["why"] for path in (copy, folders["wasm32"]) for each in flownav.verify(path)["ran"]}
    assert why["its main.c, compiled here"] == "a C compiler (cc) is not installed"
    assert why["unicorn"] == "unicorn is not installed: pip install 'flownav[emulators]'"
    assert why["wasmtime"] == "wasmtime is not installed: pip install 'flownav[emulators]'"
    assert why["headless Chromium"].startswith("a browser (chromium, ")
    monkeypatch.setattr(runs.platform, "machine", lambda: "riscv64")
    assert {each["where"]: each["why"] for each in flownav.verify(copy)["ran"]}["this process"] == (
        f"this machine is {runs.platform.system()} on riscv64"
    )


def test_a_processor_that_nothing_here_runs(record, tmp_path):
    flownav.build("riscv64-unknown-linux-gnu", tmp_path / "out", record=record, cpu="generic-rv64", features="+m,+d")
    facts = flownav.verify(tmp_path / "out")
    assert (facts["equal"], facts["ran"]) == (True, [])


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("flownav_settings.c", "nothing", "it holds no `flownav_default_settings`"),
        (
            "flownav_vectors.h",
            "x flownav_vectors[FLOWNAV_VECTORS] = {\n {1.0, 2, 3.0},\n};\n",
            "3 numbers are not a list",
        ),
    ],
)
def test_constants_that_are_none(name, text, said, copy):
    (copy / name).write_text(text)
    with pytest.raises(InputError, match=said):
        vectors_of(copy)


# -- a folder of somebody else -----------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("entry", "value"),
    [
        ("digests", "0123456789abcdef"),
        ("digests", []),
        ("digests", ["x"]),
        ("digests", [7]),
        ("files", ["main.c"]),
        ("files", {"main.c": 1}),
        ("rates", {}),
        ("rates", {"imu_hz": 100.0}),
        ("rates", {**RATES, "imu_hz": 1e12}),
        ("rates", {**RATES, "horizon_s": 1e6}),
        ("rates", {**RATES, "exposure_s": "long"}),
        ("rates", {**RATES, "others_hz": float("nan")}),
        ("without", "pad"),
        ("lag", 2),
        ("target", None),
        ("build", 0),
    ],
)
def test_a_manifest_that_states_what_cannot_be_is_one_line(entry, value, copy):
    path = copy / "manifest.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {entry: value}))
    with pytest.raises(InputError, match=rf"not a folder of `flownav build` \(manifest.json: {entry} is not as"):
        flownav.verify(copy)


@pytest.mark.parametrize("content", [b"", b"[]", b"\xff", b"[" * 100_000, b"{}", b" " * (5 << 20)])
def test_a_manifest_that_is_none_is_one_line(content, copy):
    (copy / "manifest.json").write_bytes(content)
    with pytest.raises(InputError, match=r"manifest.json|not a folder of `flownav build`") as error:
        flownav.verify(copy)
    assert "\n" not in str(error.value)


def test_code_that_the_manifest_does_not_name_is_named_and_not_run(copy):
    path = copy / "manifest.json"
    facts = json.loads(path.read_text())
    del facts["files"]["main.c"]
    path.write_text(json.dumps(facts))
    (copy / "main.c").write_text("int main(void) { return 0; }\n")
    (copy / "notes.txt").write_text("mine\n")
    found = flownav.verify(copy)
    assert (found["changed"], found["ran"], found["equal"]) == (["main.c"], [], False)


@pytest.mark.parametrize(
    ("name", "old", "new", "said"),
    [
        ("flownav_settings.c", ".horizon_s = 0.27", ".horizon_s = 0.2.7", r"could not convert string to float"),
        ("flownav_settings.c", "  .horizon_s = 0.27,\n", "", r"\d+ numbers; the navigator has \d+"),
        ("flownav_vectors.h", "\n};\n", ",\n {1.0, 99, " + "0, " * 11 + "0},\n};\n", "a reading is of no sensor"),
        ("flownav_vectors.h", "\n};\n", ",\n {1.0, NAN, " + "0, " * 11 + "0},\n};\n", "a reading is of no sensor"),
    ],
)
def test_constants_that_cannot_be(name, old, new, said, copy):
    text = (copy / name).read_text()
    width = 2 + len(vectors_of(copy).readings[0].numbers)
    assert old in text
    (copy / name).write_text(text.replace(old, new.replace("0, " * 11, "0, " * (width - 3)), 1))
    with pytest.raises(InputError, match=said):
        vectors_of(copy)


@pytest.mark.parametrize("line", ["9" * 5000 + " 0123456789abcdef\n", "\u0661 0123456789abcdef\n"])
def test_a_number_of_readings_that_is_none(line, tmp_path):
    (tmp_path / "lines").write_text(line, encoding="utf-8")
    with pytest.raises(InputError, match="no line of it is a number of readings"):
        logged_digests(str(tmp_path / "lines"))


def test_a_file_of_four_gigabytes_of_nothing_is_refused_by_its_size(tmp_path):
    with (tmp_path / "lines").open("wb") as file:
        file.truncate(4 << 30)
    with pytest.raises(InputError, match="larger than 32 MB; cut it to the lines with digests"):
        logged_digests(str(tmp_path / "lines"))
