"""The table of real autopilots that fly on flownav's estimate, printed into its page: `flownav sitl` of each case,
or of each fault.

Flies what the folder does not hold, in real time, some three minutes each; the simulators are found as `flownav sitl`
finds them. `--as-flown` prints what is there.

python tools/autopilots.py PAGE FOLDER [--flights N] [--beside N] [--vehicles V ...] [--faults] [--as-flown]
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path

from flownav.cli.sitl import COLUMNS
from flownav.core.files import written_whole
from flownav.live.sitl.campaign import row_of

TITLES = {False: "## Flown again", True: "## Faults, flown again"}
VEHICLES = {"heli": "ardupilot", "copter": "ardupilot", "quad": "px4"}
WIND_M_S = 8
CASES = [
    *((vehicle, ("--scenario", "square", "--gps", gps)) for gps in ("on", "cut", "never") for vehicle in VEHICLES),
    *(
        (vehicle, ("--scenario", "square", "--gps", gps, "--wind", f"{WIND_M_S}"))
        for gps in ("on", "cut", "never") for vehicle in ("heli", "copter")
    ),
    *((vehicle, ("--scenario", "pad", "--gps", "cut")) for vehicle in ("heli", "copter")),
]  # fmt: skip
FAULTY = ("--scenario", "hover", "--gps", "cut", "--fault", "all@10")


def fly(folder: Path, flights: int, beside: int, vehicles: list[str], *, faults: bool) -> None:
    """Fly what is asked for and not there yet."""
    cases = [(vehicle, FAULTY) for vehicle in VEHICLES] if faults else CASES
    cases = [case for case in cases if case[0] in vehicles]
    for number in range(
        beside, flights + 1, beside
    ):  # the same number of each, then as many again, whenever it is stopped
        for vehicle, options in cases:
            name = "-".join([vehicle, *options[1::2]]).replace("@", "-")
            command = ["sitl", VEHICLES[vehicle], "--vehicle", vehicle, *options, "--out", str(folder / name)]
            command += ["--flights", f"{number}", "--beside", f"{beside}"]
            subprocess.run([sys.executable, "-m", "flownav", *command], check=False)


def rows(folder: Path) -> list[dict[str, object]]:
    """A row of each kind of flight that is there."""
    found: dict[str, list[dict[str, object]]] = {}
    for path in sorted(folder.glob("*/*/flight.json")):
        found.setdefault(path.parent.name.rpartition("-")[0], []).append(json.loads(path.read_text()))
    return [row_of(name, flights) for name, flights in found.items()]


def section(title: str, command: str, found: list[dict[str, object]]) -> str:
    """The table in the page's words."""
    text = f"{title}\n\nPrinted by `{command}`. Median, and the worst in brackets.\n\n"
    text += f"| {' | '.join(column.title for column in COLUMNS)} |\n| --- |{' ---: |' * (len(COLUMNS) - 1)}\n"
    for row in found:
        text += f"| {' | '.join(column.cell(row) for column in COLUMNS)} |\n"
    for row in found:
        for why in dict.fromkeys(row["not_flown"]):  # type: ignore[call-overload]
            text += f"\n`{row['cell']}`, not flown to its end: {why}.\n"
    return text + "\n"


def with_section(page: str, title: str, text: str) -> str:
    """The page with a section in the place of the one of the title, else before what was not reached, its last."""
    before, found, after = page.partition(f"{title}\n")
    if found:
        _, head, rest = after.partition("\n## ")
        return before + text + (head + rest).removeprefix("\n")
    last = page.rfind("\n## ") + 1
    return page[:last] + text + page[last:]


def main(asked: argparse.Namespace) -> None:
    """Fly, print, write."""
    if not asked.as_flown:
        fly(asked.folder, asked.flights, asked.beside, asked.vehicles, faults=asked.faults)
    options = " --faults" if asked.faults else ""
    text = section(
        TITLES[asked.faults],
        f"python tools/autopilots.py docs/explanation/autopilots.md {asked.folder} --flights N{options}",
        rows(asked.folder),
    )
    page = asked.page.read_text(encoding="utf-8")
    with written_whole(asked.page) as temporary:
        temporary.write_text(with_section(page, TITLES[asked.faults], text), encoding="utf-8", newline="\n")
    print(text)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("page", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--flights", type=int, default=10)
    parser.add_argument("--beside", type=int, default=1)
    parser.add_argument("--vehicles", nargs="+", choices=VEHICLES, default=list(VEHICLES))
    parser.add_argument("--faults", action="store_true", help="each fault in a hover with GPS cut")
    parser.add_argument("--as-flown", action="store_true", help="fly nothing")
    main(parser.parse_args())
