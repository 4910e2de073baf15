"""The test vectors of a folder of `flownav build`, run by its own code wherever that can be done on this machine.

A library of this processor is loaded, and its example compiled; libraries of ELF run in unicorn, modules in wasmtime
and in headless Chromium. An emulator that is not there is named, and is no error.
"""

import platform
import re
import shutil
import subprocess
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from flownav.export.onboard import targets
from flownav.export.onboard.constants import VECTORS_A_DIGEST
from flownav.export.onboard.interface import Rates
from flownav.export.onboard.library_boards import EmulatedBoard, LibraryBoard, NativeBoard, WasmBoard
from flownav.export.onboard.page import digests_page
from flownav.export.onboard.vectors import Vectors, vectors_of
from flownav.navigation.waiting_records import Sizes

LONGEST_S = 120.0
BROWSERS = "chromium", "chromium-browser", "google-chrome"
QUIET = "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run"
EMULATORS = "pip install 'flownav[emulators]'"
DIGEST = re.compile(r"\b[0-9a-f]{16}\b")
ELF = b"\x7fELF"


class NotHereError(Exception):
    """The folder's code cannot run in this place: why."""


class FailedError(Exception):
    """The folder's code does not compile, or ends, in a place that has all it needs: how."""


class Ran(NamedTuple):
    """A place where the vectors were run: how many digests were compared and are equal, after how many readings the
    first differs, and, where nothing was run, or it failed, why.
    """

    where: str
    compared: int
    equal: int
    differs: int | None = None
    why: str | None = None


class Built(NamedTuple):
    """A folder of `flownav build`: its place, its target, room for readings, its vectors."""

    folder: Path
    target: str
    sizes: Sizes
    vectors: Vectors


Place = tuple[str, Callable[[Built], Sequence[str]]]


def runs_of(folder: Path, manifest: dict[str, Any]) -> Iterator[Ran]:
    """Each place for this target, and the digests there compared with those of the manifest."""
    built = Built(folder, manifest["target"], Rates(**manifest["rates"]).sizes, vectors_of(folder))
    for where, run in places(built.target):
        try:
            reported = run(built)
        except NotHereError as reason:
            yield Ran(where, 0, 0, why=str(reason))
        except FailedError as reason:
            yield compared(where, (), manifest["digests"])._replace(why=str(reason))
        else:
            yield compared(where, reported, manifest["digests"])


def compared(where: str, reported: Sequence[str], expected: Sequence[str]) -> Ran:
    """Digests of a place beside the expected ones; what a place did not report differs."""
    right = [i < len(reported) and reported[i] == digest for i, digest in enumerate(expected)]
    differs = None if all(right) else (right.index(False) + 1) * VECTORS_A_DIGEST
    return Ran(where, len(expected), sum(right), differs)


def places(target: str) -> Sequence[Place]:
    """Where a target's code can run: a name for people, and what runs it."""
    if target == "wasm32":
        return ("wasmtime", in_wasmtime), ("headless Chromium", in_browser)
    if target == "cortex-m7":
        return (("unicorn", in_unicorn),)
    if target in targets.PROCESSES.values():
        return ("this process", natively), ("its main.c, compiled here", as_program), ("unicorn", in_unicorn)
    return ()


# -- places -----------------------------------------------------------------------------------------------------
def natively(built: Built) -> Sequence[str]:
    """The shared object, loaded by this process."""
    _require_this_processor(built)
    return _digests(built, NativeBoard(built.vectors.settings, built.sizes, (built.folder / targets.SHARED).resolve()))


def as_program(built: Built) -> Sequence[str]:
    """The example, compiled by the README's line and run."""
    _require_this_processor(built)
    compiler = _tool("a C compiler", "cc")
    sources = [built.folder / name for name in ("main.c", "flownav_settings.c", targets.LIBRARY)]
    with TemporaryDirectory() as temporary:
        program = Path(temporary) / "check"
        try:
            _output([compiler, "-O2", *sources, "-o", program])
            lines = _output([program]).splitlines()
        except NotHereError as reason:
            raise FailedError(str(reason)) from None
    return [line.split()[1] for line in lines if line[:1].isdigit()]


def in_unicorn(built: Built) -> Sequence[str]:
    """The object within the static library, in an emulator."""
    packed = (built.folder / targets.LIBRARY).read_bytes()
    try:
        board = EmulatedBoard(built.vectors.settings, built.sizes, packed[packed.index(ELF) :])
    except ImportError:
        raise NotHereError(f"unicorn is not installed: {EMULATORS}") from None
    return _digests(built, board)


def in_wasmtime(built: Built) -> Sequence[str]:
    """The module, in wasmtime."""
    try:
        board = WasmBoard(built.vectors.settings, built.sizes, (built.folder / targets.MODULE).read_bytes())
    except ImportError:
        raise NotHereError(f"wasmtime is not installed: {EMULATORS}") from None
    return _digests(built, board)


def in_browser(built: Built) -> Sequence[str]:
    """The module and the script around it, in a page that a browser opens from a file."""
    browser = _tool("a browser", *BROWSERS)
    script = (built.folder / "flownav.js").read_text(encoding="utf-8")
    module = (built.folder / targets.MODULE).read_bytes()
    with TemporaryDirectory() as temporary:
        page = Path(temporary) / "vectors.html"
        page.write_text(digests_page(module, script, built.vectors.readings, VECTORS_A_DIGEST), encoding="utf-8")
        profile = f"--user-data-dir={Path(temporary) / 'profile'}"
        shown = _output([browser, *QUIET, profile, "--virtual-time-budget=60000", "--dump-dom", page.as_uri()])
    return DIGEST.findall(shown.partition('id="digests">')[2].partition("<")[0])


def _digests(built: Built, board: LibraryBoard) -> list[str]:
    """The digest after every `VECTORS_A_DIGEST` readings."""
    found = []
    for count, given in enumerate(built.vectors.readings, 1):
        board.take(given)
        if count % VECTORS_A_DIGEST == 0:
            found.append(f"{board.digest():016x}")
    return found


def _require_this_processor(built: Built) -> None:
    if targets.PROCESSES.get(platform.machine()) != built.target or platform.system() != "Linux":
        raise NotHereError(f"this machine is {platform.system()} on {platform.machine()}")


def _tool(what: str, *names: str) -> str:
    found = next(filter(None, map(shutil.which, names)), None)
    if found is None:
        raise NotHereError(f"{what} ({', '.join(names)}) is not installed")
    return found


def _output(command: Sequence[str | Path]) -> str:
    """A program's output, whatever its status says of the digests."""
    try:
        done = subprocess.run(
            list(map(str, command)), capture_output=True, text=True, errors="replace", timeout=LONGEST_S, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise NotHereError(f"{Path(command[0]).name} did not run: {error}") from None
    if not done.stdout and done.returncode:
        raise NotHereError(f"{Path(command[0]).name} has failed: {(done.stderr.strip().splitlines() or ['?'])[-1]}")
    return done.stdout
