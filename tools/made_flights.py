"""Made indoor flights: judged beside dead reckoning, held beside real ones, or written. `make made-flights` does both.

python tools/made_flights.py judge [--page PAGE] [--json FILE] [--signs] [--classes a-clean b-slip …] [--seeds 20]
python tools/made_flights.py compare DATA [--page PAGE] [--classes …] [--seeds 20]
python tools/made_flights.py write FOLDER [--classes …] [--seeds 20]
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from flownav.core.errors import FlownavError, InputError
from flownav.core.files import written_whole
from flownav.core.version import __version__
from made.classes import NAMES, make
from made.flight import write
from made.judging import Verdict, judge
from made.likeness import compared
from made.table import markdown, rows_of

JUDGED, COMPARED = "make made-flights: judged", "make made-flights: compared"  # where a page has the tables


def judged(flight: tuple[str, int]) -> Verdict:
    """One flight, made and judged."""
    return judge(make(*flight))


def verdicts(names: Sequence[str], seeds: range, jobs: int) -> Iterator[Verdict]:
    """Every class at every seed, some at a time, in order."""
    flights = [(name, number) for name in names for number in seeds]
    if jobs == 1:
        yield from map(judged, flights)
        return
    with ProcessPoolExecutor(jobs) as pool:
        yield from pool.map(judged, flights, chunksize=4)


def signs(flights: Sequence[Verdict]) -> str:
    """Flights that end further off than dead reckoning by half and by 0.1 m, or turned: what went wrong first."""
    lines = []
    for v in flights:
        worse = not v.ours.end_m <= 1.5 * v.line.end_m + 0.1 or not v.ours.heading_deg <= v.line.heading_deg + 3.0
        if worse:
            drift = f"{v.ours.end_m:.2f} m against {v.line.end_m:.2f}"
            turn = f"{v.ours.heading_deg:.1f}° against {v.line.heading_deg:.1f}"
            lines.append(f"{v.name} {v.number}: {drift}, {turn}: {v.why or '; '.join(v.signs) or 'no sign'}\n")
    return "".join(lines)


def section(flights: Sequence[Verdict], seeds: range, spent_s: float) -> str:
    """The section for the page."""
    return (
        f"Printed by `make made-flights` with flownav {__version__}: {len(flights)} flights, seeds {seeds[0]} to "
        f"{seeds[-1]} of each class, in {spent_s / 60.0:.0f} minutes.\n\n{markdown(rows_of(flights))}"
    )


def marks(what: str) -> tuple[str, str]:
    """The lines of a page between which a table goes."""
    return f"<!-- {what}: begin -->", f"<!-- {what}: end -->"


def placed(page: str, text: str, what: str, name: str) -> str:
    """A page with a text between two of its marks. InputError where it lacks them."""
    first, last = marks(what)
    before, begin, rest = page.partition(first)
    _, end, after = rest.partition(last)
    if not (begin and end):
        raise InputError(f"{name}: lacks the lines {first} and {last}; put them where the table belongs")
    return f"{before}{first}\n\n{text}\n{last}{after}"


def put(page: Path | None, text: str, what: str) -> None:
    """Print a text, and put it into the page where there is one."""
    print(text)
    if page:
        whole = placed(page.read_text(encoding="utf-8"), text, what, str(page))
        with written_whole(page) as temporary:
            temporary.write_text(whole, encoding="utf-8", newline="\n")


def judge_all(asked: argparse.Namespace, seeds: range) -> None:
    """Fly, print, and write what is asked for."""
    begun_s, flights = time.perf_counter(), []
    for verdict in verdicts(asked.classes, seeds, asked.jobs):
        flights.append(verdict)
        if verdict.number == seeds[-1]:
            print(f"made: {verdict.name}, {len(flights)} flights", file=sys.stderr, flush=True)
    put(asked.page, section(flights, seeds, time.perf_counter() - begun_s), JUDGED)
    if asked.signs:
        print(signs(flights))
    if asked.json:
        with written_whole(asked.json) as temporary:
            told = [{**v._asdict(), "ours": v.ours._asdict(), "line": v.line._asdict()} for v in flights]
            temporary.write_text(json.dumps(told, indent=1), encoding="utf-8")


def options() -> argparse.ArgumentParser:
    """The parser of the command line."""
    parser = argparse.ArgumentParser(prog="made_flights.py", description="Made indoor flights: judged, or written.")
    parser.add_argument("what", choices=("judge", "compare", "write"))
    parser.add_argument("folder", type=Path, nargs="?", help="of real logs (compare), or where flights go (write)")
    parser.add_argument("--classes", nargs="+", default=list(NAMES), metavar="NAME")
    parser.add_argument("--seeds", type=int, default=20, help="how many of each class")
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--jobs", type=int, default=2, help="flights at a time")
    parser.add_argument("--page", type=Path, help="a page with the marks that the table goes between")
    parser.add_argument("--json", type=Path, help="every flight's figures")
    parser.add_argument("--signs", action="store_true", help="what went wrong first in the flights that are worse")
    return parser


def main(arguments: Sequence[str]) -> None:
    """Do what is asked. InputError where a class is not known, a folder is missing, or the page has no marks."""
    asked = options().parse_args(arguments)
    unknown = [name for name in asked.classes if name not in NAMES]
    if unknown:
        raise InputError(f"--classes {unknown[0]}: no such class of made flights; there are {', '.join(NAMES)}")
    if asked.seeds < 1:
        raise InputError(f"--seeds {asked.seeds}: a class has one flight at least; give 1 or more")
    seeds = range(asked.first, asked.first + asked.seeds)
    if asked.page:
        what = JUDGED if asked.what == "judge" else COMPARED
        placed(asked.page.read_text(encoding="utf-8"), "", what, str(asked.page))
    if asked.what == "judge":
        judge_all(asked, seeds)
    elif asked.folder is None:
        raise InputError(f"{asked.what}: give the folder {'of logs' if asked.what == 'compare' else 'to write into'}")
    elif asked.what == "compare":
        put(asked.page, compared(asked.folder, asked.classes, seeds), COMPARED)
    else:
        for name in asked.classes:
            for number in seeds:
                write(make(name, number), asked.folder / f"{name}-{number:02d}")


if __name__ == "__main__":
    try:
        main(sys.argv[1:])
    except (FlownavError, OSError) as error:
        print(f"flownav: {error}", file=sys.stderr)
        sys.exit(2 if isinstance(error, InputError) else 1)
