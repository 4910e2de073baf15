"""The recorded flight that the replay is timed on, where it is at hand."""

from __future__ import annotations

import os
from collections.abc import Callable
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
    from flownav.replays.bundle import to_record
    from flownav.replays.prepare import ReplayOptions
    from flownav.replays.session import replay

    flown = replay(read_csv_folder(folder), ReplayOptions(), NavigatorSettingsFile())
    return to_record(flown, flown.scores(), ["flownav", "bench"])


def navigator_run(folder: Path) -> Callable[[], object]:
    """The navigator on the log's prepared readings, from its start to its end: what the engine does of a replay."""
    from flownav.logs.csv_folder import read_csv_folder
    from flownav.navigation.feed import equipment_of
    from flownav.navigation.loop import run, start_navigator
    from flownav.navigation.settings import NavigatorSettingsFile
    from flownav.navigation.tape import new_tape
    from flownav.replays.prepare import ReplayOptions, prepare

    settings, prepared = NavigatorSettingsFile(), prepare(read_csv_folder(folder), ReplayOptions())
    queue = prepared.queue
    equipment = equipment_of(prepared.streams, float(queue.t_s[0]), prepared.flow_gyro_is_imu, settings)
    tape = new_tape(queue)

    def once() -> object:
        tape.used[:] = 0
        running = start_navigator(equipment, settings, tape)
        run(queue, running)
        return running

    return once
