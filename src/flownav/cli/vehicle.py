"""`flownav vehicle`: a vehicle in hover, a helicopter beside the paper's linear model, the loops' margins."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from flownav.cli import options
from flownav.cli.options import VEHICLES, argument, switch
from flownav.cli.output import answer, plain_look, say, table
from flownav.core.errors import VerdictError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from rich.table import Table

    from flownav.control.margins import Box
    from flownav.vehicle.sheet import VehicleSheet

    Array = NDArray[np.float64]

BESIDE = "a vehicle's FILE.toml, with --margins a RECORD.fnr"
MARGINS = "Of the autopilot's loops, over the vehicle's uncertainty box; of RECORD.fnr, of what it learnt."


def command(
    file: Annotated[
        str | None,
        argument(
            "VEHICLE",
            "The vehicle",
            *VEHICLES,
            beside=BESIDE,
            default="maxi-joker-3",
        ),
    ] = None,
    margins: Annotated[bool, switch(MARGINS, "--margins")] = False,
    json_output: options.Json = False,
) -> None:
    """Trim, power, linear models with inflow frozen and re-solved beside the paper's, and ground effect."""
    path = None if file is None else Path(file)
    if margins:
        show_margins(path, as_json=json_output)
        return
    from flownav.vehicle.sheet import MultirotorSheet, as_json, facts_of, rows_of, vehicle_sheet

    sheet = vehicle_sheet(path)
    if isinstance(sheet, MultirotorSheet):
        rows = [(re.sub(r", (N|rad/s|m/s|W|A|V|deg)$", r" [\1]", name), value) for name, value in rows_of(sheet)]
        title = f"{sheet.name}: still air, full battery"
        answer(facts_of(sheet), json_output, lambda: say(_table(title, ("quantity", "value"), rows)))
    else:
        title = f"{sheet.name}: hover in still air, out of ground effect"
        answer(as_json(sheet), json_output, lambda: say(title, *tables(sheet)))


def tables(sheet: VehicleSheet) -> Iterable[Table]:
    """The sheet as tables for people."""
    yield trim_table(sheet)
    yield comparison_table(sheet)
    for title, model in (("inflow frozen", sheet.frozen), ("inflow re-solved", sheet.quasi_steady)):
        yield matrix_table(f"A, {title}", sheet.paper.states, sheet.paper.states, model.a)
        yield matrix_table(f"B, {title}", sheet.paper.states, sheet.paper.inputs, model.b)
    yield eigenvalue_table(sheet)
    yield ground_effect_table(sheet)


def trim_table(sheet: VehicleSheet) -> Table:
    """Controls, attitude, flapping, inflow and power in hover."""
    hover = sheet.trim
    angles = (
        ("collective", hover.collective_rad), ("pedal", hover.pedal_rad), ("roll", hover.roll_rad),
        ("pitch", hover.pitch_rad), ("flapping back", hover.a1), ("flapping right", hover.b1),
    )  # fmt: skip
    others = (
        ("main rotor thrust", f"{hover.thrust_n:.2f}", "N"),
        ("induced velocity", f"{hover.induced_velocity_m_s:.3f}", "m/s"),
        ("main rotor shaft power", f"{hover.power_w:.0f}", "W"),
        ("tail rotor shaft power", f"{hover.tail_power_w:.0f}", "W"),
    )
    rows = [*((name, f"{math.degrees(angle):.3f}", "deg") for name, angle in angles), *others]
    made = _table("Trim", ("quantity", "value", "unit"), rows)
    made.columns[2].justify = "left"
    return made


def comparison_table(sheet: VehicleSheet) -> Table:
    """Every entry of A_red and B_red, ours with inflow frozen beside the printed one; zero in both is left out."""
    made = _table("Beside the paper's A_red, B_red", ("entry", "frozen", "paper", "difference", "re-solved"))
    ours, solved, paper = sheet.frozen, sheet.quasi_steady, sheet.paper
    for letter, across, mine, resolved, printed in (
        ("A", paper.states, ours.a, solved.a, paper.a),
        ("B", paper.inputs, ours.b, solved.b, paper.b),
    ):
        for (i, row), (k, column) in product(enumerate(paper.states), enumerate(across)):
            if max(abs(mine[i, k]), abs(printed[i, k])) >= 5e-5:
                figures = (mine[i, k], printed[i, k], mine[i, k] - printed[i, k], resolved[i, k])
                made.add_row(f"{letter}({row},{column})", *map(_figure, figures))
        made.add_section()
    return made


def matrix_table(title: str, rows: Sequence[str], columns: Sequence[str], matrix: Array) -> Table:
    """A matrix with its states and inputs named."""
    return _table(
        title, ("row", *columns), ((name, *map(_figure, row)) for name, row in zip(rows, matrix, strict=True))
    )


