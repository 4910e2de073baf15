"""Runs the commands whose kernels go into a wheel, as short as they can be, in the folder given.

    python tools/commands_for_wheel.py FOLDER

`FLOWNAV_CACHE` and `FLOWNAV_LEVEL` name the folder of the kernels and their processor.
"""

from __future__ import annotations

import contextlib
import io
import os
import sys
from pathlib import Path

from flownav.cli import app
from flownav.core.errors import VerdictError

COMMANDS = (
    "fly --no-report --out sortie.fnr",
    "info sortie.fnr",
    "fly landing --seed 3 --out landing.fnr",
    "fly landing --flights 2 --no-report --out many.fnr",
    "fly landing --filter paper --flights 2 --no-report --out paper.fnr",
    "fly landing --filter paper --truth linear --flights 2 --no-report --out linear.fnr",
    "accuracy --cases approach --flights 2 --ablations 1",
    "replay landing.fnr --out again.fnr",
    "faults --faults flow_loss --heights 1.5 --durations 2",
    "rig --out rig --duration 6",
    "rig --out chirp --duration 6 --excitation chirp --pad texture",
    "identify rig chirp --out sensor.toml",
    "pad --heights 1,2 --frames 2",
    "vehicle",
)


def main(folder: Path) -> None:
    """Run every command; a bad verdict of so short a flight or swing is none of ours."""
    folder.mkdir(parents=True, exist_ok=True)
    os.chdir(folder)
    for line in COMMANDS:
        print(f"  flownav {line}", flush=True)
        with contextlib.suppress(VerdictError), contextlib.redirect_stdout(io.StringIO()):
            app([*line.split(), "--json"], standalone_mode=False)
    smooth_and_warm()
    units_of_the_navigator()


def smooth_and_warm() -> None:
    """The kernels of `replay --smooth`, of `info` and of `live`, which want a log or a link."""
    from flownav.campaigns.faults.table import log_of
    from flownav.core.record import Record
    from flownav.live.loop import warm_up
    from flownav.navigation.settings import NavigatorSettingsFile
    from flownav.replays.prepare import ReplayOptions
    from flownav.replays.session import replay
    from flownav.simulation.assemble import assemble
    from flownav.simulation.scenario import load_scenario

    log = log_of(Record.load(Path("landing.fnr")), assemble(load_scenario("landing")))
    replay(log, ReplayOptions(), NavigatorSettingsFile(), smoothed=True)
    warm_up()


def units_of_the_navigator() -> None:
    """Also those that only a sensor with dynamics of its own flies on: every unit is compiled for the other level."""
    from flownav.core.compile import LANES, ONE_LANE
    from flownav.navigation.take import navigator_unit

    for lanes in (ONE_LANE, LANES):
        for lag in (False, True):
            assert navigator_unit(lanes, lag).address


if __name__ == "__main__":
    main(Path(sys.argv[1]))
