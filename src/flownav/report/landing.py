"""The touchdown of a flight in the headline of its report: where it touched and stood, and what that was limited by."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from flownav.report.figure_words import Part, Tile, metres, number
from flownav.report.series import mapping


def landing_sentences(landing: Mapping[str, Any]) -> list[str]:
    """Of `scores.touchdown` as one flight has it; empty where it touched nothing."""
    contact, rest, limited = (mapping(landing.get(name)) for name in ("contact", "rest", "limited_by"))
    said = []
    if contact:
        said.append(
            f"It touched down after {number(contact.get('t_s'), 1)} s, {metres(contact.get('distance_m'))} m from the "
            f"pad's centre, sinking at {number(contact.get('sink_rate_m_s'), 2)} m/s and drifting at "
            f"{number(contact.get('lateral_speed_m_s'), 2)} m/s."
        )
    if limited.get("estimate_m") is not None:
        said.append(
            f"Of that its estimate was off by {metres(limited.get('estimate_m'))} m, its guidance by "
            f"{metres(limited.get('guidance_m'))} m and the pad's place by {metres(limited.get('pad_m'))} m."
        )
    if rest:
        said.append(
            f"It came to rest {metres(rest.get('distance_m'))} m from the centre, {metres(rest.get('slide_m'))} m from "
            "where it touched."
        )
    if landing.get("broken"):
        said.append(f"It crashed: {', '.join(landing['broken'])}.")
    return said


def parts_of(limited: Mapping[str, Any]) -> tuple[Part, ...]:
    """What the touchdown's place was limited by, as bars; they add as vectors. None where it was not scored."""
    sizes = {name: limited.get(f"{name}_m") for name in ("estimate", "guidance", "pad")}
    known = {name: float(size) for name, size in sizes.items() if isinstance(size, (int, float)) and size == size}
    longest = max(known.values(), default=0.0)
    return tuple(Part(name, metres(size), size / longest if longest else 0.0) for name, size in known.items())


def landing_tiles(landing: Mapping[str, Any]) -> list[Tile]:
    """The same as headline figures."""
    contact, rest, limited = (mapping(landing.get(name)) for name in ("contact", "rest", "limited_by"))
    found = []
    if contact:
        when = f"at {number(contact.get('t_s'), 1)} s"
        found.append(Tile("Touchdown off centre", metres(contact.get("distance_m")), "m", when, parts_of(limited)))
        found.append(Tile("Touchdown sink rate", number(contact.get("sink_rate_m_s"), 2), "m/s", when))
    if rest:
        slid = f"slid {metres(rest.get('slide_m'))} m"
        found.append(Tile("At rest off centre", metres(rest.get("distance_m")), "m", slid))
    if landing.get("broken"):
        found.append(Tile("Crashed", "yes", "", ", ".join(landing["broken"])))
    return found
