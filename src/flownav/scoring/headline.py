"""A flight in one sentence: how it ended, in what wind, how far off its navigation was."""

from collections.abc import Mapping
from typing import Any

from flownav.core.record import mapping
from flownav.scoring.landings import BESIDE_PAD, NEVER_LANDED, WENT_AROUND

WITH_GPS = (  # beside errors against a truth, of an estimate that follows GPS
    "With GPS these show how far the receiver's own slow error carried the estimate, not what flow is worth: that is "
    "the drift while GPS is cut"
)
HOW = {"landed": "Landed", BESIDE_PAD: "Landed beside the pad,"}  # the outcomes of a flight that came to rest


def length(metres: float) -> str:
    """A distance [m] as text, in cm or m.

    Example:
        >>> length(0.0231), length(0.46), length(3.479)
        ('2.3 cm', '46 cm', '3.48 m')
    """
    if metres >= 0.995:
        return f"{metres:.2f} m"
    return f"{100.0 * metres:.1f} cm" if metres < 0.0995 else f"{100.0 * metres:.0f} cm"


def sentence(manifest: Mapping[str, Any], scores: Mapping[str, Any]) -> str:
    """How one simulated flight, or many, ended; "" where the scores do not hold it.

    manifest: of a record; scores: of the flight, or of many flights beside it, as `flownav fly --json` has them.
    """
    landing = mapping(scores.get("touchdown"))
    many = isinstance(landing.get("success"), Mapping)
    how = _many(landing, scores) if many else _one(landing)
    errors = "; ".join(_errors(scores))
    if not how and not errors:
        return ""
    how = how or "Flew"
    return f"{how}{_wind(manifest, drawn=not many)}{f'. Navigation error in flight: {errors}' if errors else ''}."


def _one(landing: Mapping[str, Any]) -> str:
    """How one flight ended; "" of one that was not to land."""
    ends = (mapping(landing.get(name)).get("distance_m") for name in ("rest", "contact"))
    away = next((f"{length(end)} from the pad's centre" for end in ends if end is not None), "")
    verdict, times = landing.get("verdict"), landing.get("go_arounds") or 0
    if landing.get("broken"):
        return f"Crashed ({', '.join(landing['broken'])}){f', {away}' if away else ''}"
    if verdict in (NEVER_LANDED, WENT_AROUND):
        return f"{str(verdict).capitalize()}{': ' + landing['reason'] if landing.get('reason') else ''}"
    if not away:
        return ""
    again = f" after {times} go-around{'s' * (times > 1)}" if times else ""
    how = HOW.get(str(verdict), "Touched, and not at rest when the flight ended,")
    return f"{how} {away}{again}"


def _many(landing: Mapping[str, Any], scores: Mapping[str, Any]) -> str:
    """How many of the flights landed, and within what."""
    landed, flights = scores.get("landed"), scores.get("flights")
    rest = mapping(landing.get("rest"))
    r95_m, median_m = rest.get("r95_m"), mapping(rest.get("distance_m")).get("median")
    bounded = None not in (rest.get("r95_interval_m") or [None])
    within = f", 95 % of them all within {length(r95_m)} of the pad's centre" if bounded and r95_m is not None else ""
    within = within or (f", the median {length(median_m)} from the pad's centre" if median_m is not None else "")
    return f"{landed} of {flights} flights landed{within}"


def _wind(manifest: Mapping[str, Any], *, drawn: bool) -> str:
    """The wind of the scenario, or of one flight as it was drawn, as words to follow."""
    parameters = mapping(manifest.get("parameters"))
    stated = mapping(mapping(parameters.get("scenario")).get("wind")).get("speed_20ft_m_s")
    own = mapping(parameters.get("drawn")) if drawn else {}
    speed = own.get("wind.speed_20ft_m_s", stated)
    return f" in {speed:.2g} m/s of wind" if speed else " in calm air" if speed == 0.0 else ""


def _errors(scores: Mapping[str, Any]) -> list[str]:
    """Root mean square of the position's error along three axes, and of the heading's."""
    states = mapping(scores.get("states"))
    axes = [_figure(mapping(states.get(axis)).get("rms_error")) for axis in "xyz"]
    heading = _figure(mapping(mapping(scores.get("attitude_deg")).get("yaw")).get("rms_error"))
    parts = [f"{length(sum(axis**2 for axis in axes if axis is not None) ** 0.5)} rms"] if None not in axes else []
    return [*parts, *([f"heading {heading:.1f} deg"] if heading is not None else [])]


def _figure(value: Any) -> float | None:
    """A figure of one flight, or the median of many."""
    found = value.get("median") if isinstance(value, Mapping) else value
    return float(found) if isinstance(found, int | float) else None
