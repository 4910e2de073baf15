"""Settings and test vectors as constants of C."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

from flownav.core.measurement import Array
from flownav.export.onboard.board import Board
from flownav.export.onboard.interface import comment
from flownav.navigation import progress
from flownav.navigation.packed import PARTS, START_SIGMA
from flownav.navigation.rings import Given

VECTORS, VECTORS_A_DIGEST = 400, 50


def number(value: float) -> str:
    """A double of C that is this one to the last bit."""
    if math.isnan(value):
        return "NAN"
    if math.isinf(value):
        return "INFINITY" if value > 0.0 else "-INFINITY"
    return repr(float(value))


def settings_file(settings: Array) -> str:
    """`flownav_settings.c`: packed settings and the pace, by name."""
    lines, at = [], 0
    for part, record in PARTS.items():
        written, at = _braced(record, settings, at)
        lines.append(f"  .{part} = {written},")
    sigma = ", ".join(map(number, settings[START_SIGMA : progress.PACE]))
    lines.append(f"  .start_sigma = {{{sigma}}},")
    for i, name in enumerate(progress.Pace._fields):
        lines.append(f"  .{name} = {number(settings[progress.PACE + i])},")
    body = "\n".join(lines)
    head = '#include "flownav.h"\n\n#include <math.h>\n\n'
    return f"{head}const flownav_settings flownav_default_settings = {{\n{body}\n}};\n"


def _braced(record: Any, settings: Array, at: int) -> tuple[str, int]:
    """One record's numbers, by name, and where the next begins."""
    from typing import get_type_hints

    parts = []
    for name, kind in get_type_hints(record).items():
        if hasattr(kind, "_fields"):
            inner, at = _braced(kind, settings, at)
            parts.append(f".{name} = {inner}")
        else:
            parts.append(f".{name} = {number(settings[at])}")
            at += 1
    return "{" + ", ".join(parts) + "}", at


def digests_of(given: Sequence[Given], board: Board, every: int = VECTORS_A_DIGEST) -> Iterator[int]:
    """The digest after every `every` readings."""
    for count, reading in enumerate(given, 1):
        board.take(reading)
        if count % every == 0:
            yield board.digest()


def vectors_file(given: Sequence[Given], digests: Sequence[int], flight: str) -> str:
    """`flownav_vectors.h`: readings, and digests."""
    rows = "\n".join(
        f"  {{{number(g.t_s)}, {g.sensor}, "
        f"{{{{{_list(g.numbers[:6])}}}, {{{_list(g.numbers[6:9])}}}, {_list(g.numbers[9:])}}}}},"
        for g in given
    )
    every = ",\n".join(f"  0x{digest:016x}u" for digest in digests)
    which = f"The first {len(given)} readings of a flight ({flight})"
    what = f"{which}, and the digest after every {VECTORS_A_DIGEST} of them."
    return f"""{comment(what)}
#ifndef FLOWNAV_VECTORS_H
#define FLOWNAV_VECTORS_H

#include "flownav.h"

#include <math.h>

#define FLOWNAV_VECTORS {len(given)}
#define FLOWNAV_VECTORS_A_DIGEST {VECTORS_A_DIGEST}

typedef struct flownav_vector {{
  double t_s;
  double sensor;
  flownav_reading reading;
}} flownav_vector;

static const flownav_vector flownav_vectors[FLOWNAV_VECTORS] = {{
{rows}
}};

static const uint64_t flownav_vector_digests[FLOWNAV_VECTORS / FLOWNAV_VECTORS_A_DIGEST] = {{
{every}
}};
#endif
"""


def _list(numbers: Array) -> str:
    return ", ".join(map(number, numbers))
