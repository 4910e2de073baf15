"""The producers of figures and of whole tables: name, command, what it depends on, and where its figures lie.

A figure lies in the JSON object of its command: `cases[case=approach].ensemble.touchdown.rest.r95_m`.
"""

from __future__ import annotations

import re
from typing import Any, NamedTuple

SRC = "src/flownav"
NAVIGATOR = (f"{SRC}/navigation", f"{SRC}/estimation")
FLOWN = ("sensors", "maxi_joker_3.toml", "dispersion.toml", "takeoff.toml", "landing.toml", "pad_return.toml",
         "approach.toml")  # fmt: skip
SIMULATOR = (*NAVIGATOR, f"{SRC}/simulation", f"{SRC}/control", f"{SRC}/vehicle", f"{SRC}/sensors",
             *(f"{SRC}/data/{name}" for name in FLOWN))  # fmt: skip
REPLAYS = (*NAVIGATOR, f"{SRC}/replays", f"{SRC}/logs", f"{SRC}/scoring")
PAPERS = (f"{SRC}/paper", *(path for path in SIMULATOR if path != f"{SRC}/navigation"))


class Read(NamedTuple):
    """Where a figure lies in the object that the command prints, its unit, and how pages show it."""

    path: str
    unit: str
    decimals: int
    interval: tuple[str, ...] = ()  # the path of a pair, or the paths of the two ends


class Producer(NamedTuple):
    """A command with the figures that it prints as JSON, or with the page of docs/ that it writes."""

    command: str
    depends: tuple[str, ...]
    figures: dict[str, Read] = {}  # noqa: RUF012 (a table that nobody writes to)
    page: str | None = None


def _case(case: str, flights: str, what: str) -> str:
    return f"cases[case={case}].{flights}.{what}"


def _radius(case: str, flights: str) -> Read:
    rest = _case(case, flights, "touchdown.rest")
    return Read(f"{rest}.r95_m", "m", 3, (f"{rest}.r95_interval_m",))


def _largest(decimals: int) -> Read:
    which = "max_position_error_m"
    return Read(f"{which}.median", "m", decimals, (f"{which}.p05", f"{which}.p95"))


