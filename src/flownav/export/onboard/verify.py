"""`flownav verify`: the output of a board or a browser for a flight, compared with the same flight computed here."""

import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

from flownav.core.errors import InputError
from flownav.core.guard import an_input
from flownav.core.measurement import Sensor
from flownav.export.onboard.board import Board
from flownav.export.onboard.interface import Rates
from flownav.export.onboard.package import Flight, pace_of, packed_settings, readings_of
from flownav.export.onboard.vectors import vectors_of
from flownav.navigation.rings import Given

DIGEST = re.compile(r"[0-9a-fA-F]{16}")
LINE = re.compile(r"\s*(\d{1,12})\s+(?:0x)?([0-9a-fA-F]{16})\b", re.ASCII)
MOST_LINES, MOST_BYTES = 1_000_000, 32 << 20


class LoggedDigest(NamedTuple):
    """A digest that a board reported, and after how many readings (None: after all)."""

    readings: int | None
    digest: int


class Found(NamedTuple):
    """Result of a comparison: how many digests were compared, how many are the same, and where the first difference is.

    same: after how many readings the last digest before it was still right; differs: after how many it is wrong, and
    the reading then.
    """

    compared: int
    equal: int
    digest: str
    same: int | None = None
    differs: int | None = None
    t_s: float | None = None
    sensor: str | None = None
    expected: str | None = None
    said: str | None = None


def logged_digests(what: str) -> list[LoggedDigest]:
    """Digests of a text that is one, or of a file with a line for each (readings, digest). InputError where it is
    neither.
    """
    if DIGEST.fullmatch(what):
        return [LoggedDigest(None, int(what, 16))]
    path = Path(what)
    if not path.is_file():
        raise InputError(
            f"{what}: neither 16 hexadecimal digits, nor a file of digests, nor a folder of `flownav build`"
        )
    if path.stat().st_size > MOST_BYTES:
        raise InputError(f"{what}: larger than {MOST_BYTES >> 20} MB; cut it to the lines with digests")
    text = an_input(path).read_text(encoding="utf-8", errors="replace")
    found = [LoggedDigest(int(m[1]), int(m[2], 16)) for m in map(LINE.match, text.splitlines()[:MOST_LINES]) if m]
    if not found:
        raise InputError(f"{what}: no line of it is a number of readings and 16 hexadecimal digits")
    if any(b.readings <= a.readings for a, b in pairwise(found)):  # type: ignore[operator]
        raise InputError(f"{what}: the numbers of readings do not grow; it holds more than one run")
    return found


def compare(logged: Sequence[LoggedDigest], given: Sequence[Given], board: Board) -> Found:
    """Feed the readings here, and compare each digest with the reported one. InputError where the report has more
    readings.
    """
    last = max((each.readings for each in logged if each.readings is not None), default=0)
    if last > len(given):
        raise InputError(
            f"a digest is reported after {last} readings, and the flight has {len(given)}: it is another flight"
        )
    after = {each.readings if each.readings is not None else len(given): each.digest for each in logged}
    equal, same = 0, 0
    for count, reading in enumerate(given, 1):
        board.take(reading)
        if count not in after:
            continue
        if count == len(given) and logged[-1].readings is None:
            board.finish()
        if board.digest() != after[count]:
            where = reading.t_s, Sensor(reading.sensor).name.lower()
            return Found(len(logged), equal, _hex(board), same, count, *where, _hex(board), f"{after[count]:016x}")
        equal, same = equal + 1, count
    return Found(len(logged), equal, _hex(board))


def _hex(board: Board) -> str:
    return f"{board.digest():016x}"


def board_for(flight: Flight, rates: Rates, without: tuple[str, ...] = ()) -> Board:
    """A board here, for a flight's settings."""
    settings, lag = packed_settings(flight, pace_of(flight.settings, rates.horizon_s, without))
    return Board(settings, rates.sizes, lag=lag)


def verified(logged: Sequence[LoggedDigest], flight: Flight, rates: Rates) -> Found:
    """Result of comparing the digests reported of a whole flight with this machine's."""
    return compare(logged, readings_of(flight), board_for(flight, rates))


# -- a folder -------------------------------------------------------------------------------------------------
def passed_to(folder: Path, manifest: dict[str, Any], flight: Flight | None) -> tuple[list[Given], Board]:
    """Readings, and the board here that takes them: those of a flight, or the folder's own vectors and settings."""
    rates, without = Rates(**manifest["rates"]), tuple(manifest["without"])
    if flight is not None:
        return readings_of(flight), board_for(flight, rates, without)
    settings, readings = vectors_of(folder)
    return readings, Board(settings, rates.sizes, lag=manifest["lag"])
