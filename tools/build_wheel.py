"""Builds a wheel that carries compiled kernels for both processor levels: `make wheel`.

The commands are run at the lower level, which any machine that builds a wheel has; what they compiled is compiled for
the higher one, and not run. Both lie in `build/kernels` before `pip wheel` packs them into `dist`, with the three C
libraries of Numba's runtime that compiled code calls and the versions of the compilers, so that it flies without them.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
import time
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.metadata import distribution
from pathlib import Path

from flownav.core.compiling.cache import COMPILERS, MAGIC, compilers
from flownav.core.compiling.loaded import LIBRARIES, RUNTIME_FOLDER

PROJECT = Path(__file__).resolve().parents[1]
GATHERED = PROJECT / "build" / "kernels"
DIST = PROJECT / "dist"
DIGEST_BYTES = hashlib.sha256().digest_size
RUN_AT, COMPILED_FOR = "x86-64-v3", ("x86-64-v4",)


def python(*arguments: object, **environment: object) -> None:
    """Run this Python with the project's own source."""
    told = {name: str(value) for name, value in environment.items()}
    env = {**os.environ, "PYTHONPATH": str(PROJECT / "src"), **told}
    subprocess.run([sys.executable, *map(str, arguments)], check=True, env=env)


def gather(folder: Path) -> list[Path]:
    """The kernels of every level, compiled into caches within a folder that holds nothing yet."""
    run_at = folder / RUN_AT
    print(f"running the commands at {RUN_AT}", flush=True)
    python(PROJECT / "tools" / "commands_for_wheel.py", folder / "work", FLOWNAV_CACHE=run_at, FLOWNAV_LEVEL=RUN_AT)
    for level in COMPILED_FOR:
        print(f"compiling the same for {level}", flush=True)
        python(PROJECT / "tools" / "compile_again.py", run_at, FLOWNAV_CACHE=folder / level, FLOWNAV_LEVEL=level)
    caches = {level: sorted((folder / level / "kernels").glob("*.kernel")) for level in (RUN_AT, *COMPILED_FOR)}
    of_commands = {_function(path) for path in caches[RUN_AT]}
    for level, files in caches.items():
        if {_function(path) for path in files} != of_commands:
            raise SystemExit(f"{level} has not the kernels that {RUN_AT} has")
    return [path for files in caches.values() for path in files]


def put_runtime(folder: Path) -> None:
    """Numba's runtime and licence (BSD, 2 clauses) into a folder of their own, and the versions of the compilers."""
    numba = distribution("numba")
    (folder / RUNTIME_FOLDER).mkdir()
    for name in LIBRARIES:
        file = Path(str(numba.locate_file(name.replace(".", "/") + EXTENSION_SUFFIXES[0])))
        shutil.copyfile(file, folder / RUNTIME_FOLDER / file.name)
    licence = next(file for file in numba.files or () if file.name == "LICENSE")
    shutil.copyfile(str(numba.locate_file(licence)), folder / RUNTIME_FOLDER / "numba.LICENSE")
    (folder / COMPILERS).write_text(compilers(), encoding="utf-8")


def _function(kernel: Path) -> str:
    return kernel.name.rpartition("-")[0]


def nameless(kernel: bytes, temporary: Path) -> bytes:
    """A kernel's file without the folders of this machine: one that may raise NumPy's errors names the file that does.

    As many slashes stand for a folder, so that every length in the file stays right.
    """
    payload = kernel[len(MAGIC) + DIGEST_BYTES :]
    for folder in sorted({PROJECT, temporary, Path.home(), Path(sys.prefix), Path(sys.base_prefix)}, reverse=True):
        named = os.fsencode(folder) + b"/"
        payload = payload.replace(named, b"/" * len(named))
    return MAGIC + hashlib.sha256(payload).digest() + payload


def main() -> None:
    """Gather, check, build."""
    start = time.monotonic()
    shutil.rmtree(GATHERED, ignore_errors=True)
    GATHERED.mkdir(parents=True)
    with tempfile.TemporaryDirectory() as temporary:
        kernels = gather(Path(temporary))
        for path in kernels:
            (GATHERED / path.name).write_bytes(nameless(path.read_bytes(), Path(temporary)))
    put_runtime(GATHERED)
    pip = ("-m", "pip", "wheel", "--quiet", "--disable-pip-version-check", "--no-deps", "--no-build-isolation")
    for old in DIST.glob("flownav-*.whl"):
        old.unlink()
    python(*pip, "--wheel-dir", DIST, PROJECT, FLOWNAV_KERNELS=GATHERED)
    (wheel,) = DIST.glob("flownav-*.whl")
    size = wheel.stat().st_size / 1e6
    print(f"{wheel.relative_to(PROJECT)}: {len(kernels)} kernels, {size:.1f} MB, {time.monotonic() - start:.0f} s")


if __name__ == "__main__":
    main()
