"""The cache of compiled kernels: what it notices, what it survives, and that it says so in one line."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterator
from pathlib import Path

import pytest

from flownav.core.compiling import cache, closure
from forking import Nursery, nursery

KERNEL = """
import sys
import sysconfig
import numpy as np
from flownav.core.compile import announce_compilation, kernel, unit
from helper_law import law

@kernel
def apply(p):
    p[0] = law(p[0])

def shift(p, n):
    for i in range(n):
        p[i] = p[i] + 1.0

SHIFT = unit(shift, "p", n=2)

if __name__ == "__main__":
    with announce_compilation("test"):
        p = np.array([3.0, 4.0])
        apply(p)
        SHIFT(p)
    print(*p)
"""
LAW = """
from flownav.core.compile import equation

@equation
def law(x):
    '''Twice.'''
    return 2.0 * x  # a remark
"""


class Place:
    """A small program with a kernel and a unit, and a cache of its own.

    mother: what its processes fork from; None: each is a fresh interpreter, which has its own addresses and hashes.
    """

    def __init__(self, folder: Path, mother: Nursery | None = None) -> None:
        self.folder, self.mother = folder, mother
        self.cache = folder / "cache"
        (folder / "program.py").write_text(KERNEL)
        self.write_law(LAW)

    def write_law(self, text: str) -> None:
        (self.folder / "helper_law.py").write_text(text)

    def run(self, **environment: str) -> tuple[str, list[str]]:
        """The program's output, and its lines on standard error without the time of compilation."""
        paths = os.pathsep.join([str(closure.PACKAGE.parent), str(self.folder)])
        env = {**os.environ, "FLOWNAV_CACHE": str(self.cache), "PYTHONPATH": paths, **environment}
        program = self.folder / "program.py"
        done = self.mother.run(program, env) if self.mother else freshly(program, env)
        assert done.returncode == 0, done.stderr
        return done.stdout.strip(), [line for line in done.stderr.splitlines() if "(test) in" not in line]

    def files(self) -> list[Path]:
        return sorted((self.cache / "kernels").glob("*.kernel"))


def freshly(program: Path, env: dict[str, str]) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-W", "error", "-B", str(program)]
    return subprocess.run(command, env=env, capture_output=True, text=True)


COMPILING = ["flownav: compiling apply ...", "flownav: compiling shift ..."]


@pytest.fixture(scope="module")
def mother() -> Iterator[Nursery]:
    with nursery() as running:
        yield running


@pytest.fixture
def place(tmp_path: Path, mother: Nursery) -> Place:
    return Place(tmp_path, mother)


@pytest.fixture(scope="module")
def first_run(tmp_path_factory: pytest.TempPathFactory) -> Place:
    first = Place(tmp_path_factory.mktemp("first"))
    assert first.run() == ("7.0 5.0", COMPILING)
    assert len(first.files()) == 2
    return first


@pytest.fixture
def filled(place: Place, first_run: Place) -> Place:
    shutil.copytree(first_run.cache, place.cache)
    return place


def test_the_second_process_compiles_nothing(filled):
    filled.mother = None  # as little as possible is alike in both
    assert filled.run() == ("7.0 5.0", [])


def test_what_is_loaded_imports_nothing_that_only_compiling_needs(filled):
    filled.mother = None  # what an interpreter says of its imports, it says from its start
    imported = "\n".join(filled.run(PYTHONVERBOSE="1")[1])
    assert ("import 'llvmlite" in imported) == (sysconfig.get_platform() != "linux-x86_64")
    assert ("import 'numba'" in imported) == (sys.platform != "linux")
    assert "import 'numba.np.linalg'" not in imported


def test_a_remark_compiles_nothing(filled):
    filled.write_law(LAW.replace("Twice", "Doubled").replace("a remark", "another"))
    assert filled.run() == ("7.0 5.0", [])


def test_a_change_in_what_is_imported_compiles_anew(filled):
    filled.write_law(LAW.replace("2.0", "3.0"))
    assert filled.run() == ("10.0 5.0", COMPILING)
    filled.write_law(LAW)
    assert filled.run() == ("7.0 5.0", [])


