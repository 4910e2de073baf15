"""Every fault at several heights: one flight a height, its log with and without each fault, the navigator on each."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flownav.campaigns.faults.catalogue import Fault
from flownav.campaigns.faults.navigator import Navigate
from flownav.campaigns.faults.score import FaultScores, score
from flownav.campaigns.local import fly_recorded
from flownav.core.measurement import COLUMNS, Array, Sensor, Stream
from flownav.core.parameter_files import check
from flownav.core.record import FED, POSITION_NED, Record
from flownav.logs.log import Log
from flownav.navigation.loop import STATED_VARIANCES
from flownav.simulation.assemble import Setup, assemble
from flownav.simulation.scenario import Scenario, load_scenario, with_vehicle

HEIGHTS_M = (0.5, 1.5, 3.0)
DURATIONS_S = (2.0, 5.0)
BASE = "pad_return"  # its vehicle, sensors, wind and pad
TAKEOFF_S, CLIMB_M_S, SETTLING_S, AFTER_S = 5.0, 1.0, 10.0, 5.0
SINK_M_S, RESTING_S = 0.3, 5.0
NO_FAULT = "none"
# Times at which a vehicle on the pad is given its position, and its accuracy: its navigator has levelled by then and
# has started. Ten times within a second: a single one that is two sigma off counts as no more.
PLACED_S, PLACED_SIGMA_M = np.arange(3.0, 4.0, 0.1), 0.02


class Row(NamedTuple):
    """A fault at a height; fault NO_FAULT is the same flight without."""

    fault: str
    height_m: float
    duration_s: float
    scores: FaultScores

    def entry(self) -> dict[str, Any]:
        """The row as JSON has it."""
        return {
            "fault": self.fault, "height_m": self.height_m, "duration_s": self.duration_s, **self.scores._asdict()
        }  # fmt: skip


def fault_table(
    navigate: Navigate,
    faults: Sequence[Fault],
    heights_m: Sequence[float] = HEIGHTS_M,
    durations_s: Sequence[float] = DURATIONS_S,
    seed: int = 1,
    on_progress: Callable[[int], None] = lambda done: None,
    vehicle: str | None = None,
) -> list[Row]:
    """Fly, inject, navigate, score. Rows by height, without a fault first; `on_progress` is called with 1 for each.

    vehicle: another one than `BASE` has (`with_vehicle`).
    """
    rows = []
    for height_m in heights_m:
        longest_s = longest(faults, durations_s)
        log = flight_at(height_m, longest_s, seed, vehicle)
        without = navigate(log.streams)
        truth = log.truth or {}
        hover_s = window_start(height_m)
        nothing = score(without, without, truth, (), (hover_s, hover_s), log.streams, log.streams)
        rows.append(Row(NO_FAULT, height_m, 0.0, nothing))
        on_progress(1)
        for fault in faults:
            for duration_s in durations_of(fault, durations_s):
                t0_s = hover_s + longest_s + AFTER_S if fault.in_descent else hover_s
                window = (t0_s, t0_s + duration_s)
                streams = fault.inject(log.streams, *window, seed)
                run = navigate(streams)
                figures = score(run, without, truth, fault.sensors, window, log.streams, streams)
                rows.append(Row(fault.name, height_m, duration_s, figures))
                on_progress(1)
    return rows


def durations_of(fault: Fault, durations_s: Sequence[float]) -> tuple[float, ...]:
    """How long a fault is tried: its own time where it has one."""
    return tuple(durations_s) if fault.lasts_s is None else (fault.lasts_s,)


def longest(faults: Sequence[Fault], durations_s: Sequence[float]) -> float:
    """The longest of all windows."""
    return max(duration for fault in faults for duration in durations_of(fault, durations_s))


def runs(faults: Sequence[Fault], heights_m: Sequence[float], durations_s: Sequence[float]) -> int:
    """How many rows a table will have."""
    return len(heights_m) * (1 + sum(len(durations_of(fault, durations_s)) for fault in faults))


# -- the flight --------------------------------------------------------------------------------------------
def window_start(height_m: float) -> float:
    """When a fault begins: the vehicle has hovered for 10 s."""
    return TAKEOFF_S + height_m / CLIMB_M_S + SETTLING_S


def flight_at(height_m: float, longest_s: float, seed: int, vehicle: str | None = None) -> Log:
    """The log of one flight that hovers at a height for as long as any fault takes, and then lands.

    With ten POSEs: a vehicle on its pad is given its position, so that errors are not those of the GPS's frame.
    """
    setup = assemble(scenario_at(height_m, longest_s, vehicle))
    return stood(log_of(fly_recorded(setup, seed), setup))


def stood(log: Log) -> Log:
    """The same with POSEs of where the vehicle stands before take-off. ValueError without its truth."""
    if log.truth is None:
        raise ValueError(f"{log.path.name}: the truth of a flight says where it stands, and is lacking")
    rows = np.searchsorted(log.truth["t_s"], PLACED_S)
    stands = np.column_stack([log.truth[name][rows] for name in POSITION_NED])
    variance = np.full(stands.shape, PLACED_SIGMA_M**2)
    pose = Stream.of(Sensor.POSE, log.truth["t_s"][rows], stands, variance=variance)
    return replace(log, streams={**log.streams, Sensor.POSE: pose})


def scenario_at(height_m: float, longest_s: float, vehicle: str | None = None) -> Scenario:
    """Up from the pad at 1 m/s, hover, down at 0.3 m/s, and 5 s on the pad; the autopilot uses the truth.

    So that a fault in the streams changes nothing of the flight. InputError where the height cannot be flown.
    """
    words = f"hover_{height_m:g}_m", "landing on the same pad, autopilot on the truth"
    land_s = window_start(height_m) + longest_s + AFTER_S
    return hovering(words, height_m, land_s, {"feedback": "truth"}, vehicle)


def hovering(
    words: tuple[str, str], height_m: float, land_s: float, autopilot: dict[str, Any], vehicle: str | None,
    longer_s: float = 0.0,
) -> Scenario:  # fmt: skip
    """Up from the pad at 1 m/s, hover until land_s, down at 0.3 m/s, 5 s on the pad, and so much longer.

    words: the scenario's name, and how its description ends. InputError where the height cannot be flown.
    """
    down_s, below_m = land_s + height_m / SINK_M_S + RESTING_S, SINK_M_S * RESTING_S  # until the skids carry weight
    heights = ((0.0, 0.0), (TAKEOFF_S, 0.0), (TAKEOFF_S + height_m / CLIMB_M_S, height_m), (land_s, height_m))
    entries = with_vehicle(load_scenario(BASE), vehicle).model_dump(exclude_unset=True)
    entries["name"] = words[0]
    entries["description"] = f"Take-off, hover at {height_m:g} m, {words[1]}"
    entries["flight"] = {
        "duration_s": down_s + longer_s,
        "start": "ground",
        "takeoff_at_s": TAKEOFF_S,
        "may_land_after_s": land_s,
        "path": [{"t_s": t_s, "height_m": own_m} for t_s, own_m in (*heights, (down_s, -below_m))],
    }
    entries["autopilot"] = autopilot
    return check(entries, Scenario, "faults")


# -- a simulated flight as the log that its vehicle would have recorded ------------------------------------------
VALUE, VARIANCE = FED.index("value_0"), FED.index("variance_0")


def log_of(record: Record, setup: Setup) -> Log:
    """The log of a recorded flight of `setup`, with the flight's truth and the estimate that its autopilot used.

    Each stream states the age of its readings as the sensor's datasheet does. ValueError where the flight carries no
    sensors of its own (it used the paper's filter).
    """
    if "fed" not in record.tables or setup.fitted is None:
        raise ValueError("the flight has no sensors of its own; fly it on the navigator")
    fed, limits = record.matrix("fed", FED), setup.sensor.limits
    streams = {sensor: stream_of(fed, sensor, float(setup.fitted.ages_s[sensor])) for sensor in Sensor}
    ranger = setup.fitted.sheets.range_sensor
    ranges = {} if ranger is None else {"range_m": (float(ranger.floor_m), float(ranger.ceiling_m))}
    return Log(
        Path(f"{setup.scenario.name} (simulated)"),
        {sensor: stream for sensor, stream in streams.items() if len(stream)},
        truth=record.tables["truth"],
        autopilot=record.tables["flown"],
        autopilot_name="flownav",
        limits=ranges
        | {
            "flow_height_m": (float(limits.min_height_m), float(limits.max_height_m)),
            "flow_rad_s": (0.0, float(limits.max_flow_rad_s)),
        },
    )


def stream_of(fed: Array, sensor: Sensor, delay_s: float) -> Stream:
    """One sensor's readings that arrived, of rows as `record.FED` has them."""
    mine = (fed[:, FED.index("sensor")] == sensor) & (fed[:, FED.index("arrived")] > 0.0)
    rows, width = fed[mine], len(COLUMNS[sensor])
    variance = np.full((len(rows), width), np.nan)
    stated = min(width, STATED_VARIANCES)
    variance[:, :stated] = rows[:, VARIANCE : VARIANCE + stated]
    return Stream.of(
        sensor,
        rows[:, FED.index("arrival_s")],
        rows[:, VALUE : VALUE + width],
        variance=variance,
        quality=rows[:, FED.index("quality")],
        delay_s=delay_s,
    )
