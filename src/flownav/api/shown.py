"""How a record shows itself: two lines on a terminal, a small table in a notebook."""

from __future__ import annotations

from html import escape
from typing import Any

from flownav.core.record import Record


def lines_of(record: Record) -> list[str]:
    """What flew and how it went; what the record holds."""
    names, rows = list(record.tables), len(next(iter(record.tables.values()), {}).get("t_s", ()))
    some = f" ({', '.join(names[:5])}{', ...' if len(names) > 5 else ''})" if names else ""
    return [
        f"<Record {what_of(record)}: {headline_of(record) or 'not scored'};",
        f" {len(names)} tables{some}, {rows} rows in the first>",
    ]


def what_of(record: Record) -> str:
    """What flew, with which filter, how long."""
    facts = record.manifest
    source = facts.get("scenario") or facts.get("log") or facts.get("kind") or "nothing"
    seed = f", seed {facts['seed']} flight {facts.get('flight', 0)}" if "seed" in facts else ""
    cut = (facts.get("parameters") or {}).get("gps_outages_s") or []
    outages = f", GPS cut {len(cut)} time{'s' * (len(cut) != 1)}" if cut else ""
    lasts = f", {float(facts['duration_s']):.1f} s" if facts.get("duration_s") is not None else ""
    return f"{facts.get('kind', '?')} {source}{seed}, filter {facts.get('filter', '?')}{outages}{lasts}"


def headline_of(record: Record) -> str:
    """The score that matters most of this kind of record; "" where it has none."""
    scores = record.manifest.get("scores") or {}
    covered = record.manifest.get("covered_fraction", 1.0)
    thin = f" (the estimate covers {100.0 * covered:.0f} %)" if covered < 0.99 else ""
    touchdown = scores.get("touchdown")
    if thin:
        largest = scores.get("max_position_error_m")
        return (f"largest error of one axis {largest:.3f} m" if largest is not None else "scored in part") + thin
    if touchdown:
        end = touchdown.get("rest") or touchdown.get("contact") or {}
        away = end.get("distance_m")
        return f"{touchdown['verdict']}" + (f", {away:.3f} m from the pad's centre" if away is not None else "")
    if scores.get("max_position_error_m") is not None:
        return f"largest error of one axis {scores['max_position_error_m']:.3f} m"
    if scores.get("outages"):
        found = [cut["horizontal_rms_m"] for cut in scores["outages"] if cut["horizontal_rms_m"] is not None]
        if found:
            return f"without GPS at most {max(found):.2f} m rms horizontally"
    if scores.get("truth"):
        return f"{scores['truth']['horizontal_rms_m']:.2f} m rms horizontally against {scores['truth']['reference']}"
    if scores.get("velocity_rms_m_s") is not None:
        return f"velocity {scores['velocity_rms_m_s']:.3f} m/s rms against GPS"
    return ""


def html_of(record: Record) -> str:
    """A table of facts and one of the record's tables; every text is escaped."""
    facts: list[tuple[str, Any]] = [("flight", what_of(record)), ("result", headline_of(record) or "not scored")]
    verdict = getattr(record, "verdict", "")
    facts += [("verdict", verdict)] if verdict else []
    facts += [("command", _words(record.manifest["command"]))] if record.manifest.get("command") else []
    head = "".join(
        f"<tr><th>{escape(name)}</th><td colspan='2'>{escape(str(value))}</td></tr>" for name, value in facts
    )
    rows = "".join(
        f"<tr><td>{escape(name)}</td><td>{len(table.get('t_s', ()))}</td><td>{escape(_columns(table))}</td></tr>"
        for name, table in record.tables.items()
    )
    return f"<table>{head}<tr><th>table</th><th>rows</th><th>columns</th></tr>{rows}</table>"


def _words(command: Any) -> str:
    return " ".join(map(str, command)) if isinstance(command, list | tuple) else str(command)


def _columns(table: dict[str, Any]) -> str:
    names = [name for name in table if name != "t_s"]
    return ", ".join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "")