@pytest.mark.parametrize("damages", [("empty", "cut"), ("a byte", "foreign text")])
def test_a_damaged_file_is_replaced(filled, damages):
    for file, damage in zip(filled.files(), damages, strict=True):
        content = file.read_bytes()
        changed = {
            "empty": b"",
            "cut": content[: len(content) // 2],
            "a byte": content[:-1] + bytes([content[-1] ^ 1]),
            "foreign text": b"no kernel at all",
        }
        file.write_bytes(changed[damage])
    out, said = filled.run()
    assert out == "7.0 5.0"
    assert [line for line in said if "damaged" not in line] == COMPILING
    assert len(said) == 4
    assert filled.run() == ("7.0 5.0", [])


def test_a_file_whose_content_cannot_be_loaded_is_replaced(filled):
    for file in filled.files():
        store = cache.Store(filled.cache, filled.folder / "none")
        store.save(file.name, b"\x80\x04]q\x00.")
    out, said = filled.run()
    assert out == "7.0 5.0"
    assert sum("damaged (" in line for line in said) == 2
    assert filled.run() == ("7.0 5.0", [])


def test_a_damaged_memory_of_sources_is_replaced(filled):
    memory = filled.cache / "sources.json"
    expected = closure.Sources(memory).stamp(["flownav.core.frames"])
    for text in ("{", "[1]", '{"a": 3}', ""):
        memory.write_text(text)
        assert closure.Sources(memory).stamp(["flownav.core.frames"]) == expected
        assert memory.read_text().startswith('{"')


@pytest.mark.parametrize("folder", ["/proc/flownav", "/dev/null"])
def test_a_folder_that_cannot_be_made_is_done_without(place, folder):
    out, said = place.run(FLOWNAV_CACHE=folder)
    assert out == "7.0 5.0"
    assert len([line for line in said if "compiling" not in line]) == 1
    assert "are not kept in" in "".join(said)


def test_a_cache_that_is_a_file_is_done_without(place):
    place.cache.write_text("not a folder")
    out, said = place.run()
    assert out == "7.0 5.0"
    assert len([line for line in said if "are not kept in" in line]) == 1
    assert place.cache.read_text() == "not a folder"


def test_a_folder_without_leave_to_write_is_done_without(filled, monkeypatch, capsys):
    store = cache.Store(filled.cache, filled.folder / "none")

    def refuse(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "write_bytes", refuse)
    store.save("a.kernel", b"x")
    store.save("b.kernel", b"x")
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can give files away")
@pytest.mark.parametrize("what", ["folder", "files"])
def test_what_belongs_to_another_user_is_not_run(filled, what):
    given = [filled.cache / "kernels"] if what == "folder" else filled.files()
    for path in given:
        os.chown(path, 12345, 12345)
    out, said = filled.run()
    assert out == "7.0 5.0"
    assert [line for line in said if "compiling" not in line and "belongs to another user" not in line] == []
    assert sum("belongs to another user" in line for line in said) == 1


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="modes are of Unix")
@pytest.mark.parametrize(("what", "mode"), [("folder", 0o777), ("folder", 0o775), ("files", 0o666), ("files", 0o620)])
def test_what_others_may_write_to_is_not_run(filled, what, mode):
    given = [filled.cache / "kernels"] if what == "folder" else filled.files()
    for path in given:
        path.chmod(mode)
    out, said = filled.run()
    assert out == "7.0 5.0"
    assert sum("others may write to it: `chmod -R go-w`); FLOWNAV_CACHE can" in line for line in said) == 1
    for path in given:
        path.chmod(mode & ~0o022)
    assert filled.run() == ("7.0 5.0", [])


def test_what_is_kept_nobody_else_may_write_to_whatever_the_umask(tmp_path):
    before = os.umask(0)
    try:
        store = cache.Store(tmp_path / "cache", tmp_path / "none")
        store.save("x.kernel", b"code")
    finally:
        os.umask(before)
    assert store.own.stat().st_mode & 0o777 == 0o700
    assert (store.own / "x.kernel").stat().st_mode & 0o777 == 0o600
    assert store.load("x.kernel") == b"code"


def kept(folder: Path) -> cache.Store:
    """A store of one kernel in a folder of its own."""
    store = cache.Store(folder, folder / "none")
    store.save("x.kernel", b"code")
    return store


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="modes are of Unix")
@pytest.mark.parametrize("mode", [0o777, 0o775, 0o757])
def test_nor_is_what_lies_where_others_may_rename_it(tmp_path, capsys, mode):
    kept(tmp_path / "cache").own.parent.chmod(mode)
    store = cache.Store(tmp_path / "cache", tmp_path / "none")
    assert store.load("x.kernel") is None
    assert not store.is_writable()
    store.save("y.kernel", b"code")
    assert capsys.readouterr().err.count("others may write to it") == 1
    assert [path.name for path in store.own.iterdir()] == ["x.kernel"]


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="/tmp is root's")
def test_where_each_may_rename_only_what_is_its_own_a_cache_may_lie(tmp_path, capsys):
    kept(tmp_path / "cache").own.parent.chmod(0o1777)
    assert cache.Store(tmp_path / "cache", tmp_path / "none").load("x.kernel") == b"code"
    (tmp_path / "cache" / "kernels").chmod(0o1777)
    assert cache.Store(tmp_path / "cache", tmp_path / "none").load("x.kernel") is None
    assert capsys.readouterr().err.count("others may write to it") == 1


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can give links away")
@pytest.mark.parametrize("linked", ["cache", "cache/kernels"])
def test_another_users_link_leads_nowhere(tmp_path, capsys, linked):
    """Root that keeps a user's home: its kernels, and what it removes, would go wherever the user's link leads."""
    whole = kept(tmp_path / "whole").own
    link = tmp_path / linked
    link.parent.mkdir(exist_ok=True)
    link.symlink_to(whole if linked.endswith("kernels") else whole.parent)
    assert cache.Store(tmp_path / "cache", tmp_path / "none").load("x.kernel") == b"code"
    os.chown(link, 12345, 12345, follow_symlinks=False)
    store = cache.Store(tmp_path / "cache", tmp_path / "none")
    assert store.load("x.kernel") is None
    store.save("y.kernel", b"code")
    assert capsys.readouterr().err.count("it is a link of another user") == 1
    assert [path.name for path in whole.iterdir()] == ["x.kernel"]


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can give folders away")
def test_in_another_users_home_root_makes_nothing(tmp_path, capsys):
    (tmp_path / "cache").mkdir()
    os.chown(tmp_path / "cache", 12345, 12345)
    store = cache.Store(tmp_path / "cache", tmp_path / "none")
    store.save("x.kernel", b"code")
    store.sources.closure(["flownav.core.text"])
    assert list((tmp_path / "cache").iterdir()) == []
    assert "belongs to another user" in capsys.readouterr().err


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="modes are of Unix")
def test_a_memory_of_sources_where_others_may_write_is_not_read_nor_written(tmp_path):
    sources = closure.Sources(tmp_path / "cache" / "sources.json")
    true = sources.closure(["flownav.core.text"])
    false = json.dumps({key: ["0" * 32, []] for key in json.loads((tmp_path / "cache" / "sources.json").read_text())})
    (tmp_path / "cache" / "sources.json").write_text(false)
    (tmp_path / "cache").chmod(0o777)
    assert closure.Sources(tmp_path / "cache" / "sources.json").closure(["flownav.core.text"]) == true
    assert (tmp_path / "cache" / "sources.json").read_text() == false


