"""`flownav build`: the navigator for a processor, written as what an integrator puts into a project."""

import hashlib
import json
import shutil
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jinja2 import Environment, PackageLoader

from flownav.core.compiling import portable
from flownav.core.errors import InputError, arg
from flownav.core.files import folder_written_whole
from flownav.core.measurement import Array, Sensor
from flownav.core.version import __version__
from flownav.export.onboard import interface, targets, wasm
from flownav.export.onboard.archive import archive
from flownav.export.onboard.board import Board
from flownav.export.onboard.code import WITHOUT, machine_code
from flownav.export.onboard.constants import VECTORS, digests_of, number, settings_file, vectors_file
from flownav.export.onboard.elf import image_of, read_object, shared_object
from flownav.export.onboard.interface import ABI, SYMBOLS, Rates, header, script
from flownav.export.onboard.manifest import MANIFEST, require_own
from flownav.export.onboard.page import page_of
from flownav.logs.log import FedSegment
from flownav.navigation import progress, waiting
from flownav.navigation.feed import rate_hz
from flownav.navigation.kernel_settings import NO_STATED_NOISE, Equipment, FlowNoise, carries_lag
from flownav.navigation.loop import start_navigator
from flownav.navigation.rings import Given, given_of
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.tape import empty_tape
from flownav.navigation.waiting_records import Sizes


@dataclass(frozen=True)
class Flight:
    """Readings of a flight for settings and test vectors: its name, what its navigator was fed, and how it was set.

    gps_delay_s: how old a fix is when it arrives.
    """

    name: str
    segment: FedSegment
    settings: NavigatorSettingsFile
    flow_noise: FlowNoise
    gps_delay_s: float = 0.0


class Asked(NamedTuple):
    """Request for a build. without: parts that are left out (`WITHOUT`)."""

    target: str = "linux-x86_64"
    cpu: str = ""
    features: str = ""
    rates: Rates = Rates()
    without: tuple[str, ...] = ()


class Code(NamedTuple):
    """An object file, how many bytes of code and of constants it has, and whether the flow's lag is in it."""

    content: bytes
    code_bytes: int
    constant_bytes: int
    lag: bool


def check(asked: Asked) -> targets.Target:
    """The target. InputError where LLVM knows no such processor, or what is left out is no part."""
    if strange := set(asked.without) - set(WITHOUT):
        raise InputError(f"{arg('without')} {', '.join(sorted(strange))}: choose from {', '.join(WITHOUT)}")
    target = targets.target_of(asked.target, asked.cpu, asked.features)
    try:
        portable.target_machine(target.processor)
    except portable.NoProcessorError as error:
        known = ", ".join(targets.NAMES)
        raise InputError(f"{arg('target')} {asked.target}: {error}; choose from {known}, or an LLVM triple") from error
    return target


def code_of(asked: Asked, lag: bool) -> Code:
    """The machine code. InputError as `check`."""
    target = check(asked)
    content = machine_code(target.processor, lag, asked.without)
    if target.files[0] == targets.MODULE:
        module = wasm.module(content, tuple(SYMBOLS.values()))
        return Code(module, len(module), 0, lag)
    if content[:4] != b"\x7fELF":
        return Code(content, len(content), 0, lag)
    found = read_object(content)
    code = sum(len(found.sections[i].content) for i in found.loaded if found.sections[i].flags & 4)
    every = sum(len(found.sections[i].content) for i in found.loaded)
    return Code(content, code, every - code, lag)


# -- the navigator's settings -----------------------------------------------------------------------------
def packed_settings(flight: Flight, pace: progress.Pace) -> tuple[Array, bool]:
    """The settings as the library takes them, and whether they carry the flow sensor's lag.

    A navigator on board waits for its first fix from its first reading on.
    """
    on = start_navigator(Equipment(**flight.segment.equipment), flight.settings, empty_tape(0, 0, 0), flight.flow_noise)
    return np.concatenate([on.settings, pace]), bool(carries_lag(on.given.flow))


