"""Which sample logs there are, what each holds, how it is written, and what to try with it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from flownav.core.errors import InputError
from flownav.export.samples.csv_folder import write_csv_folder
from flownav.export.samples.dataflash import write_dataflash
from flownav.export.samples.flight import sample_log, sample_record
from flownav.export.samples.tlog import write_tlog
from flownav.export.samples.ulog import write_ulog

RIG_HEIGHTS_M, RIG_RUNS = (0.6, 1.0), 2


class Sample(NamedTuple):
    """A kind of sample log. write: seed and the path of the file, or of a folder that is there.

    commands: what to try, {path} in place of the file. uses: the extra that the kind needs; "" for none.
    """

    kind: str
    name: str
    what: str
    write: Callable[[int, Path], None]
    commands: tuple[str, ...]
    folder: bool = False
    uses: str = ""


def _rig(seed: int, folder: Path) -> None:
    """Two runs at each of two heights, as `flownav rig` makes them."""
    from flownav.core.compile import announce_compilation
    from flownav.lab.rig.experiment import RigSettings, run_campaign
    from flownav.lab.rig.log_folder import run_folders, write_rig_folder

    heights = " ".join(f"--height {height:g}" for height in RIG_HEIGHTS_M)
    command = f"flownav rig {heights} --runs {RIG_RUNS} --seed {seed}"
    settings = RigSettings(height_m=RIG_HEIGHTS_M[0], runs=RIG_RUNS, seed=seed)
    places = run_folders(folder, len(RIG_HEIGHTS_M) * RIG_RUNS)
    with announce_compilation("rig"):
        for log, place in zip(run_campaign(settings, RIG_HEIGHTS_M), places, strict=True):
            write_rig_folder(log, place, command, dated=False)


SAMPLES = (
    Sample(
        "csv", "flight-csv", "a quadrotor's flight, one CSV file a sensor",
        lambda seed, at: write_csv_folder(sample_log(seed), at),
        ("flownav info {path}", "flownav replay {path} --gps-outage 30:75", "flownav identify {path}"), folder=True,
    ),
    Sample(
        "ulog", "flight.ulg", "the same flight as a PX4 log", lambda seed, at: write_ulog(sample_log(seed), at),
        ("flownav info {path}", "flownav replay {path}", "flownav identify {path} --for px4"),
    ),
    Sample(
        "tlog", "flight.tlog", "the same flight as a ground station's MAVLink log",
        lambda seed, at: write_tlog(sample_log(seed), at),
        ("flownav info {path}", "flownav replay {path}"), uses="live",
    ),
    Sample(
        "dataflash", "flight.bin", "the same flight as an ArduPilot log",
        lambda seed, at: write_dataflash(sample_log(seed), at),
        ("flownav info {path}", "flownav replay {path}", "flownav identify {path} --for ardupilot"),
    ),
    Sample(
        "rig", "rig", "a flow sensor that swings over a pad at 0.6 and 1 m", _rig,
        ("flownav identify {path}",), folder=True,
    ),
    Sample(
        "record", "pad_return.fnr", "a take-off from a pad and a landing on it, flownav's own record",
        lambda seed, at: sample_record(seed).save(at, replacing=True),
        ("flownav report {path}", "flownav replay {path}", "flownav export {path} --to mcap"),
    ),
)  # fmt: skip
KINDS = tuple(sample.kind for sample in SAMPLES)


def sample_of(kind: str) -> Sample:
    """The sample of a kind. InputError where there is none."""
    for sample in SAMPLES:
        if sample.kind == kind:
            return sample
    raise InputError(f"{kind}: no such sample; choose from {', '.join(KINDS)}")
