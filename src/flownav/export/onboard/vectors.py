"""Settings and test vectors read back from the constants of C that `constants` wrote."""

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flownav.core.errors import InputError
from flownav.core.guard import an_input
from flownav.core.measurement import Array, Sensor
from flownav.navigation import progress
from flownav.navigation.rings import Given
from flownav.navigation.waiting_records import READING

NUMBER = re.compile(r"-?(?:NAN|INFINITY|\d[\d.]*(?:e[+-]?\d+)?)")
NAME = re.compile(r"\.[A-Za-z_]\w*\s*=")
SETTINGS, VECTORS = "flownav_settings.c", "flownav_vectors.h"
MOST_BYTES = 4 << 20  # of a file of constants, which has some 0.1 MB


class Vectors(NamedTuple):
    """A folder's own flight: packed settings with the pace behind them, and the first readings."""

    settings: Array
    readings: list[Given]


def vectors_of(folder: Path) -> Vectors:
    """The settings and test vectors that lie in a folder of `flownav build`. InputError where they do not."""
    text = NAME.sub("", _braced(folder / SETTINGS, "flownav_default_settings = {"))
    settings = _numbers(text, folder / SETTINGS)
    rows = _numbers(_braced(folder / VECTORS, "flownav_vectors[FLOWNAV_VECTORS] = {"), folder / VECTORS)
    if len(settings) != (expected := progress.PACE + len(progress.Pace._fields)):
        raise InputError(f"{folder / SETTINGS}: {len(settings)} numbers; the navigator has {expected}")
    if not len(rows) or len(rows) % (2 + READING):
        raise InputError(f"{folder / VECTORS}: {len(rows)} numbers are not a list of readings of {2 + READING} each")
    rows = rows.reshape(-1, 2 + READING)
    if not np.isin(rows[:, 1], [float(sensor) for sensor in Sensor]).all():
        raise InputError(f"{folder / VECTORS}: a reading is of no sensor")
    return Vectors(settings, [Given(float(row[0]), int(row[1]), row[2:]) for row in rows])


def _braced(file: Path, head: str) -> str:
    """The text between a constant's braces."""
    try:
        with an_input(file).open("rb") as content:
            text = content.read(MOST_BYTES).decode("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{file}: {error}") from error
    if head not in text:
        raise InputError(f"{file}: it holds no `{head.split()[0].split('[')[0]}`")
    return text.partition(head)[2].partition("\n};")[0]


def _numbers(text: str, where: Path) -> Array:
    """Every number of a text, in turn. InputError, with the file, where one cannot be."""
    try:
        return np.array([float(word.replace("INFINITY", "inf")) for word in NUMBER.findall(text)])
    except ValueError as error:
        raise InputError(f"{where}: {error}") from error