def pace_of(settings: NavigatorSettingsFile, horizon_s: float, without: tuple[str, ...] = ()) -> progress.Pace:
    """The pace of a navigator on board."""
    protects = 0.0 if "protection" in without else 1.0
    return progress.Pace(horizon_s=horizon_s, start_wait_s=float(settings.start_wait_s), protects=protects)


def rates_of(segment: FedSegment, horizon_s: float) -> Rates:
    """Capacity that rings need for these readings: of the IMU and the external attitude their own rates, of all others
    together the most within a horizon; a flow looks for as long as it is from one reading to the next.
    """
    queue = segment.queue
    inertial, attitudes = queue.sensor == Sensor.IMU, queue.sensor == Sensor.ATTITUDE
    usual = Rates(horizon_s)
    window_s = max(horizon_s, LEAST_WINDOW_S)
    others = queue.t_s if not segment.equipment["use_imu"] else queue.t_s[~inertial]
    attitude_hz = rate_hz(queue.t_s[attitudes]) if segment.equipment["use_attitude"] else 0.0
    return usual._replace(
        imu_hz=_tidy(rate_hz(queue.t_s[inertial])),
        others_hz=_tidy(most_within(others, window_s) / window_s),
        attitude_hz=_tidy(attitude_hz) if attitude_hz > 0.0 else 0.0,
        exposure_s=_exposure_s(queue.t_s[queue.sensor == Sensor.FLOW_RATE], usual.exposure_s),
    )


LEAST_WINDOW_S, TIDY_HZ = 0.1, 5.0
EXPOSURES_S = 0.01, 0.2  # of flow sensors of 100 and 5 Hz


def _exposure_s(t_s: Array, otherwise_s: float) -> float:
    """As long as it is from one reading to the next."""
    hz = rate_hz(t_s)
    return float(np.clip(np.ceil(1000.0 / hz) / 1000.0, *EXPOSURES_S)) if hz > 0.0 else otherwise_s


def _tidy(hz: float) -> float:
    """Up to the next multiple."""
    return max(TIDY_HZ, float(np.ceil(hz / TIDY_HZ - 1e-6)) * TIDY_HZ)


def most_within(t_s: Array, window_s: float) -> int:
    """The most instants, of ones that do not go back, that lie within a window."""
    if not len(t_s):
        return 0
    return int(np.max(np.arange(1, len(t_s) + 1) - np.searchsorted(t_s, t_s - window_s, side="right")))


# -- the folder ---------------------------------------------------------------------------------------------
def build(asked: Asked, flight: Flight, out: Path, *, force: bool = False) -> dict[str, Any]:
    """Write the library, its header, constants, test vectors, example and README into a new folder; what it is.

    force: a folder that was written so before is replaced. InputError where it holds anything else.
    """
    replaces = force and out.is_dir() and any(out.iterdir())
    if replaces:
        require_own(out)
    sizes = asked.rates.sizes
    settings, lag = packed_settings(flight, pace_of(flight.settings, asked.rates.horizon_s, asked.without))
    code = code_of(asked, lag)
    given = list(islice(given_of(flight.segment.queue), VECTORS))
    digests = list(digests_of(given, Board(settings, sizes, lag=lag)))
    files: dict[str, bytes] = _packed(asked, code)
    files["flownav_settings.c"] = settings_file(settings).encode()
    files["flownav_vectors.h"] = vectors_file(given, digests, flight.name).encode()
    stamp = _stamp(files, header(sizes))
    files["flownav.h"] = header(sizes, stamp).encode()
    facts = _facts(asked, code, sizes, len(settings), stamp, flight.name)
    facts["digests"] = [f"{digest:016x}" for digest in digests]
    files |= _written(asked, facts, files, settings, flight)
    facts["files"] = {name: hashlib.sha256(content).hexdigest() for name, content in sorted(files.items())}
    place = out.with_name(f".{out.name}.{stamp}.new") if replaces else out
    with folder_written_whole(place) as folder:
        for name, content in files.items():
            (folder / name).write_bytes(content)
        (folder / MANIFEST).write_text(json.dumps(facts, indent=1) + "\n", encoding="utf-8")
    if replaces:
        shutil.rmtree(out)
        place.rename(out)
    return facts


