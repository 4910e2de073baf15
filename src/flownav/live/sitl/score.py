"""The score of a flight: hover accuracy, error of the estimate while it was sent, and where it landed."""

import math
from typing import Any

import numpy as np

from flownav.core.frames import rotation_from_quaternion
from flownav.core.measurement import Array
from flownav.live.sitl.flight import PILOTS, Flown
from flownav.logs.mavlink.position_messages import local_position_m

GAP_S = 0.3  # a longer one between two estimates is one of sending
WRONG_M = 1.0  # so far off, an estimate is wrong
HIGH_M, TILTED = 0.5, 0.8  # landed is lower than this, and upright: the cosine of its tilt
SETTLED_S = 3.0  # after a change of the estimate in use
NAN = float("nan")


def figures(flown: Flown) -> dict[str, Any]:
    """The figures of a flight, as JSON takes them.

    hover_rms_m: the vehicle's true level distance from where its hover began. error_rms_m: of the estimate in the
    hover, less what it was off when the hover began; error_m, error_down_m: the largest that was sent, less what it was
    when the hover began (GPS's own) or at the last counted reset; without GPS from the start. unsaid_s: how long an
    error beyond WRONG_M was sent without a counted reset. own_rms_m, own_down_rms_m: of the place that the autopilot
    believed in, in the hover. touchdown_m: from the place of take-off. strayed_m: farthest from the path that was
    commanded. silent_s: the longest gap in sending. height_m: of the hover, above the place of take-off; floor_m: see
    `drift_floor_m`.
    """
    facts: dict[str, Any] = {
        "autopilot": flown.order.autopilot, "scenario": flown.order.scenario, **flown.order.case._asdict(),
        "faults": [struck._asdict() for struck in flown.order.struck], "landed": False, "why": flown.why,
    }  # fmt: skip
    truth = _truth(flown)
    hover_s, land_s, end_s = (_mark(flown, name) for name in ("hover", "land", "end"))
    last_s = truth[-1, 0] if len(truth) else NAN
    facts |= _of_live(flown)
    if hover_s != hover_s or len(truth) < 2:
        return facts
    until_s = next(
        (mark.now_s for mark in flown.marks if mark.now_s > hover_s and mark.name in ("square", "land")), last_s
    )
    begin = _at(truth, np.array([hover_s]))[0]
    hovering = truth[(truth[:, 0] >= hover_s) & (truth[:, 0] < until_s)]
    off_m = np.hypot(*(hovering[:, 1:3] - begin[:2]).T)
    at_end = truth[-1]
    height_m = -float(hovering[:, 3].mean()) if len(hovering) else NAN
    landed = flown.landed and -at_end[3] < HIGH_M and at_end[4] > TILTED
    flew = truth[(truth[:, 0] >= hover_s)]
    facts |= {
        "landed": bool(landed),
        "hover_rms_m": _rms(off_m),
        "height_m": height_m,
        "floor_m": drift_floor_m(flown, height_m, until_s - hover_s),
        "strayed_m": _strayed_m(flew[:, 1:3], flown.path_ne_m, begin[:2]),
        "highest_m": float(-flew[:, 3].min()),
        "touchdown_m": float(np.hypot(*at_end[1:3])) if landed else None,
        "flew_s": (land_s if land_s == land_s else last_s) - hover_s,
    }
    facts |= _of_autopilot(flown, truth, hover_s, until_s)
    return facts | _of_estimate(flown, truth, hover_s, until_s, end_s if end_s == end_s else last_s)


def drift_floor_m(flown: Flown, height_m: float, lasts_s: float) -> float:
    """Level drift rms over a hover that the noise of its flow sensor alone integrates to: no estimate without another
    reference is better in the mean of many flights; one flight is off by less or by more.
    """
    pilot = PILOTS[flown.order.autopilot]
    return pilot.flow_sigma_rad_s * height_m * math.sqrt(lasts_s / pilot.flow_hz)


def _of_estimate(flown: Flown, truth: Array, hover_s: float, until_s: float, end_s: float) -> dict[str, Any]:
    """Figures of what was sent, from the hover on."""
    sent = np.array([(t.now_s, *t.pos_ned_m, t.quality, t.resets) for t in flown.history.estimates]).reshape(-1, 6)
    sent = sent[(sent[:, 0] >= hover_s) & (sent[:, 0] <= end_s)]
    placed = sent[np.isfinite(sent[:, 1])]
    if len(placed) < 2:
        return {"sent": len(placed), "silent_s": end_s - hover_s}
    error = placed[:, 1:4] - _at(truth, placed[:, 0]) - _frame(flown)
    spell = np.cumsum(np.diff(placed[:, 5], prepend=placed[0, 5]) != 0.0)
    first = np.searchsorted(spell, spell)  # the first row of the spell since the last counted reset
    moved = error - error[first]
    if flown.order.case.gps == "never":
        moved[spell == 0] = error[spell == 0]
    level_m, down_m = np.hypot(moved[:, 0], moved[:, 1]), np.abs(moved[:, 2])
    hovering = (placed[:, 0] >= hover_s) & (placed[:, 0] < until_s)
    held = error[hovering] - error[hovering][:1]
    gaps = np.diff(np.concatenate([[hover_s], placed[:, 0], [end_s]]))
    return {
        "sent": len(placed),
        "velocity_only": int(len(sent) - len(placed)),
        "error_rms_m": _rms(np.hypot(held[:, 0], held[:, 1])),
        "error_m": float(level_m.max()),
        "error_down_m": float(down_m.max()),
        "unsaid_s": _longest_s(placed[:, 0], np.maximum(level_m, down_m) > WRONG_M, spell),
        "silent_s": float(gaps.max()),
        "silences": int((gaps > GAP_S).sum()),
        "resets": int(spell[-1]),
    }


