"""Touchdowns and take-offs as `flownav fly`, `flownav accuracy` and the report print them: of one flight, and of many.

Of many flights R95 is the radius about the pad's centre that 95 % of all flights that were to land do not exceed; one
that crashed, never touched or never came to rest is infinitely far off. What limits the touchdown is the 95th
percentile of each part's length over the flights that touched.
"""

from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Array
from flownav.core.text import finite_or_none
from flownav.scoring.percentiles import percentile_with_interval, share_with_interval, spread
from flownav.scoring.touchdown import CONTACT, LIMITED_BY, REST, TOUCHDOWN_COLUMNS, names_of

R_SHARE = 0.95
NEVER_LANDED = "never landed"  # the verdict of one flight that was to land and never touched
WENT_AROUND = "went around"  # of one that broke its landing off and is aloft at the end
BESIDE_PAD = "beside the pad"  # of one that stands elsewhere than on the pad that its camera was to find
AT_GATE_M = 0.35  # so near a gate's height a vehicle waits there: a search stays up to 0.3 m above its own
CONFIDENCE = 0.95
EXPECTED, BROKEN, GO_AROUNDS, ALOFT, BESIDE = (
    TOUCHDOWN_COLUMNS.index(name) for name in ("expected", "broken", "go_arounds", "aloft", "beside")
)


def column_of(group: str, name: str) -> int:
    """The place of one figure in a row."""
    return TOUCHDOWN_COLUMNS.index(f"{group}.{name}")


CONTACT_DISTANCE, REST_DISTANCE = column_of("contact", "distance_m"), column_of("rest", "distance_m")


def crashed(rows: Array) -> NDArray[np.bool_]:
    """Which flights crashed; rows (flights, len(TOUCHDOWN_COLUMNS))."""
    return np.asarray(rows[:, BROKEN] > 0.0)


def succeeded(rows: Array) -> NDArray[np.bool_]:
    """Which flights that were to land came to rest with no limit broken, on the pad where a camera was to find one."""
    rests = np.isfinite(rows[:, REST_DISTANCE]) & ~(rows[:, BESIDE] > 0.0)
    return np.asarray((rows[:, EXPECTED] > 0.0) & rests & ~crashed(rows))


def touchdown_of_flight(row: Array) -> dict[str, Any] | None:
    """The values of one flight; None where it was not to land, touched nothing, broke nothing and did not go around.

    Of a flight that never landed, or is aloft after a go-around, contact and rest are groups of nulls; otherwise what
    did not happen is null.
    """
    broken, touched = names_of(row[BROKEN]), bool(np.isfinite(row[CONTACT_DISTANCE]))
    if not row[EXPECTED] and not touched and not broken and not row[ALOFT]:
        return None
    groups: dict[str, Any] = {
        group: {name: finite_or_none(row[column_of(group, name)]) for name in names}
        for group, names in (("contact", CONTACT), ("rest", REST), ("limited_by", LIMITED_BY))
    }
    landed, times, verdict = bool(succeeded(row[None, :])[0]), int(row[GO_AROUNDS]), verdict_of(row)
    verdict = NEVER_LANDED if verdict == "unfinished" and not touched else verdict
    for group, figures in groups.items():
        nothing = all(figure is None for figure in figures.values())
        aloft = verdict in (NEVER_LANDED, WENT_AROUND) and group != "limited_by"
        groups[group] = None if nothing and not aloft else figures
    return groups | {"success": landed, "broken": broken, "go_arounds": times, "verdict": verdict}


def with_reason(scores: dict[str, Any], height_m: float, facts: Mapping[str, Any]) -> dict[str, Any]:
    """A flight's scores in which a landing that never came has its reason.

    height_m: of the skids over the ground at the end; facts: the gates in the flight's judging facts.
    """
    landing = scores["touchdown"]
    if landing is None or landing["verdict"] not in (NEVER_LANDED, WENT_AROUND):
        return scores
    where = f"{height_m:.2f} m over the ground when the flight ends"
    for name, words in (("search_height_m", "looks for its pad from"), ("align_height_m", "waits at the gate of")):
        gate_m = float(facts.get(name, 0.0))
        if gate_m > 0.0 and abs(height_m - gate_m) < AT_GATE_M:
            where = f"{words} {gate_m:g} m, {where}"
    times = landing["go_arounds"]
    often = f"broke its landing off {times} time{'s' * (times > 1)}, " if landing["verdict"] == WENT_AROUND else ""
    return scores | {"touchdown": landing | {"reason": often + where}}


def touchdown_of_flights(rows: Array) -> dict[str, Any] | None:
    """Radius, spread and success of many flights; None where none was to land and none touched or broke anything."""
    touched = np.isfinite(rows[:, CONTACT_DISTANCE])
    if not (rows[:, EXPECTED] > 0.0).any() and not (touched | crashed(rows)).any():
        return None
    broken = Counter(name for bits in rows[:, BROKEN] for name in names_of(bits))
    limits = {name: _largest(rows[touched, column_of("limited_by", name)]) for name in LIMITED_BY}
    return {
        "contact": radius(rows, CONTACT_DISTANCE) | _spreads(rows, "contact", CONTACT),
        "rest": radius(rows, REST_DISTANCE) | _spreads(rows, "rest", REST),
        "success": success(rows),
        "limited_by": limits,
        "broken": dict(broken),
        "unfinished": unfinished(rows),
        "went_around": went_around(rows),
        "verdicts": dict(Counter(verdict_of(row) for row in rows)),
    }