OUTAGES = {
    "median_m": Read("outage_median_rms_m", "m", 2),
    "worst_m": Read("outage_worst_rms_m", "m", 2),
}
DATA = "../shared/data"
PRODUCERS: dict[str, Producer] = {
    "certify": Producer("flownav certify approach", (*SIMULATOR, f"{SRC}/data/requirements/approach.toml"), {
        "asked_m": Read("requirement.requirements[0].at_most", "m", 2),
        "flights": Read("flights", "", 0),
        "farther": Read("requirement.requirements[0].failures", "", 0),
    }),
    "accuracy": Producer("flownav accuracy --flights 384 --ablations 0", (*SIMULATOR, f"{SRC}/campaigns"), {
        "flights": Read("flights", "", 0),
        "landing_axis_p95_m": Read(_case("landing", "matched", "p95_largest_axis_m"), "m", 2),
        "takeoff_axis_p95_m": Read(_case("takeoff", "matched", "p95_largest_axis_m"), "m", 2),
        "landing_dispersed_axis_p95_m": Read(_case("landing", "ensemble", "p95_largest_axis_m"), "m", 2),
        "takeoff_dispersed_axis_p95_m": Read(_case("takeoff", "ensemble", "p95_largest_axis_m"), "m", 2),
        "pad_return_p95_m": Read(_case("pad_return", "matched", "p95_largest_horizontal_m"), "m", 2),
        "pad_return_dispersed_p95_m": Read(_case("pad_return", "ensemble", "p95_largest_horizontal_m"), "m", 2),
        "approach_matched_rest_r95_m": _radius("approach", "matched"),
        "approach_rest_r95_m": _radius("approach", "ensemble"),
        "windy_matched_rest_r95_m": _radius("approach_8_m_s", "matched"),
        "windy_rest_r95_m": _radius("approach_8_m_s", "ensemble"),
    }),
    "accuracy-pad-return": Producer("flownav accuracy --cases pad_return --flights 384 --ablations 0",
                                    (*SIMULATOR, f"{SRC}/campaigns"),
                                    {"rest_r95_m": _radius("pad_return", "ensemble")._replace(decimals=2)}),
    "paper-landing": Producer("flownav fly landing --filter paper --flights 1000 --matched", PAPERS,
                              {"largest_m": _largest(3)}),
    "paper-takeoff": Producer("flownav fly takeoff --filter paper --flights 1000 --matched", PAPERS,
                              {"largest_m": _largest(3)}),
    "paper-real-gps": Producer("flownav fly landing --filter paper --gps midg --flights 1000 --matched", PAPERS,
                               {"largest_m": _largest(2)}),
    "outages": Producer(f"flownav replay {DATA}/quad-px4flow-outdoor --outage-table 60:780:60", REPLAYS, OUTAGES),
    "outages-2": Producer(f"flownav replay {DATA}/quad-px4flow-outdoor-2 --outage-table 60:660:60", REPLAYS, OUTAGES),
    "outages-3": Producer(f"flownav replay {DATA}/quad-px4flow-outdoor-3 --outage-table 420:660:60", REPLAYS, OUTAGES),
    "outage": Producer(f"flownav replay {DATA}/quad-px4flow-outdoor --gps-outage 200:260", REPLAYS, {
        "drift_m": Read("outages[0].horizontal_rms_m", "m", 2),
    }),
    "indoor": Producer(f"flownav replay {DATA}/px4-voxl-indoor/voxl_two_flow_sensors.ulg", REPLAYS, {
        "velocity_m_s": Read("truth.velocity_rms_m_s", "m/s", 2),
        "position_m": Read("truth.horizontal_rms_m", "m", 2),
    }),
    "mocap": Producer(f"flownav replay {DATA}/quad-px4flow-mocap", REPLAYS, {
        "velocity_m_s": Read("truth.velocity_rms_m_s", "m/s", 2),
        "end_drift_m": Read("end_drift_m", "m", 2),
    }),
    # -- pages whose tables a command writes -----------------------------------------------------------------------
    "league": Producer("make league", (*REPLAYS, f"{SRC}/studies/compare"), page="explanation/league.md"),
    "made-flights": Producer("make made-flights", (*REPLAYS, "tools/made"), page="explanation/made-flights.md"),
    "explained": Producer("make explain", (f"{SRC}/studies/explain", *SIMULATOR), page="explanation/explained.md"),
    "integrity": Producer("make integrity", SIMULATOR, page="explanation/integrity.md"),
    "witnesses": Producer("make witnesses", SIMULATOR, page="explanation/faults.md"),
    "autopilots": Producer("python tools/autopilots.py docs/explanation/autopilots.md out/autopilots --flights 3",
                           (*NAVIGATOR, f"{SRC}/live"), page="explanation/autopilots.md"),
    "onboard": Producer("make onboard", (*NAVIGATOR, f"{SRC}/export/onboard"), page="explanation/onboard.md"),
    "validation": Producer("make validate", (*REPLAYS, *SIMULATOR), page="explanation/validation.md"),
}  # fmt: skip
STEP = re.compile(r"([^\[\].]+)|\[([^\]=]+)=([^\]]+)\]|\[(\d+)\]")


def at(printed: Any, path: str) -> Any:
    """The value at a path of a JSON object. LookupError where nothing does."""
    for name, key, value, number in STEP.findall(path):
        if name:
            printed = printed[name]
        elif key:
            printed = next((each for each in printed if each[key] == value), None)
            if printed is None:
                raise LookupError(f"{path}: no {key} is {value}")
        else:
            printed = printed[int(number)]
    return printed


def interval_at(printed: Any, paths: tuple[str, ...]) -> tuple[float, float] | None:
    """The interval at the path of a pair, or at the paths of its two ends."""
    ends = [at(printed, path) for path in paths]
    low, high = ends[0] if len(ends) == 1 else ends or (None, None)
    return None if low is None or high is None else (low, high)