def _of_autopilot(flown: Flown, truth: Array, hover_s: float, until_s: float) -> dict[str, Any]:
    """Error of the autopilot's own position in the hover, less its error when the hover began."""
    own = np.array([(now_s, *state.pos_ned_m) for now_s, state in flown.history.local]).reshape(-1, 4)
    own = own[(own[:, 0] >= hover_s + SETTLED_S) & (own[:, 0] < until_s)]
    if len(own) < 2:
        return {}
    error = own[:, 1:] - _at(truth, own[:, 0])
    error -= error[0]
    return {"own_rms_m": _rms(np.hypot(error[:, 0], error[:, 1])), "own_down_rms_m": _rms(error[:, 2])}


def _of_live(flown: Flown) -> dict[str, Any]:
    """Figures from the sessions' own summaries."""
    last = flown.lives[-1] if flown.lives else {}
    ran_s, cpu_s = (sum(live[name] for live in flown.lives) for name in ("ran_s", "cpu_s"))
    return {
        "cpu_share": cpu_s / ran_s if ran_s else None,
        "latency_ms": last.get("latency_ms"),
        "withheld": last.get("withheld"),
        "alarms": last.get("alarms"),
    }


def _truth(flown: Flown) -> Array:
    """Rows of our clock [s], north, east, down about the first place [m], and the cosine of the tilt."""
    truths = flown.history.truth
    if not truths:
        return np.zeros((0, 5))
    home = truths[0].state.position_deg_m
    return np.array(
        [
            (
                truth.now_s,
                *_local(truth.state.position_deg_m, home),
                rotation_from_quaternion(*truth.state.quaternion)[8],
            )
            for truth in truths
        ]
    )


def _local(place: tuple[float, float, float], home: tuple[float, float, float]) -> tuple[float, float, float]:
    """North and east of the earth's shape, down the difference of altitudes, as autopilots reckon."""
    north_m, east_m, _ = local_position_m(place, home)
    return north_m, east_m, home[2] - place[2]


def _frame(flown: Flown) -> Array:
    """Where the first true place lies in the frame that is sent in [m]: about the autopilot's origin, or itself."""
    if flown.order.case.gps == "never" or flown.origin_deg_m is None:
        return np.zeros(3)
    return np.array(_local(flown.history.truth[0].state.position_deg_m, flown.origin_deg_m))


def _at(truth: Array, now_s: Array) -> Array:
    return np.column_stack([np.interp(now_s, truth[:, 0], truth[:, column]) for column in (1, 2, 3)])


def _mark(flown: Flown, name: str) -> float:
    return next((mark.now_s for mark in flown.marks if mark.name == name), NAN)


def _rms(values: Array) -> float | None:
    return math.sqrt(float(np.mean(values * values))) if len(values) else None


def _longest_s(now_s: Array, wrong: Array, spell: Array) -> float:
    """The longest time in which every estimate that was sent was wrong, within one spell and without a gap."""
    longest = since = 0.0
    for i in range(len(wrong)):
        follows = i > 0 and wrong[i - 1] and spell[i] == spell[i - 1] and now_s[i] - now_s[i - 1] <= GAP_S
        since = since if follows else now_s[i]
        longest = max(longest, now_s[i] - since) if wrong[i] else longest
    return float(longest)


def _strayed_m(places: Array, path_ne_m: tuple[tuple[float, float], ...], begin: Array) -> float:
    """The largest distance from the commanded path."""
    corners = np.array(path_ne_m) + begin
    starts, ends = corners[:-1], corners[1:]
    if not len(starts):
        return float(np.hypot(*(places - corners[0]).T).max())
    legs = ends - starts
    along = np.einsum("plk,lk->pl", places[:, None, :] - starts, legs) / np.maximum((legs**2).sum(axis=1), 1e-9)
    nearest = starts + np.clip(along, 0.0, 1.0)[..., None] * legs
    return float(np.linalg.norm(places[:, None, :] - nearest, axis=2).min(axis=1).max())