def _packed(asked: Asked, code: Code) -> dict[str, bytes]:
    """The code, as its processor's tools take it."""
    files = targets.target_of(asked.target, asked.cpu, asked.features).files
    if files[0] == targets.MODULE:
        return {targets.MODULE: code.content}
    if code.content[:4] != b"\x7fELF":
        return {"flownav.o": code.content}
    found = {targets.LIBRARY: archive(code.content, "flownav.o")}
    if targets.SHARED in files:
        found[targets.SHARED] = shared_object(read_object(code.content), targets.SHARED)
    return found


def _stamp(files: dict[str, bytes], head: str) -> str:
    """The hash of everything that decides what the library does."""
    whole = hashlib.sha256(head.encode())
    for name in sorted(files):
        whole.update(name.encode() + files[name])
    return whole.hexdigest()[:16]


def _facts(asked: Asked, code: Code, sizes: Sizes, settings: int, stamp: str, flight: str) -> dict[str, Any]:
    """Facts of the library: its build, sizes and rates."""
    return {
        "build": stamp,
        "version": __version__,
        "abi": ABI,
        "target": asked.target,
        "cpu": asked.cpu,
        "features": asked.features,
        "without": list(asked.without),
        "lag": code.lag,
        "flight": flight,
        "rates": asked.rates._asdict(),
        "code_bytes": code.code_bytes,
        "constant_bytes": code.constant_bytes,
        "settings_bytes": 8 * settings,
        "navigator_bytes": 8 * (progress.BOARD_ROWS + waiting.rows_of(sizes)),
        "outcome_bytes": 8 * interface.OUTCOME_NUMBERS,
        "ring_rows": int(sizes.ring),
        "table_rows": int(sizes.table),
    }


def _written(
    asked: Asked, facts: dict[str, Any], files: dict[str, bytes], settings: Array, flight: Flight
) -> dict[str, bytes]:
    """The README, and what shows how the library is used."""
    page = Environment(loader=PackageLoader(__package__, "files"), keep_trailing_newline=True, autoescape=False)
    page.filters["number"] = number
    target = targets.target_of(asked.target, asked.cpu, asked.features)
    words = {
        **facts, "tested": target.tested, "names": [*files], "measured": measured(asked.target), "symbols": SYMBOLS,
        "settings": settings.tolist(), "sizes": asked.rates.sizes, **script(),
    }  # fmt: skip
    if targets.MODULE not in files:
        return {name: page.get_template(f"{name}.j2").render(**words).encode() for name in ("README.md",)} | {
            name: page.get_template(name).render(**words).encode() for name in ("main.c", "CMakeLists.txt")
        }
    around = page.get_template("flownav.js.j2").render(**words)
    readme = page.get_template("README.md.j2").render(**words)
    whole = page_of(files[targets.MODULE], around, flight.name, built_for(flight))
    return {"README.md": readme.encode(), "flownav.js": around.encode(), "flownav.html": whole.encode()}


def built_for(flight: Flight) -> dict[str, Any]:
    """Facts of a flight that a record must hold to be fused by a page."""
    noise = flight.flow_noise
    return {
        "filter": flight.settings.model_dump(),
        "flow_noise": noise._asdict() if noise != NO_STATED_NOISE else None,
        "equipment": flight.segment.equipment,
        "gps_delay_s": flight.gps_delay_s,
    }


def measured(target: str) -> dict[str, Any] | None:
    """Figures that emulation has measured of a target (`tools/onboard.py` writes them); None of others."""
    file = Path(__file__).parent / "files" / "measured.json"
    found: dict[str, dict[str, Any]] = json.loads(file.read_text(encoding="utf-8"))
    return found.get(target)


def image_bytes(code: Code) -> int:
    """Code and constants as they lie in memory."""
    return len(image_of(read_object(code.content)).content)


def readings_of(flight: Flight) -> list[Given]:
    """All readings of a flight."""
    return list(given_of(flight.segment.queue))
