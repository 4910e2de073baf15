"""`flownav vehicle`: what a vehicle is in hover, and how a helicopter compares with the paper's linear model."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flownav.cli import options
from flownav.cli.options import VEHICLES, argument
from flownav.cli.output import emit

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from rich.table import Table

    from flownav.vehicle.multirotor_sheet import MultirotorSheet
    from flownav.vehicle.sheet import VehicleSheet

    Array = NDArray[np.float64]


def command(
    file: Annotated[
        str | None,
        argument("VEHICLE", "The vehicle", *VEHICLES, beside="a vehicle's FILE.toml", default="maxi-joker-3"),
    ] = None,
    margins: Annotated[
        bool, typer.Option("--margins", help="Of the autopilot's loops, over the vehicle's uncertainty box.")
    ] = False,
    json_output: options.Json = False,
) -> None:
    """Trim, power, linear models with inflow frozen and re-solved beside the paper's, and ground effect."""
    path = None if file is None else Path(file)
    if margins:
        from flownav.cli.vehicle_margins import show_margins

        show_margins(path, as_json=json_output)
        return
    from flownav.vehicle.multirotor_sheet import MultirotorSheet
    from flownav.vehicle.sheet import as_json, vehicle_sheet

    sheet = vehicle_sheet(path)
    if isinstance(sheet, MultirotorSheet):
        show_multirotor(sheet, json_output=json_output)
        return
    if json_output:
        emit(as_json(sheet))
        return
    from rich.console import Console

    console = Console(markup=False, highlight=False)
    console.print(f"{sheet.name}: hover in still air, out of ground effect", highlight=False)
    for table in tables(sheet):
        console.print(table)


def show_multirotor(sheet: MultirotorSheet, *, json_output: bool) -> None:
    """Hover, forward flight and ground effect of a multirotor."""
    from flownav.vehicle.multirotor_sheet import facts_of, rows_of

    if json_output:
        emit(facts_of(sheet))
        return
    from rich.console import Console

    table = _table(f"{sheet.name}: still air, full battery", ("quantity", "left"), ("value", "right"))
    for name, value in rows_of(sheet):
        table.add_row(re.sub(r", (N|rad/s|m/s|W|A|V|deg)$", r" [\1]", name), value)
    Console(markup=False, highlight=False).print(table)


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
    table = _table("Trim", ("quantity", "left"), ("value", "right"), ("unit", "left"))
    angles = {
        "collective": hover.collective_rad,
        "pedal": hover.pedal_rad,
        "roll": hover.roll_rad,
        "pitch": hover.pitch_rad,
        "flapping back": hover.a1,
        "flapping right": hover.b1,
    }
    for name, angle in angles.items():
        table.add_row(name, f"{math.degrees(angle):.3f}", "deg")
    table.add_row("main rotor thrust", f"{hover.thrust_n:.2f}", "N")
    table.add_row("induced velocity", f"{hover.induced_velocity_m_s:.3f}", "m/s")
    table.add_row("main rotor shaft power", f"{hover.power_w:.0f}", "W")
    table.add_row("tail rotor shaft power", f"{hover.tail_power_w:.0f}", "W")
    return table


def comparison_table(sheet: VehicleSheet) -> Table:
    """Every entry of A_red and B_red, ours with inflow frozen beside the printed one; zero in both is left out."""
    columns = (("entry", "left"), ("frozen", "right"), ("paper", "right"), ("difference", "right"))
    table = _table("Beside the paper's A_red, B_red", *columns, ("re-solved", "right"))
    states, inputs = sheet.paper.states, sheet.paper.inputs
    ours, solved, paper = sheet.frozen, sheet.quasi_steady, sheet.paper
    for letter, across, mine, resolved, printed in (
        ("A", states, ours.a, solved.a, paper.a),
        ("B", inputs, ours.b, solved.b, paper.b),
    ):
        for i, row in enumerate(states):
            for k, column in enumerate(across):
                if max(abs(mine[i, k]), abs(printed[i, k])) < 5e-5:
                    continue
                figures = (mine[i, k], printed[i, k], mine[i, k] - printed[i, k], resolved[i, k])
                table.add_row(f"{letter}({row},{column})", *(_figure(value) for value in figures))
        table.add_section()
    return table


def matrix_table(title: str, rows: Sequence[str], columns: Sequence[str], matrix: Array) -> Table:
    """A matrix with its states and inputs named."""
    table = _table(title, ("row", "left"), *((name, "right") for name in columns))
    for name, row in zip(rows, matrix, strict=True):
        table.add_row(name, *(_figure(value) for value in row))
    return table


def eigenvalue_table(sheet: VehicleSheet) -> Table:
    """The eigenvalues of the three models' A, 1/s."""
    from flownav.vehicle.linearize import eigenvalues

    names = ("frozen", "re-solved", "paper")
    table = _table("Eigenvalues of A, 1/s", *((name, "right") for name in names))
    columns = [eigenvalues(model.a) for model in (sheet.frozen, sheet.quasi_steady, sheet.paper)]
    for values in zip(*columns, strict=True):
        table.add_row(*(_complex_figure(complex(value)) for value in values))
    return table


def ground_effect_table(sheet: VehicleSheet) -> Table:
    """Thrust in ground effect over thrust in free air against hub height."""
    table = _table("Ground effect in hover", ("hub height z/R [-]", "right"), ("T_IGE/T_OGE [-]", "right"))
    for ratio, gain in sheet.ground_effect:
        table.add_row(f"{ratio:g}", f"{gain:.4f}")
    return table


def _table(title: str, *columns: tuple[str, str]) -> Table:
    from rich import box
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD)
    for name, side in columns:
        table.add_column(name, justify="right" if side == "right" else "left")
    return table


def _figure(value: float) -> str:
    """Four decimals, as the paper prints; a zero without a sign."""
    text = f"{value:.4f}"
    return "0" if float(text) == 0.0 else text


def _complex_figure(value: complex) -> str:
    real = _figure(value.real)
    return real if abs(value.imag) < 5e-5 else f"{real} {'+' if value.imag > 0 else '-'} {abs(value.imag):.4f}j"
