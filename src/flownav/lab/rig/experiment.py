"""One run of the experiment, and several: the rod moves, the sensor looks, the board logs; and the folder of the log.

A folder holds rig.csv, one row a logged moment, and rig.toml, what was set up. Several runs or heights stand side by
side as FOLDER/run-001, run-002, ...
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flownav.core.errors import InputError
from flownav.core.guard import an_output, an_output_folder, written_whole
from flownav.core.marks import marked
from flownav.core.measurement import Array
from flownav.core.provenance import provenance
from flownav.core.text import to_toml
from flownav.lab.optics.camera import Camera, exposed, light_named, refocused
from flownav.lab.optics.firmware import firmware_named
from flownav.lab.optics.pad import pad_named
from flownav.lab.rig.film import Rod, film_swing
from flownav.lab.rig.instruments import (
    COUNTS_PER_REVOLUTION,
    SAMPLE_S,
    SONAR_ECHO_S,
    Messages,
    angle_and_rate,
    counts_of,
    gyro_at,
    messages,
    sonar_at,
)
from flownav.lab.rig.pendulum import EXCITATIONS, move, rod_length, sensor_place, sensor_velocity

LOG_S = 0.01


@dataclass(frozen=True)
class RigSettings:
    """One experiment. The defaults are the one configuration fixed for all heights (docs/how-to/rig.md describes
    it).
    """

    height_m: float = 0.6
    pivot_height_m: float = 2.1
    start_angle_rad: float = 0.0912
    duration_s: float = 25.0
    pad: str = "stripes"
    light: str = "normal"
    firmware: str = "2013-09"
    excitation: str = "swing"
    along: str = "x"
    refocus: float = 1.0
    chain_delay_s: float = 0.070
    gyro_late_s: float = 0.0
    sonar_late_s: float = SONAR_ECHO_S
    runs: int = 1
    seed: int = 1
    camera: Camera = field(default_factory=Camera)

    def at(self, height_m: float) -> RigSettings:
        """This experiment at another height."""
        return replace(self, height_m=height_m)


@dataclass(frozen=True)
class RigLog:
    """Log of the board in one run, one row every LOG_S; the columns of rig.csv."""

    time_s: Array
    encoder_counts: NDArray[np.int64]
    reference_velocity_m_s: Array
    flow_velocity_m_s: Array
    flow_x_dpx: NDArray[np.int64]
    flow_y_dpx: NDArray[np.int64]
    ground_distance_m: Array
    quality: NDArray[np.int64]
    settings: RigSettings
    run: int
    rod_length_m: float


def check(settings: RigSettings) -> None:
    """InputError where an experiment cannot be set up so."""
    s = settings
    for name, value, low, high in (
        ("height", s.height_m, 0.2, 5.0),
        ("pivot height", s.pivot_height_m, s.height_m + 0.1, 20.0),
        ("start angle", s.start_angle_rad, 0.005, 0.6),
        ("duration", s.duration_s, 3.0, 3600.0),
        ("refocus", s.refocus, 0.0, 1.0),
        ("chain delay", s.chain_delay_s, 0.0, 1.0),
        ("gyro late", s.gyro_late_s, -0.2, 0.2),
        ("sonar late", s.sonar_late_s, 0.0, 1.0),
        ("runs", s.runs, 1, 999),
    ):
        if not low <= value <= high:
            raise InputError(f"rig: {name} {value:g}: must be from {low:g} to {high:g}")
    if s.excitation not in EXCITATIONS:
        raise InputError(f"excitation {s.excitation!r}: unknown; known are {', '.join(EXCITATIONS)}")
    if s.along not in ("x", "y"):
        raise InputError(f"rig: along {s.along!r}: x or y, the camera's axis along the swing")
    light_named(s.light)
    firmware_named(s.firmware)


def run_experiment(settings: RigSettings, run: int = 1) -> RigLog:
    """One run, 1 to `settings.runs`; the same seed and run give the same log. InputError where settings are bad."""
    check(settings)
    s = settings
    rng = np.random.default_rng([s.seed, run, round(1e6 * s.height_m)])
    length_m = rod_length(s.excitation, s.pivot_height_m, s.height_m, run, s.runs)
    motion = move(s.excitation, length_m, s.start_angle_rad, s.duration_s, rng)
    sent = _flow_messages(s, run, length_m, motion.time_s, motion.angle_rad, motion.rate_rad_s, rng)
    counts = counts_of(np.interp(np.arange(0.0, s.duration_s, SAMPLE_S), motion.time_s, motion.angle_rad))
    angle, rate = angle_and_rate(counts)
    every = round(LOG_S / SAMPLE_S)
    time_s = np.arange(len(counts), dtype=float)[::every] * SAMPLE_S
    reference = 0.0 + np.asarray(sensor_velocity(angle, rate, length_m)[0])  # type: ignore[arg-type]  # an array passes
    latest = np.searchsorted(sent.arrival_s, time_s, "right") - 1
    held, arrived = np.clip(latest, 0, None), latest >= 0
    along = 0 if s.along == "x" else 1
    return RigLog(
        time_s,
        counts[::every],
        reference[::every],
        np.where(arrived, sent.velocity_m_s[held, along], 0.0),
        np.where(arrived, sent.flow_dpx[held, 0], 0),
        np.where(arrived, sent.flow_dpx[held, 1], 0),
        np.where(arrived, sent.ground_distance_m[held], 0.0),
        np.where(arrived, sent.quality[held], 0),
        s,
        run,
        length_m,
    )


def _flow_messages(
    s: RigSettings, run: int, length_m: float, time_s: Array, angle: Array, rate: Array, rng: np.random.Generator
) -> Messages:
    """The sensor's messages of one motion."""
    firmware, pad = firmware_named(s.firmware), pad_named(s.pad, s.seed)
    camera = refocused(s.camera, s.height_m, s.refocus)
    exposure = exposed(camera, light_named(s.light))
    frames_s = np.arange(exposure.time_s, s.duration_s - exposure.time_s, 1.0 / firmware.frame_rate_hz)
    opened = np.interp(frames_s - 0.5 * exposure.time_s, time_s, angle)
    closed = np.interp(frames_s + 0.5 * exposure.time_s, time_s, angle)
    rod = Rod(length_m, s.height_m, s.along == "x", float(rng.uniform(0.0, 1.0)))
    noise_seed = int(rng.integers(2**31))
    flow, quality = film_swing(opened, closed, rod, pad, camera, exposure, firmware, noise_seed)
    turning = gyro_at(frames_s[1:], time_s, rate, rng, s.gyro_late_s)
    none = np.zeros_like(turning)
    rates = np.stack([none, turning, none] if s.along == "x" else [-turning, none, none], axis=1)
    height = np.asarray(sensor_place(angle, length_m, s.height_m)[1])  # type: ignore[arg-type]  # an array passes
    ranges = sonar_at(frames_s[1:], time_s, height, firmware, rng, s.sonar_late_s)
    return messages(frames_s, flow, quality, rates, ranges, camera.nominal_focal_px, firmware, s.chain_delay_s)


