"""Settings and test vectors read back from the constants of C that `constants` wrote."""

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flownav.core.errors import InputError
from flownav.core.measurement import Array
from flownav.navigation.rings import Given
from flownav.navigation.waiting_records import READING

NUMBER = re.compile(r"-?(?:NAN|INFINITY|\d[\d.]*(?:e[+-]?\d+)?)")
NAME = re.compile(r"\.[A-Za-z_]\w*\s*=")
SETTINGS, VECTORS = "flownav_settings.c", "flownav_vectors.h"


class Vectors(NamedTuple):
    """A folder's own flight: packed settings with the pace behind them, and the first readings."""

    settings: Array
    readings: list[Given]


def vectors_of(folder: Path) -> Vectors:
    """The settings and test vectors that lie in a folder of `flownav build`. InputError where they do not."""
    settings = _numbers(NAME.sub("", _braced(folder / SETTINGS, "flownav_default_settings = {")))
    rows = _numbers(_braced(folder / VECTORS, "flownav_vectors[FLOWNAV_VECTORS] = {"))
    if not len(rows) or len(rows) % (2 + READING):
        raise InputError(f"{folder / VECTORS}: {len(rows)} numbers are not a list of readings of {2 + READING} each")
    return Vectors(settings, [Given(float(row[0]), int(row[1]), row[2:]) for row in rows.reshape(-1, 2 + READING)])


def _braced(file: Path, head: str) -> str:
    """The text between a constant's braces."""
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{file}: {error}") from error
    if head not in text:
        raise InputError(f"{file}: it holds no `{head.split()[0].split('[')[0]}`")
    return text.partition(head)[2].partition("\n};")[0]


def _numbers(text: str) -> Array:
    """Every number of a text, in turn."""
    return np.array([float(word.replace("INFINITY", "inf")) for word in NUMBER.findall(text)])
