"""The report's tables of sensors: when each spoke, whether its innovations are as stated, what was not fused."""

from __future__ import annotations

from collections.abc import Sequence

from flownav.core.record import Record
from flownav.report.figure_words import NONE, number
from flownav.report.figures_innovation import SENSOR_TITLES
from flownav.report.series import mapping
from flownav.scoring.by_phase import rejected_mostly_in
from flownav.scoring.consistency import verdict
from flownav.scoring.phases import Phase


def rejected_rows(record: Record, phases: Sequence[Phase] = ()) -> list[tuple[str, str, str, str, str]]:
    """What was not fused, as (sensor, reason, readings, components, phase of most), most components first.

    Records from before readings were counted have components only.
    """
    scores = mapping(record.manifest.get("scores"))
    readings_of = mapping(scores.get("readings"))
    rows = []
    for sensor, reasons in mapping(scores.get("rejected")).items():
        whole = mapping(mapping(readings_of.get(sensor)).get("rejected"))
        rows += [(sensor, reason, whole.get(reason), count) for reason, count in mapping(reasons).items()]
    rows.sort(key=lambda row: -float(row[3]))
    mostly = rejected_mostly_in(record, phases)
    return [
        (SENSOR_TITLES.get(s, s.replace("_", " ")), r.replace("_", " "), NONE if n is None else f"{n:,}", f"{c:,}",
         mostly.get((s, r), NONE))
        for s, r, n, c in rows
    ]  # fmt: skip


def sensor_rows(record: Record) -> list[tuple[str, str, str, str, str]]:
    """Sensors as (name, from and to in seconds, innovations tested, their mean square per component, verdict)."""
    scores = mapping(record.manifest.get("scores"))
    spans, judged = mapping(scores.get("coverage")), mapping(scores.get("consistency"))
    rows = []
    for name in dict.fromkeys([*spans, *judged]):
        span, found = mapping(spans.get(name)), mapping(judged.get(name))
        heard = f"{number(span.get('t0'), 1)} to {number(span.get('t1'), 1)}" if span else NONE
        mean, tested, said = NONE, NONE, ""
        if found:
            mean, tested = number(found.get("nis_per_dof"), 2), f"{found.get('samples') or 0:,}"
            said = verdict(float(found.get("nis_per_dof") or 0.0), white=bool(found.get("white")))
        rows.append((SENSOR_TITLES.get(name, name.replace("_", " ")), heard, tested, mean, said))
    return rows
