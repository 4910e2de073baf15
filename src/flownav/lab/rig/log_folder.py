"""The folder that a rig writes: rig.csv, one row a logged moment, and rig.toml, what was set up.

Several runs or heights stand side by side as FOLDER/run-001, run-002, ...
"""

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from flownav.core.errors import InputError
from flownav.core.guard import an_output, an_output_folder, written_whole
from flownav.core.provenance import provenance
from flownav.core.text import plain
from flownav.lab.rig.experiment import RigLog
from flownav.lab.rig.instruments import COUNTS_PER_REVOLUTION

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

    dated: whether rig.toml says when it was written.
    """
    table = np.column_stack([log.time_s if name == "t_s" else getattr(log, name) for name in COLUMNS])
    line = ",".join(COLUMNS.values())
    text = "\n".join([",".join(COLUMNS), *(line % tuple(row) for row in table.tolist())]) + "\n"
    check_rig_folder(folder)
    try:
        with ExitStack() as both:
            for name, content in (("rig.csv", text), ("rig.toml", _set_up(log, command, dated=dated))):
                temporary = both.enter_context(written_whole(folder / name, replacing=True))
                temporary.write_text(content, encoding="utf-8", errors="backslashreplace")
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror}); give another name") from error


def run_folders(folder: Path, count: int) -> Iterator[Path]:
    """Where the logs of `count` runs go: the folder itself for one, run-001 ... in it for more."""
    if count == 1:
        yield folder
        return
    for number in range(1, count + 1):
        yield folder / f"run-{number:03d}"


def _set_up(log: RigLog, command: str, *, dated: bool) -> str:
    s, made = log.settings, provenance()
    entries: dict[str, Any] = {
        "schema_version": SCHEMA_VERSION,
        "pivot_height_m": log.rod_length_m + s.height_m,
        "rod_length_m": log.rod_length_m,
        "height_m": s.height_m,
        "encoder_counts_per_revolution": COUNTS_PER_REVOLUTION,
        "pad": s.pad,
        "firmware": s.firmware,
        "excitation": s.excitation,
        "seed": s.seed,
        "chain_delay_s": s.chain_delay_s,
    }
    origin = {
        "source": "flownav rig, simulated from pixels",
        "command": command,
        "run": log.run,
        "light": s.light,
        "axis_along_swing": s.along,
        "start_angle_rad": s.start_angle_rad,
        "duration_s": s.duration_s,
        "refocus": s.refocus,
        "gyro_late_s": s.gyro_late_s,
        "sonar_late_s": s.sonar_late_s,
        "flownav": made["flownav"],
    } | ({"written_utc": made["written_utc"]} if dated else {})
    lines = [f"{key} = {_toml(value)}" for key, value in entries.items()]
    return "\n".join([*lines, "", "[provenance]", *(f"{key} = {_toml(value)}" for key, value in origin.items())]) + "\n"


def _toml(value: object) -> str:
    if isinstance(value, str):
        return '"' + plain(value).replace("\\", "\\\\").replace('"', '\\"') + '"'
    return repr(round(value, 9)) if isinstance(value, float) else str(value)


def check_rig_folder(folder: Path) -> None:
    """InputError where a folder may not be written: it is a link, or holds a log that flownav did not write."""
    an_output_folder(folder)
    log, set_up = folder / "rig.csv", folder / "rig.toml"
    an_output(set_up)
    an_output(log, signed_by=set_up)
