"""Protection levels on trial: flights with a failing sensor, as a table in a page. `make integrity`.

python tools/integrity.py PAGE
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

from flownav.campaigns.faults.integrity import (
    CLEAN_SEEDS,
    FAULTY_SEEDS,
    FIRST_SEED,
    LONG_S,
    LONG_SEEDS,
    Judged,
    cost,
    fly,
    placed,
    rows_of,
    section,
)
from flownav.campaigns.faults.navigator import navigator_told
from flownav.campaigns.faults.table import BASE, flight_at
from flownav.core.errors import FlownavError
from flownav.core.files import written_whole
from flownav.simulation.assemble import assemble
from flownav.simulation.scenario import load_scenario

TOLD_EVERY = 1000  # flights


def main(page: Path) -> None:
    """Fly, print and write. FlownavError where the page has no place for the table."""
    text = page.read_text(encoding="utf-8")
    placed(text, "", str(page))
    fitted = assemble(load_scenario(BASE)).fitted
    assert fitted is not None
    faulty, clean = (range(FIRST_SEED, FIRST_SEED + count) for count in (FAULTY_SEEDS, CLEAN_SEEDS))
    lasting = range(FIRST_SEED, FIRST_SEED + LONG_SEEDS)
    navigate = navigator_told(fitted.told)
    rows = rows_of(counted(fly(navigate, faulty, clean)))
    long = rows_of(counted(fly(navigate, lasting, (), durations_s=(LONG_S,))))
    spent = cost(fitted.told, flight_at(1.5, 5.0, FIRST_SEED).streams)
    found = section(rows, long, (clean[0], clean[-1]), spent)
    with written_whole(page) as temporary:
        temporary.write_text(placed(text, found, str(page)), encoding="utf-8", newline="\n")
    print(found)


def counted(flights: Iterator[Judged]) -> Iterator[Judged]:
    """The same flights; how many there were is said on the way."""
    for count, flight in enumerate(flights, 1):
        if count % TOLD_EVERY == 0:
            print(f"integrity: {count} flights", file=sys.stderr)
        yield flight


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python tools/integrity.py PAGE")
    try:
        main(Path(sys.argv[1]))
    except (FlownavError, OSError) as error:
        sys.exit(f"flownav: {error}")
