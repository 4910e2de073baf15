"""A Cortex-M7 that is not there: the library of `flownav build --target cortex-m7`, run in unicorn on a record.

python tools/emulated_board.py FOLDER RECORD [--swapped N] prints what a board would write down: after each 500 readings
and the last a line, how many readings there were and the digest. --swapped N: the N-th flow reading has its axes
swapped on the way to the board, as a wrong driver would hand it over.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from flownav.api.building import flight_of
from flownav.core.errors import FlownavError, InputError
from flownav.core.measurement import Sensor
from flownav.export.onboard.interface import Rates
from flownav.export.onboard.library_boards import EmulatedBoard
from flownav.export.onboard.manifest import manifest_of
from flownav.export.onboard.package import pace_of, packed_settings, readings_of
from flownav.export.onboard.targets import LIBRARY
from flownav.navigation.rings import Given

EVERY = 500
TARGET = "cortex-m7"


def board_of(folder: Path, record: Path) -> tuple[EmulatedBoard, list[Given]]:
    """The library that lies in a folder on an emulated core, and the readings of a record. InputError as `verify`."""
    manifest, flight = manifest_of(folder), flight_of(record)
    if manifest["target"] != TARGET:
        raise InputError(f"{folder}: built for {manifest['target']}; here runs `flownav build --target {TARGET}`")
    rates, packed = Rates(**manifest["rates"]), (folder / LIBRARY).read_bytes()
    settings, _ = packed_settings(flight, pace_of(flight.settings, rates.horizon_s, tuple(manifest["without"])))
    return EmulatedBoard(settings, rates.sizes, packed[packed.index(b"\x7fELF") :]), readings_of(flight)


def swapped(readings: Sequence[Given], place: int | None) -> Iterator[Given]:
    """The readings, of which one flow reading, counted from 1, has forward and right in each other's place."""
    flows = 0
    for given in readings:
        flows += given.sensor == Sensor.FLOW_RATE
        if given.sensor == Sensor.FLOW_RATE and flows == place:
            given.numbers[[0, 1]] = given.numbers[[1, 0]]
        yield given


def main(folder: Path, record: Path, place: int | None) -> None:
    """Fly the record on the board and print its lines."""
    board, readings = board_of(folder, record)
    for count, given in enumerate(swapped(readings, place), 1):
        board.take(given)
        if count == len(readings):
            board.finish()
        if count % EVERY == 0 or count == len(readings):
            print(f"{count} {board.digest():016x}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("record", type=Path)
    parser.add_argument("--swapped", type=int)
    told = parser.parse_args()
    try:
        main(told.folder, told.record, told.swapped)
    except (FlownavError, OSError) as error:
        sys.exit(f"flownav: {error}")