def touches_of_flights(rows: Array, touchdown: Mapping[str, Any]) -> dict[str, Any]:
    """Where many flights touched [m] from the pad's centre, those that did, and their radius from `touchdown`.

    rows (flights, len(TOUCHDOWN_COLUMNS)).
    """
    touched = rows[np.isfinite(rows[:, CONTACT_DISTANCE])]
    places = {name: touched[:, column_of("contact", name)].tolist() for name in ("north_m", "east_m")}
    return {"flights": len(rows), "r95_m": touchdown["contact"]["r95_m"], **places}


def verdict_of(row: Array) -> str:
    """The outcome of a flight: landed, crashed, at rest beside the pad, went around (and is aloft at the end), or none
    of these.
    """
    if row[BROKEN] > 0.0:
        return "crashed"
    if succeeded(row[None, :])[0]:
        return "landed"
    if row[BESIDE] > 0.0:
        return BESIDE_PAD
    return WENT_AROUND if row[ALOFT] > 0.0 else "unfinished"


def went_around(rows: Array) -> dict[str, int]:
    """How many flights broke a landing off at least once, and how many of these landed after all."""
    around = rows[:, GO_AROUNDS] > 0.0
    return {"flights": int(around.sum()), "landed": int((around & succeeded(rows)).sum())}


def unfinished(rows: Array) -> dict[str, int]:
    """How many flights broke nothing, did not go around for good, and yet did not land: the time was too short."""
    whole = (rows[:, EXPECTED] > 0.0) & ~crashed(rows) & ~(rows[:, ALOFT] > 0.0)
    touched, rests = np.isfinite(rows[:, CONTACT_DISTANCE]), np.isfinite(rows[:, REST_DISTANCE])
    return {"never touched": int((whole & ~touched).sum()), "never at rest": int((whole & touched & ~rests).sum())}


def radius(rows: Array, distance: int) -> dict[str, Any]:
    """R95 and its 95 % interval [m]; null where it is infinite."""
    away = np.where(np.isfinite(rows[:, distance]) & ~crashed(rows), rows[:, distance], np.inf)
    value, low, high = percentile_with_interval(away, R_SHARE)
    return {"r95_m": finite_or_none(value), "r95_interval_m": [finite_or_none(low), finite_or_none(high)]}


def success(rows: Array) -> dict[str, float]:
    """Share of the flights that landed, and its 95 % interval."""
    rate, low, high = share_with_interval(int(succeeded(rows).sum()), len(rows), CONFIDENCE)
    return {"rate": rate, "low": low, "high": high}


def _spreads(rows: Array, group: str, names: tuple[str, ...]) -> dict[str, Any]:
    return {name: spread(rows[:, column_of(group, name)]) for name in names}


def _largest(values: Array) -> float | None:
    return finite_or_none(percentile_with_interval(values, R_SHARE)[0]) if len(values) else None


# -- take-offs ---------------------------------------------------------------------------------------------------
TAKEOFF_COLUMNS = ("over_commanded_m", "without_flow_s")
UP_SHARE = 0.5  # of the largest commanded height: above it a vehicle is up, and its flow is to be seen


def takeoffs(height_m: Array, commanded_m: Array, sees_flow: Array, period_s: float) -> Array:
    """One row a flight, (lanes, len(TAKEOFF_COLUMNS)), of histories (epochs, lanes); heights are of the skids.

    over_commanded_m: the largest height less the largest commanded one; without_flow_s: how long the flow sensor gave
    no flow (sees_flow 0) while the vehicle was above UP_SHARE of the largest commanded height.
    """
    top_m = commanded_m.max(axis=0)
    blind = (height_m > UP_SHARE * top_m) & (sees_flow <= 0.0)
    return np.column_stack([height_m.max(axis=0) - top_m, period_s * blind.sum(axis=0)])


def takeoff_of_flight(row: Array) -> dict[str, float]:
    """One flight's row as the JSON of `flownav fly`."""
    return dict(zip(TAKEOFF_COLUMNS, map(float, row), strict=True))


def takeoff_of_flights(rows: Array) -> dict[str, Any]:
    """Many flights' rows: each number's median, 5th and 95th percentile and the worst; and how many lost the flow."""
    figures: dict[str, Any] = {
        name: {**(spread(rows[:, i]) or {}), "worst": float(rows[:, i].max())} for i, name in enumerate(TAKEOFF_COLUMNS)
    }
    return figures | {"lost_flow": int((rows[:, TAKEOFF_COLUMNS.index("without_flow_s")] > 0.0).sum())}