def eigenvalue_table(sheet: VehicleSheet) -> Table:
    """The eigenvalues of the three models' A, 1/s."""
    from flownav.vehicle.linearize import eigenvalues

    columns = [eigenvalues(model.a) for model in (sheet.frozen, sheet.quasi_steady, sheet.paper)]
    rows = (map(_figure, map(complex, values)) for values in zip(*columns, strict=True))
    return _table("Eigenvalues of A, 1/s", ("frozen", "re-solved", "paper"), map(tuple, rows), left=0)


def ground_effect_table(sheet: VehicleSheet) -> Table:
    """Thrust in ground effect over thrust in free air against hub height."""
    rows = ((f"{ratio:g}", f"{gain:.4f}") for ratio, gain in sheet.ground_effect)
    return _table("Ground effect in hover", ("hub height z/R [-]", "T_IGE/T_OGE [-]"), rows, left=0)


def _table(title: str, heads: Sequence[str], rows: Iterable[Sequence[str]] = (), left: int = 1) -> Table:
    return table(heads, rows, left=left, title=title, title_justify="left", **plain_look())


def _figure(value: complex) -> str:
    """Four decimals, as the paper prints; a zero without a sign; a complex number with its imaginary part."""
    if abs(value.imag) >= 5e-5:
        return f"{_figure(value.real)} {'+' if value.imag > 0 else '-'} {abs(value.imag):.4f}j"
    text = f"{value.real:.4f}"
    return "0" if float(text) == 0.0 else text


def show_margins(file: Path | None, *, as_json: bool) -> None:
    """Print how far each loop of the autopilot is from the edge of stability, over the uncertainty box.

    VerdictError where a loop keeps less than it must.
    """
    from flownav.control.learnt_margins import CROSSED
    from flownav.control.margins import LEAST_GAIN_DB, LEAST_PHASE_DEG, margins_over_box, short_of_margin
    from flownav.vehicle.corners import groups_of
    from flownav.vehicle.kinds import read_vehicle

    recorded = file is not None and file.suffix == ".fnr"
    box = margins_of_flight(file) if file is not None and recorded else margins_over_box(file)
    rows = [{"loop": row.loop, "corner": row.corner, **row.margins.finite()} for row in box.rows]  # null: no edge
    count = len({row.corner for row in box.rows})

    def show() -> None:
        crossed = CROSSED if recorded else groups_of(read_vehicle(file))[0]
        say(margins_table(box), f"{count} corners; signs: {', '.join(crossed)}")

    answer({"margins": rows, "cannot_hover": list(box.cannot_hover)}, as_json, show)
    short = sorted({row.loop for row in box.rows if short_of_margin(row)})
    if short:
        raise VerdictError(f"less than {LEAST_PHASE_DEG:g} deg or {LEAST_GAIN_DB:g} dB at a corner: {', '.join(short)}")
    if box.cannot_hover:
        corners = "; ".join(box.cannot_hover[:3])
        raise VerdictError(f"{len(box.cannot_hover)} corners of the box cannot hover: {corners}")


def margins_of_flight(record: Path) -> Box:
    """The margins of a recorded flight's gains, for the vehicle that it learnt. InputError where it learnt none."""
    from flownav.api.record import load
    from flownav.control.learnt_margins import margins_of_record

    return margins_of_record(load(record).manifest, str(record))


def margins_table(box: Box) -> Table:
    """Each loop as the vehicle's file has it, and at its worst corner."""
    heads = ("loop", "phase [°]", "gain [dB]", "delay [ms]", "least [°]", "least [dB]", "least [ms]", "at")
    found = []
    for loop in dict.fromkeys(row.loop for row in box.rows):
        rows = [row for row in box.rows if row.loop == loop]
        worst = min(rows, key=lambda row: row.margins.phase_deg)
        least = [min(row.margins[i] for row in rows) for i in range(3)]
        found.append((loop, *_margins(rows[0].margins), *_margins(least), _short(worst.corner)))
    title = "Margins of each loop, the others closed: nominal, and the least over the box"
    made = table(heads, found, left=1, fixed=1, title=title, title_justify="left", **plain_look())
    made.columns[-1].justify = "left"
    return made


def _margins(margins: Sequence[float]) -> Iterator[str]:
    """Phase [deg], gain [dB] and delay [ms] of a loop; "any" where none takes it to its edge."""
    for value, scale, form in zip(margins, (1.0, 1.0, 1e3), (".1f", ".1f", ".0f"), strict=True):
        yield f"{scale * value:{form}}" if math.isfinite(value) else "any"


def _short(corner: str) -> str:
    """`mass -, inertia +, ...` of the crossed groups as their signs alone; any other name as it is."""
    from flownav.control.learnt_margins import CROSSED as LEARNT_CROSSED
    from flownav.control.margins import INFLOW_HELD
    from flownav.vehicle.corners import CROSSED, MULTIROTOR_CROSSED

    parts = corner.split(", ")
    held = [parts.pop()] if parts[-1] == INFLOW_HELD else []
    if tuple(part[:-2] for part in parts) in (tuple(CROSSED), tuple(MULTIROTOR_CROSSED), LEARNT_CROSSED):
        parts = [" ".join(part[-1] for part in parts)]
    return ", ".join([*parts, *held])
