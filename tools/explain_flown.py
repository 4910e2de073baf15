"""Faults flown in the autopilots' simulators, and what `flownav explain` names of the autopilots' own logs.

Flies by `flownav sitl` what the folder does not hold, real time, some two minutes each, and writes the table into the
page. `--as-flown` explains what is there. The simulator is found as `flownav sitl` finds it.

python tools/explain_flown.py PAGE FOLDER [--as-flown]
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import NamedTuple

from flownav.core.files import written_whole
from flownav.logs.open_log import open_log
from flownav.studies.explain.judge import explain
from planted.results import FLOWN_TITLE, without_flown

LIST = Path(__file__).parent / "planted" / "flown.toml"
USUAL = {"ardupilot": {"--vehicle": "copter", "--scenario": "tour"}, "px4": {"--vehicle": "quad", "--scenario": "tour"}}
TITLES = {"ardupilot": "ArduPilot", "px4": "PX4"}
HEAD = f"""{FLOWN_TITLE}

Printed by `python tools/explain_flown.py docs/explanation/explained.md out/flown`. ArduPilot's and PX4's
simulators, flown by [`flownav sitl`](../how-to/sitl.md) on flownav's estimate (`tour`: ten seconds of hover, a
square of 10 m), their faults, and their own DataFlash and ULog logs; one flight of each. Nothing but the log is
read.

The share that is right here is no blind figure: the rules were mended by what was wrong at the first look.

* **ArduPilot**: at the first look 13 of 17 first causes, and nothing named of 4 of 6. A range that ends near the
  ground is not out of reach, a compass that goes off in flight while the filter keeps its heading is named, the
  vehicle's own level of vibration is read, external navigation is an aid, a gyro at rest is not off. All have been
  flown again since, by a build whose GPS comes in steps of 0.4 m north and 0.65 m east: 17 of 17 and 6 of 6 before
  any rule was changed for them. `range-noise` came later.
* **PX4**: at the first look 13 of 15 first causes, and nothing named of 1 of 5. A gyro's response lies between two
  regressions, drag goes by the speed that is received at the time. Two faults were planted anew: a reversed flow
  turned with the vehicle as if it were not, and a parameter was set back before the log ended. PX4 1.17 has no
  deadlock of the height.

"""


class Flight(NamedTuple):
    """A flight of the list: options of `flownav sitl`, the fault, and what is to be named, one of them (or nothing)."""

    name: str
    autopilot: str = "ardupilot"
    options: str = ""
    fault: str = ""
    causes: tuple[str, ...] = ()
    without: str = ""

    def command(self, folder: Path) -> list[str]:
        """How it is flown."""
        own = self.options.split()
        usual = [word for pair in USUAL[self.autopilot].items() if pair[0] not in own for word in pair]
        fault = ["--fault", self.fault] if self.fault else []
        return ["sitl", self.autopilot, *usual, *own, *fault, "--link", "--out", str(folder / self.name)]


def flights() -> list[Flight]:
    """The list."""
    content = tomllib.loads(LIST.read_text(encoding="utf-8"))
    return [Flight(**{**entry, "causes": tuple(entry.get("causes", ()))}) for entry in content["flight"]]


def named(log: Path) -> tuple[str, ...]:
    """The named causes of a log, the first cause first."""
    return tuple(one.name for one in explain(open_log(log)).findings)


def right(flight: Flight, found: tuple[str, ...]) -> bool:
    """Whether the first cause is one of those planted, or none is named where none is to be."""
    return found[:1] != () and found[0] in flight.causes if flight.causes else not found


def section(found: list[tuple[Flight, tuple[str, ...]]]) -> str:
    """The table, and the share that is right."""
    text = HEAD
    text += "| flight | fault | to be named | named | right |\n|---|---|---|---|---|\n"
    for flight, names in found:
        wanted = " or ".join(flight.causes) or "nothing" + (f": {flight.without}" if flight.without else "")
        said = ", ".join(names) or "nothing"
        verdict = "yes" if right(flight, names) else "**no**"
        text += f"| {flight.name} | {flight.fault or 'none'} | {wanted} | {said} | {verdict} |\n"
    for autopilot, title in TITLES.items():
        mine = [one for one in found if one[0].autopilot == autopilot]
        planted, others = ([one for one in mine if bool(one[0].causes) == has] for has in (True, False))
        if mine:
            good, silent = (sum(right(*one) for one in of) for of in (planted, others))
            share = 100.0 * good / max(len(planted), 1)
            text += f"\n{title}: first cause right: {good} of {len(planted)} ({share:.0f} %); "
            text += f"nothing named where nothing is to be: {silent} of {len(others)}.\n"
    return text


def main(asked: argparse.Namespace) -> None:
    """Fly, explain, write."""
    found = []
    for flight in flights():
        if not asked.as_flown:
            subprocess.run([sys.executable, "-m", "flownav", *flight.command(asked.folder)], check=False)
        logs = sorted((asked.folder / flight.name).glob("*/autopilot.*"))
        if logs:
            found.append((flight, named(logs[0])))
            print(f"{flight.name}: {', '.join(found[-1][1]) or 'nothing'}", file=sys.stderr, flush=True)
    text = section(found)
    before = asked.page.read_text(encoding="utf-8") if asked.page.exists() else ""
    with written_whole(asked.page) as temporary:
        temporary.write_text(without_flown(before) + text, encoding="utf-8", newline="\n")
    print(text)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("page", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--as-flown", action="store_true", help="fly nothing")
    main(parser.parse_args())
