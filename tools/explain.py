"""How often `flownav explain` is right: planted faults, pairs, clean flights, recorded logs, and cures flown again.

`make explain` prints the table and writes it; `make explain CALIBRATE=1` fits the two numbers by which a sign becomes a
probability, on flights of other seeds. Each fault is planted a second time, into another flight.

python tools/explain.py PAGE [--calibrate] [--data FOLDER] [--beside N]
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from flownav.core.files import written_whole
from flownav.core.record import POSITION_NED
from flownav.logs.log import Log
from flownav.logs.open_log import open_log
from flownav.studies.explain.case import Case
from flownav.studies.explain.judge import Explanation, consequences, explain, looked
from planted.planted import LISTS, Planted, clean, listed, logged, read
from planted.results import FLOWN_TITLE, Flown, Recorded, Result, page
from planted.witnesses import witnessed

CLEAN_SEEDS, CLEAN_KINDS = (
    range(40, 45),
    (
        ("yard", "px4"),
        ("hall", "ardupilot"),
        ("climb", "px4"),
        ("low", "px4"),
        ("yard", "ardupilot"),
        ("hall", "px4"),
    ),
)
CALIBRATION_SEEDS, CALIBRATED_APART = range(60, 64), 1000
OTHER_APART = 3000  # of the same faults in other flights
CURED_APART = 50  # a cure is flown by another flight: its seed is so much larger
NOTHING = "nothing wrong"
RECORDED = (
    ("quad-px4flow-outdoor", NOTHING),
    ("dataflash/heli_sitl_takeoff_square_land.bin", NOTHING),
    ("mavlink/heli_sitl.tlog", NOTHING),
    ("indoor-made/a-clean", NOTHING),
    ("indoor-made/b-turning", NOTHING),
    ("ardupilot-live/square/from_vehicle.tlog", NOTHING),
    ("ulog/sample_log_small.ulg", NOTHING),
    ("ulog/sample_appended_multiple.ulg", NOTHING),
    ("ardupilot-live/origin/from_vehicle.tlog", "nothing wrong but the GPS's origin, moved on the ground"),
    ("ardupilot-live/no-gps-never-sends/from_vehicle.tlog", "no GPS, and it stays on the ground"),
    ("px4-live/px4-no-gps-heading/from_vehicle.tlog", "no sensor: an external heading runs away"),
    ("indoor-made/c-lying-accel", "accelerometer off by 2 to 4 m/s2 level"),
    ("indoor-made/e-steps", "boxes of 0.35 m and a ledge"),
    ("quad-px4flow-outdoor-2", "a sonar that jumps"),
    ("ardupilot-live/accel-stuck/from_vehicle.tlog", "an accelerometer that says 3 m/s2 for 6 s"),
    ("ardupilot-live/flow-noise-silence/from_vehicle.tlog", "flow of noise for 10 s"),
    ("indoor-made/d-vibration", "vibration, and an accelerometer off by 2 to 3 m/s2 level"),
    ("indoor-made/f-dropouts", "no texture for two stretches of about a second"),
    ("quad-px4flow-mocap", "accelerometer says 6 m/s2 in hover, sonar sticks near the ground"),
    ("quad-px4flow-outdoor-3", "a sonar that jumps and repeats itself, and flow beyond what it can see: below"),
    ("px4-voxl-indoor/voxl_two_flow_sensors.ulg", "a field that changes when the motors pull: below"),
)
ELSEWHERE = {"range_out_of_reach": "yard", "focus_height": "hall"}  # below the fence that the cure sets, or above


def result(fault: Planted, data: Path | None, cured: bool = True) -> Result:
    """A fault's log written, read and explained, and its cure flown where that is asked for."""
    with tempfile.TemporaryDirectory(prefix="planted-logs-") as place:
        log = read(fault, Path(place), data)
    begun = time.process_time()
    explained = explain(log)
    seconds, named = time.process_time() - begun, tuple(one.name for one in explained.findings)
    print(f"{fault.name}: {', '.join(named) or 'nothing'}", file=sys.stderr, flush=True)
    cured = cured and not fault.log and fault.causes == named[:1]
    return Result(fault, named, seconds, flown(fault, explained) if cured else None)


def elsewhere(fault: Planted) -> Planted:
    """The same fault in another flight; a recorded one as it is."""
    return replace(fault, seed=fault.seed + OTHER_APART)


def as_recorded(data: Path, name: str, known: str) -> Recorded:
    """A recorded log read and explained."""
    log = open_log(data / name)
    begun = time.process_time()
    named = tuple(one.name for one in explain(log).findings)
    return Recorded(name, known, named, log.span_s[1] - log.span_s[0], time.process_time() - begun)


# -- cures ---------------------------------------------------------------------------------------------------------
def flown(fault: Planted, explained: Explanation) -> Flown | None:
    """The same fault in another flight, cured; None where parameters alone do not cure the first cause."""
    first = explained.first
    if first is None or not first.cure.holds:
        return None
    again = replace(fault, seed=fault.seed + CURED_APART, flight=ELSEWHERE.get(first.name, fault.flight))
    lasting = _lasting(again)
    spoilt = len(again.readings) > len(lasting)
    sound = replace(again, parameters=again.parameters if spoilt else {}, readings=lasting, switched=())
    settings = {setting.name: float(setting.text) for setting in first.cure.settings}
    return Flown(error_of(logged(again)), error_of(logged(again, settings)), error_of(logged(sound)))


