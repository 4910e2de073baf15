"""The recorded flight that the replay is timed on, where it is at hand."""

from __future__ import annotations

import os
from pathlib import Path

FLIGHT = "quad-px4flow-outdoor"


def recorded_flight() -> Path | None:
    """The 849 s flight in the folder that FLOWNAV_DATA names, or in ../shared/data; None where neither has it."""
    roots = [os.environ.get("FLOWNAV_DATA"), Path.cwd().parent / "shared" / "data"]
    folders = [Path(root) / FLIGHT for root in roots if root]
    return next((folder for folder in folders if folder.is_dir()), None)


def replay_once(folder: Path) -> object:
    """Read the log, replay it, and bundle the record."""
    from flownav.logs.csv_folder import read_csv_folder
    from flownav.navigation.settings import NavigatorSettingsFile
    from flownav.replay.bundle import to_record
    from flownav.replay.prepare import ReplayOptions
    from flownav.replay.session import replay

    flown = replay(read_csv_folder(folder), ReplayOptions(), NavigatorSettingsFile())
    return to_record(flown, flown.scores(), ["flownav", "bench"])