def test_kernels_that_a_wheel_carries_are_looked_at_first(filled, monkeypatch, capsys):
    store = cache.Store(filled.folder / "other", filled.cache / "kernels")
    for file in filled.files():
        assert store.load(file.name)
    assert store.load("unknown.kernel") is None
    assert capsys.readouterr().err == ""


def test_what_is_not_used_for_long_is_removed(filled):
    old, fresh = filled.files()
    os.utime(old, (0, 0))
    (filled.cache / "kernels-0123456789abcdef").mkdir()
    cache.Store(filled.cache, filled.folder / "none").save("new.kernel", b"x")
    assert fresh.exists()
    assert not old.exists()
    assert not (filled.cache / "kernels-0123456789abcdef").exists()


def test_the_closure_holds_what_is_imported_and_no_face(tmp_path):
    found = closure.Sources(tmp_path / "sources.json").closure(["flownav.simulation.flight"])
    assert {"flownav.simulation.layout", "flownav.vehicle.rotor", "flownav.core.compile", "flownav.core.frames"} <= set(
        found
    )
    assert not any(name.startswith(("flownav.cli", "flownav.report", "flownav.logs")) for name in found)


def test_what_a_process_adds_to_a_module_is_part_of_whatever_imports_it(tmp_path):
    sources = closure.Sources(tmp_path / "sources.json")
    before, apart = sources.stamp(["flownav.simulation.flight"]), sources.stamp(["flownav.core.frames"])
    sources.extend("flownav.simulation.sensor_table", ["flownav.lab.optics.camera"], "one more")
    after = sources.stamp(["flownav.simulation.flight"])
    assert after not in (before, None)
    assert "flownav.lab.optics.camera" in sources.closure(["flownav.simulation.flight"])
    assert sources.stamp(["flownav.core.frames"]) == apart
    sources.extend("flownav.simulation.sensor_table", [], "another")
    assert sources.stamp(["flownav.simulation.flight"]) not in (before, after, None)
    sources.extend("flownav.simulation.sensor_table", ["__main__ of a notebook"], "")  # nobody knows what is in it
    assert sources.stamp(["flownav.simulation.flight"]) is None
    assert sources.stamp(["flownav.core.frames"]) == apart


@pytest.mark.parametrize(
    ("text", "imported"),
    [
        ("import flownav.core.frames", ["flownav.core.frames"]),
        ("from flownav.core import frames as f", ["flownav.core", "flownav.core.frames"]),
        ("from .b import c", ["a.p.b", "a.p.b.c"]),
        ("from . import b", ["a.p", "a.p.b"]),
        ("from .. import b", ["a", "a.b"]),
        ("import os, numpy.linalg\nfrom numba import types", []),
        ("def f():\n    import x.y", []),
        ("from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import x.y\nelse:\n    import z.y", ["z.y"]),
        ("try:\n    import x.y\nexcept ImportError:\n    pass", ["x.y"]),
    ],
)
def test_imports_are_found(text, imported):
    assert list(closure.parse_source(text.encode(), "a.p.m", False).imports) == imported


def test_a_file_changed_since_the_process_began_is_not_trusted(tmp_path, monkeypatch):
    sources = closure.Sources(tmp_path / "sources.json")
    assert sources.stamp(["flownav.core.frames"]) is not None
    monkeypatch.setattr(closure, "START_S", 0.0)
    assert sources.stamp(["flownav.core.frames", "flownav.core.compile"]) is None