def _lasting(fault: Planted) -> tuple[dict[str, object], ...]:
    """Of a fault's readings those that no parameter can take away and that are not its cause: GPS that is not there."""
    return (
        tuple(entry for entry in fault.readings if entry["does"] == "gps_lost")
        if "source" not in "".join(fault.causes)
        else ()
    )


def error_of(log: Log) -> tuple[float, float]:
    """The stand-in's error in flight: level velocity [m/s] and height [m] about its middle, rms."""
    assert log.truth is not None
    assert log.autopilot is not None
    t_s = np.asarray(log.autopilot["t_s"], float)
    path = np.column_stack([np.asarray(log.autopilot[name], float) for name in POSITION_NED])
    true = np.column_stack([np.interp(t_s, log.truth["t_s"], log.truth[name]) for name in POSITION_NED])
    aloft = (true[:, 2] < -0.4) & (t_s > 10.0)
    off = path - true
    step = max(1, round(1.0 / float(np.median(np.diff(t_s)))))
    rate = (off[step:, :2] - off[:-step, :2])[aloft[step:]]
    height = off[aloft, 2] - np.median(off[(t_s < 8.0), 2])
    return float(np.sqrt(np.mean(np.sum(rate**2, axis=1)))), float(np.sqrt(np.mean(height**2)))


# -- calibration ---------------------------------------------------------------------------------------------------
def signs(fault: Planted) -> list[tuple[float, bool]]:
    """Of a fault's log every sign that is no consequence: its strength, and whether it was planted."""
    with tempfile.TemporaryDirectory(prefix="planted-logs-") as place:
        log = read(fault, Path(place))
    return [
        (max(one.sign.strength, 1e-2), one.hypothesis.name in fault.causes)
        for one in consequences(looked(Case(log))[0])
        if not one.consequence_of
    ]


def calibrate(pool: Executor) -> str:
    """The steepness and middle by maximum likelihood: planted signs against all others, apart from the tests."""
    from scipy.optimize import minimize

    faults = [clean(kind, dialect, seed) for seed in CALIBRATION_SEEDS for kind, dialect in CLEAN_KINDS]
    faults += [replace(fault, seed=fault.seed + CALIBRATED_APART) for fault in listed("own")]
    found = [one for of in pool.map(signs, faults) for one in of]
    logs, wanted = np.log(np.array([strength for strength, _ in found])), np.array([planted for _, planted in found])

    def cost(p: np.ndarray) -> float:
        odds = np.exp(p[0]) * (logs - p[1])
        return float(np.sum(np.logaddexp(0.0, np.where(wanted, -odds, odds))) + 0.01 * p[0] ** 2)

    best = minimize(cost, np.array([np.log(5.0), 0.0]), method="Nelder-Mead").x
    order = 1.0 / (1.0 + np.exp(-np.exp(best[0]) * (logs - best[1])))
    said = [
        f"STEEPNESS = {np.exp(best[0]):.1f}, MIDDLE = {np.exp(best[1]):.2f} "
        f"from {len(logs)} signs, {wanted.sum()} of them planted"
    ]
    for low, high in ((0.0, 0.02), (0.02, 0.2), (0.2, 0.5), (0.5, 0.8), (0.8, 0.98), (0.98, 1.01)):
        inside = (order >= low) & (order < high)
        if inside.any():
            said.append(f"said {order[inside].mean():.3f}, was {wanted[inside].mean():.3f} ({inside.sum()} signs)")
    return "\n".join(said)


def main(asked: argparse.Namespace) -> None:
    """Explain everything, print and write."""
    with ProcessPoolExecutor(asked.beside) as pool:
        if asked.calibrate:
            print(calibrate(pool))
            return
        one = partial(result, data=asked.data)
        by_list = {name: list(pool.map(one, listed(name))) for name in LISTS}
        clean_flights = [clean(kind, dialect, seed) for seed in CLEAN_SEEDS for kind, dialect in CLEAN_KINDS]
        sound = list(pool.map(one, clean_flights))
        other = partial(result, data=asked.data, cured=False)
        moved = {name: [elsewhere(fault) for fault in listed(name)] for name in LISTS}
        moved["clean"] = [elsewhere(fault) for fault in clean_flights]
        again = {name: list(pool.map(other, faults)) for name, faults in moved.items()}
    recorded: list[Recorded] = []
    judged = witnessed(asked.data) if asked.data is not None else ""
    if asked.data is not None and asked.data.is_dir():
        recorded = [as_recorded(asked.data, log, known) for log, known in RECORDED]
    text = page(by_list, again, sound, recorded, judged)
    if asked.page.exists() and FLOWN_TITLE in (before := asked.page.read_text(encoding="utf-8")):
        text += "\n" + FLOWN_TITLE + before.split(FLOWN_TITLE)[1]
    with written_whole(asked.page) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")
    print(text)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("page", type=Path)
    parser.add_argument("--calibrate", action="store_true")
    parser.add_argument("--data", type=Path, default=None)
    parser.add_argument("--beside", type=int, default=os.cpu_count() or 1, help="how many at once")
    main(parser.parse_args())
