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

sys.path.append(str(Path(__file__).resolve().parents[1] / "tests" / "helpers"))

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
    "sample csv ulog dataflash --out samples",
    "info samples/flight.ulg",
    "info samples/flight.bin",
    "replay samples/flight.ulg --gps-outage 30:40 --no-report --out ulog.fnr",
    "explain samples/flight-csv",
    "campaign landing --flights 2 --out campaign",
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
    film_and_black_boxes()
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


def film_and_black_boxes() -> None:
    """The kernels of `flow`, which wants pictures, and of what reads logs of INAV and Betaflight."""
    import numpy as np

    from blackbox_logs import blackbox_log, quantised
    from flownav.lab.optics.firmware import FIRST
    from flownav.lab.optics.flow import raw_flow
    from flownav.logs.open_log import open_log
    from replay_logs import log_of_flight

    raw_flow(np.random.default_rng(1).integers(0, 255, (3, 64, 64)).astype(np.uint8), FIRST)
    flown = log_of_flight(4.0, imu_hz=100.0)
    for inav in (True, False):
        place = Path(f"LOG{inav:05d}.TXT")
        place.write_bytes(blackbox_log(quantised(flown.tables, inav), inav).content())
        open_log(place)


def units_of_the_navigator() -> None:
    """Also those that only a sensor with dynamics of its own flies on: every unit is compiled for the other level."""
    from flownav.core.compile import LANES, ONE_LANE
    from flownav.navigation.take import navigator_unit

    for lanes in (ONE_LANE, LANES):
        for lag in (False, True):
            assert navigator_unit(lanes, lag).address


if __name__ == "__main__":
    main(Path(sys.argv[1]))
