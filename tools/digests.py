"""Digests of what the simulator and the navigator make of everything at hand, to show that a change kept every bit.

python tools/digests.py [--quick] [--only WORD] [--out FILE] [--against FILE]

All shipped scenarios (one lane and sixteen, matched and ensemble), scenarios with the paper's filter and other
vehicles, all replays of the logs in FLOWNAV_DATA (or ../shared/data) and one campaign; --quick takes one lane of three
scenarios and short logs. A NaN counts as one value, whatever its bits. --against FILE says what differs; exit status 1.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from flownav.campaigns.plan import planned
from flownav.campaigns.run import engine_named, run_campaign
from flownav.campaigns.store import Store
from flownav.core.compile import LANES, ONE_LANE
from flownav.core.errors import InputError
from flownav.core.files import written_whole
from flownav.core.parameter_files import shipped
from flownav.logs.open_log import open_flight
from flownav.replays.fed import as_fed
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import replay
from flownav.simulation.assemble import assemble
from flownav.simulation.engine import fly_written
from flownav.simulation.scenario import Scenario, load_scenario, with_filter, with_vehicle
from flownav.studies.compare.job import logs_in

Case = tuple[str, Callable[[], str]]

SCENARIOS = ("takeoff", "landing", "pad_return", "approach", "gusty")
QUICK_SCENARIOS = ("pad_return", "approach", "carried")
QUICK_LOGS = ("quad-px4flow-mocap", "indoor-made", "heli_sitl")
SEED = 7


def digest(*arrays: Any) -> str:
    """The first 16 hexadecimal digits of SHA-256 over shapes and bytes."""
    found = hashlib.sha256()
    for array in arrays:
        values = np.ascontiguousarray(array)
        if values.dtype.kind == "f":
            values = np.where(np.isnan(values), np.nan, values)
        found.update(repr((values.shape, values.dtype.str)).encode())
        found.update(values.tobytes())
    return found.hexdigest()[:16]


def scenarios() -> dict[str, Scenario]:
    """Every scenario that is flown, by name."""
    found = {name: load_scenario(name) for name in SCENARIOS}
    found["carried"] = load_scenario(str(shipped("samples/flight.toml")))
    found["landing, paper"] = with_filter(found["landing"], "paper")
    found["takeoff, paper"] = with_filter(found["takeoff"], "paper")
    for vehicle in ("quad-450", "hexa-550"):
        found[f"landing, {vehicle}"] = with_vehicle(found["landing"], vehicle)
    return found


def flight_digest(scenario: Scenario, lanes: tuple[int, ...], *, dispersed: bool) -> str:
    """Digest of a block of flights: history, estimates, innovations, events and readings."""
    setup = assemble(scenario)
    flown = fly_written(setup.flight, SEED, 0, lanes, setup.ensemble() if dispersed else None)
    tape = flown.tape
    each = [part for lane in range(len(lanes)) for part in (tape.estimates(lane), tape.offers(lane), tape.events(lane))]
    return digest(flown.history, flown.fed, *each)


def replay_digest(path: Path) -> str:
    """Digest of the navigator's rows of a log, forward and, where possible, smoothed."""
    try:
        log = open_flight(path)
        options, settings = as_fed(log, ReplayOptions(), None)
        found = replay(log, options, settings, smoothed=not log.fed)
    except InputError as error:
        return f"refused: {str(error).removeprefix(f'{path}: ')[:60]}"
    smoothed = () if found.smoothed is None else (found.smoothed,)
    return digest(found.estimate, found.innovation, found.written.event, *smoothed)


def campaign_digest() -> str:
    """The rows of a campaign of 64 flights in four cells, matched and ensemble."""
    plan = planned(
        [load_scenario("pad_return")], {"wind.speed_20ft_m_s": (0.0, 4.0)}, truth_models=("matched", "ensemble"),
        seed=SEED, flights=16, sampling="latin",
    )  # fmt: skip
    with TemporaryDirectory() as folder, Store(Path(folder) / "campaign").opened(plan) as store:
        run_campaign(plan, engine_named("local"), store)
        files = sorted((store.folder / "flights").rglob("*.parquet"))
        import pyarrow.parquet as pq

        tables = [pq.read_table(file) for file in files]
        return digest(*(column.to_numpy() for table in tables for column in table.columns if _is_number(column)))


def _is_number(column: Any) -> bool:
    return np.asarray(column.to_numpy()).dtype.kind in "fiub"


def cases(data: Path, *, quick: bool) -> Iterator[Case]:
    """Each thing that has a digest: its name, and what computes it."""
    for name, scenario in scenarios().items():
        if quick and name not in QUICK_SCENARIOS:
            continue
        for lanes in (ONE_LANE,) if quick else (ONE_LANE, LANES):
            for dispersed in (False, True):
                label = f"fly {name}, {len(lanes)} lanes, {'ensemble' if dispersed else 'matched'}"
                yield label, lambda s=scenario, n=lanes, d=dispersed: flight_digest(s, n, dispersed=d)
    if data.is_dir():
        for path in logs_in(data):
            label = str(path.relative_to(data))
            if not quick or any(word in label for word in QUICK_LOGS):
                yield f"replay {label}", lambda p=path: replay_digest(p)
    if not quick:
        yield "campaign pad_return", campaign_digest


def main() -> int:
    """Print every digest; compare or write them as asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--only", default="", help="cases whose name has this word")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--against", type=Path)
    asked = parser.parse_args()
    before = json.loads(asked.against.read_text()) if asked.against else {}
    found, differ = {}, 0
    for name, compute in cases(Path(os.environ.get("FLOWNAV_DATA", "../shared/data")), quick=asked.quick):
        if asked.only not in name:
            continue
        found[name] = compute()
        same = before.get(name, found[name]) == found[name]
        differ += not same
        print(f"{found[name]}  {name}{'' if same else f'  DIFFERS from {before[name]}'}", flush=True)
    if asked.out:
        with written_whole(asked.out) as temporary:
            temporary.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    print(f"{len(found)} digests, {differ} differ" if before else f"{len(found)} digests")
    return 1 if differ else 0


if __name__ == "__main__":
    sys.exit(main())
