"""The league: every log in a folder compared, as a page of Markdown that bears a version and no date."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from flownav.core.errors import InputError
from flownav.core.files import natural_order
from flownav.core.version import __version__
from flownav.logs.csv_folder import FILES
from flownav.logs.open_log import log_kind, open_flight
from flownav.replays.prepare import ReplayOptions
from flownav.studies.compare.job import Setting, compare_log, windows_of
from flownav.studies.compare.rows import Row, markdown, names_of

HEAD = """# The league

What flownav makes of every log at hand as it is shipped, with no setting fitted to any, beside dead reckoning on the
same flow and the autopilot's own estimate. [compare](../how-to/compare.md) says what the columns mean. Printed by
`make league` with flownav {version}; a change to the navigator prints it anew, and what got worse shows.

"""

LeftOut = tuple[str, str]  # a log's name, and why it is not in the table


def logs_in(folder: Path) -> list[Path]:
    """Every folder of CSV files and every log file below, in order of their names (2 before 10).

    InputError where the folder is missing or holds none.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; set FLOWNAV_DATA to the folder of logs")
    found = [path for path in sorted(folder.rglob("*"), key=natural_order) if _is_folder_of_csv(path) or log_kind(path)]
    if not found:
        raise InputError(f"{folder}: holds no log; set FLOWNAV_DATA to the folder of logs")
    return found


def _is_folder_of_csv(path: Path) -> bool:
    return any((path / f"{name}.csv").is_file() for name in FILES if name not in ("truth", "heading_truth"))


def play(paths: Sequence[Path], on_log: Callable[[str], None]) -> tuple[list[Row], list[LeftOut]]:
    """The rows of all logs that can be replayed, by the shipped settings, and which cannot.

    on_log: called with each log's name before it is read.
    """
    rows: list[Row] = []
    left_out: list[LeftOut] = []
    for name, path in zip(names_of(paths), paths, strict=True):
        on_log(name)
        try:
            log = open_flight(path)
            setting = Setting("default", ReplayOptions(), None)
            rows += compare_log(name, log, [setting], windows_of(log, (), ""), lambda done: None)
        except InputError as error:
            left_out.append((name, str(error).removeprefix(f"{path}: ")))
    return rows, left_out


def page(rows: Sequence[Row], left_out: Sequence[LeftOut]) -> str:
    """The league as Markdown."""
    said = HEAD.format(version=__version__) + markdown(rows)
    if left_out:
        said += "\nNot in the table:\n\n" + "".join(f"- `{name}`: {why}\n" for name, why in left_out)
    return said
