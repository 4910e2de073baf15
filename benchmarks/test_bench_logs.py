"""Reading an ArduPilot log of some 50 MB: our columns beside pymavlink's DFReader, the same messages, in one run.

The copies end with their last whole message, and repeat their times: neither reader looks at them.
"""

from __future__ import annotations

import os
from pathlib import Path
from time import perf_counter

import numpy as np
import pytest
from pymavlink.DFReader import DFReader_binary

from flownav.logs.dataflash import DataFlash, read_columns

FLIGHT = Path("dataflash") / "heli_sitl_takeoff_square_land.bin"
COPIES = 8
MESSAGES = ("ATT", "BARO", "GPA", "GPS", "IMU", "MAG", "OF", "RFND", "SIM2", "XKF1")
GROUP = "ten kinds of message of a 54 MB DataFlash log"

timed: dict[str, float] = {}
values: dict[str, dict[str, dict[str, np.ndarray]]] = {}


@pytest.fixture(scope="module")
def tiled(tmp_path_factory) -> Path:
    roots = [os.environ.get("FLOWNAV_DATA"), Path(__file__).resolve().parents[2] / "shared" / "data"]
    found = [Path(root) / FLIGHT for root in roots if root and (Path(root) / FLIGHT).is_file()]
    if not found:
        pytest.skip(f"{FLIGHT} is absent: set FLOWNAV_DATA to the folder of recorded logs")
    path = tmp_path_factory.mktemp("tiled") / "log.bin"
    whole = found[0].stat().st_size - DataFlash(found[0]).skipped_bytes  # its last message was cut off
    path.write_bytes(found[0].read_bytes()[:whole] * COPIES)
    return path


def pymavlink_columns(path: Path) -> dict[str, dict[str, np.ndarray]]:
    """Arrays read as a user of DFReader reads them."""
    log = DFReader_binary(str(path))
    rows: dict[str, list[list[float]]] = {name: [] for name in MESSAGES}
    labels: dict[str, list[str]] = {}
    while (message := log.recv_match(type=list(MESSAGES))) is not None:
        name = message.get_type()
        labels.setdefault(name, message.get_fieldnames())
        rows[name].append([getattr(message, label) for label in labels[name]])
    log.close()
    return {
        name: dict(zip(labels[name], map(np.array, zip(*of_kind, strict=True)), strict=True))
        for name, of_kind in rows.items()
    }


@pytest.mark.benchmark(group=GROUP)
def test_flownav(benchmark, tiled):
    begun = perf_counter()
    values["cold"] = read_columns(tiled, MESSAGES)
    timed["cold"] = perf_counter() - begun
    values["flownav"] = benchmark(read_columns, tiled, MESSAGES)
    if not benchmark.disabled:
        timed["flownav"] = benchmark.stats.stats.median


@pytest.mark.benchmark(group=GROUP)
def test_pymavlink(benchmark, tiled, capsys):
    values["pymavlink"] = benchmark.pedantic(pymavlink_columns, (tiled,), rounds=1)
    assert set(values["pymavlink"]) == set(values["flownav"]) == set(MESSAGES)
    for name, table in values["pymavlink"].items():
        for label, column in table.items():
            ours = values["flownav"][name][label]
            assert np.array_equal(column.astype(ours.dtype), ours, equal_nan=ours.dtype.kind == "f"), (name, label)
    if benchmark.disabled:
        return
    timed["pymavlink"] = benchmark.stats.stats.median
    size_mb = tiled.stat().st_size / 1e6
    with capsys.disabled():
        for name in ("cold", "flownav", "pymavlink"):
            print(f"\n{name}: {size_mb / timed[name]:.0f} MB/s", end="")
        print(f"\nflownav is {timed['pymavlink'] / timed['flownav']:.0f} times as fast as pymavlink")
