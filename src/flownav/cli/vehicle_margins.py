"""`flownav vehicle --margins`: how far each loop of the autopilot is from the edge of stability."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flownav.cli.output import emit
from flownav.core.errors import VerdictError

if TYPE_CHECKING:
    from rich.table import Table

    from flownav.control.margins import Box


def show_margins(file: Path | None, *, as_json: bool) -> None:
    """Print the margins over the uncertainty box. VerdictError where a loop keeps less than it must."""
    from flownav.control.margins import LEAST_GAIN_DB, LEAST_PHASE_DEG, margins_over_box, short_of_margin

    box = margins_over_box(file)
    if as_json:
        emit(facts(box))
    else:
        from rich.console import Console

        from flownav.vehicle.corners import groups_of
        from flownav.vehicle.kinds import read_vehicle

        console = Console(markup=False, highlight=False)
        console.print(table(box))
        count = len({row.corner for row in box.rows})
        console.print(f"{count} corners; signs: {', '.join(groups_of(read_vehicle(file))[0])}", highlight=False)
    short = sorted({row.loop for row in box.rows if short_of_margin(row)})
    if short:
        raise VerdictError(f"less than {LEAST_PHASE_DEG:g} deg or {LEAST_GAIN_DB:g} dB at a corner: {', '.join(short)}")
    if box.cannot_hover:
        raise VerdictError(
            f"{len(box.cannot_hover)} corners of the box cannot hover: {'; '.join(box.cannot_hover[:3])}"
        )


def facts(box: Box) -> dict[str, Any]:
    """Margins as JSON; null where no phase, gain or delay takes the loop to its edge."""
    rows = [{"loop": row.loop, "corner": row.corner, **row.margins.finite()} for row in box.rows]
    return {"margins": rows, "cannot_hover": list(box.cannot_hover)}


def table(box: Box) -> Table:
    """Each loop as the vehicle's file has it, and at its worst corner."""
    from rich import box as boxes
    from rich.table import Table

    found = Table(
        title="Margins of each loop, the others closed: nominal, and the least over the box",
        title_justify="left",
        box=boxes.SIMPLE_HEAD,
    )
    found.add_column("loop", no_wrap=True)
    for name in ("phase [°]", "gain [dB]", "delay [ms]", "least [°]", "least [dB]", "least [ms]", "at"):
        found.add_column(name, justify="left" if name == "at" else "right")
    for loop in dict.fromkeys(row.loop for row in box.rows):
        rows = [row for row in box.rows if row.loop == loop]
        worst = min(rows, key=lambda row: row.margins.phase_deg)
        least = [min(row.margins[i] for row in rows) for i in range(3)]
        found.add_row(loop, *_figures(rows[0].margins), *_figures(least), _short(worst.corner))
    return found


def _figures(margins: Any) -> tuple[str, str, str]:
    phase, gain, delay = margins
    return _figure(phase), _figure(gain), _figure(1e3 * delay, ".0f")


def _figure(value: float, form: str = ".1f") -> str:
    return f"{value:{form}}" if math.isfinite(value) else "any"


def _short(corner: str) -> str:
    """`mass -, inertia +, ...` of the crossed groups as their signs alone; any other name as it is."""
    from flownav.control.margins import INFLOW_HELD
    from flownav.vehicle.corners import CROSSED, MULTIROTOR_CROSSED

    parts = corner.split(", ")
    held = [parts.pop()] if parts[-1] == INFLOW_HELD else []
    if [part[:-2] for part in parts] in (list(CROSSED), list(MULTIROTOR_CROSSED)):
        parts = [" ".join(part[-1] for part in parts)]
    return ", ".join([*parts, *held])