# -- several runs and heights ------------------------------------------------------------------------------------
PAPER_HEIGHTS_M = (0.6, 0.8, 1.0, 1.5)


def run_campaign(
    settings: RigSettings,
    heights_m: Sequence[float] = PAPER_HEIGHTS_M,
    on_run: Callable[[int], object] = lambda done: None,
) -> Iterator[RigLog]:
    """Every run (1 to `settings.runs`) at every height, in that order; InputError before the first where one is bad.

    The kernels release the interpreter, so runs proceed side by side on the machine's cores.
    """
    jobs = [(settings.at(height), run) for height in heights_m for run in range(1, settings.runs + 1)]
    for job, _ in jobs:
        check(job)
    with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:
        for log in pool.map(lambda job: run_experiment(*job), jobs):
            on_run(1)
            yield log


SCHEMA_VERSION = 1
COLUMNS = {
    "t_s": "%.3f",
    "encoder_counts": "%d",
    "reference_velocity_m_s": "%.6f",
    "flow_velocity_m_s": "%.6f",
    "flow_x_dpx": "%d",
    "flow_y_dpx": "%d",
    "ground_distance_m": "%.4f",
    "quality": "%d",
}


def write_rig_folder(log: RigLog, folder: Path, command: str = "", *, dated: bool = True) -> None:
    """Write rig.csv and rig.toml, each whole or not at all. InputError where the folder cannot be written.

    dated: whether rig.toml states when it was written.
    """
    table = np.column_stack([log.time_s if name == "t_s" else getattr(log, name) for name in COLUMNS])
    line = ",".join(COLUMNS.values())
    text = "\n".join([",".join(COLUMNS), *(line % tuple(row) for row in table.tolist())]) + "\n"
    check_rig_folder(folder)
    try:
        with ExitStack() as both:
            rows = text.encode()
            set_up = marked(_set_up(log, command, hashlib.sha256(rows).hexdigest(), dated=dated))
            for name, content in (("rig.csv", rows), ("rig.toml", set_up)):
                both.enter_context(written_whole(folder / name, replacing=True)).write_bytes(content)
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror}); give another name") from error


def run_folders(folder: Path, count: int) -> Iterator[Path]:
    """Where the logs of `count` runs go: the folder itself for one, run-001 ... in it for more."""
    if count == 1:
        yield folder
        return
    for number in range(1, count + 1):
        yield folder / f"run-{number:03d}"


def _set_up(log: RigLog, command: str, digest: str, *, dated: bool) -> str:
    """rig.toml as text; digest: SHA-256 of rig.csv."""
    s, made = log.settings, provenance()
    entries: dict[str, Any] = {"schema_version": SCHEMA_VERSION, "pivot_height_m": log.rod_length_m + s.height_m}
    entries |= {"rod_length_m": log.rod_length_m, "height_m": s.height_m}
    entries |= {"encoder_counts_per_revolution": COUNTS_PER_REVOLUTION}
    entries |= {name: getattr(s, name) for name in ("pad", "firmware", "excitation", "seed", "chain_delay_s")}
    origin: dict[str, Any] = {"source": "flownav rig, simulated from pixels", "command": command, "run": log.run}
    origin |= {"light": s.light, "axis_along_swing": s.along}
    names = ("start_angle_rad", "duration_s", "refocus", "gyro_late_s", "sonar_late_s")
    origin |= {name: getattr(s, name) for name in names} | {"flownav": made["flownav"]}
    origin |= {"rig_csv_sha256": digest} | ({"written_utc": made["written_utc"]} if dated else {})
    return to_toml(_rounded(entries) | {"provenance": _rounded(origin)})


def _rounded(entries: dict[str, Any]) -> dict[str, Any]:
    return {key: round(value, 9) if isinstance(value, float) else value for key, value in entries.items()}


def check_rig_folder(folder: Path) -> None:
    """InputError where a folder may not be written: it is a link, or holds a log that flownav did not write."""
    an_output_folder(folder)
    log, set_up = folder / "rig.csv", folder / "rig.toml"
    an_output(set_up)
    an_output(log, signed_by=set_up)
