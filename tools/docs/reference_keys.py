"""The reference of parameter files: every key of every TOML schema, from the models that check the files."""

from __future__ import annotations

import inspect
import re
import types
from typing import Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from units import unit_of

from flownav.campaigns.requirement import Requirement
from flownav.core.parameter_files import ParameterModel
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.sensors.datasheet import FlowSensor
from flownav.sensors.sheets import SensorSheets
from flownav.simulation.dispersion import DispersionFile
from flownav.simulation.scenario import Scenario
from flownav.studies.validation.drawn import ValidationFile
from flownav.vehicle.schema import MultirotorFile, VehicleFile

INTRODUCTION = """# Keys of the parameter files

Every key of every TOML file that flownav reads, printed from the models that check the files. The unit of a number
stands at the end of its key. A number may be written bare, `mass_kg = 8.2`, or with where it comes from:
`mass_kg = { value = 8.2, uncertainty = 0.05, source = "scale" }`. A key that is not listed here is refused, and so is
a value outside its range. A key without a default must be given.
"""
FILES: dict[str, tuple[type[BaseModel], str]] = {
    "Scenario": (Scenario, "A flight: `flownav fly FILE.toml`. [Scenarios](scenarios.md) explains how they work."),
    "Requirement": (
        Requirement,
        "A requirement to certify: `flownav certify FILE.toml`. See [certify](../how-to/certify.md).",
    ),
    "Navigator settings": (
        NavigatorSettingsFile,
        "The filter's models of its sensors: `--settings FILE.toml`. "
        "[The navigator](../explanation/navigator.md) explains each.",
    ),
    "Flow sensor": (
        FlowSensor,
        "A flow sensor as `flownav identify` writes it: `--sensor FILE.toml`. "
        "See [identification](../how-to/identification.md).",
    ),
    "Sensor datasheets": (
        SensorSheets,
        "The other sensors of a simulated vehicle; a scenario names their files under `[sensors]`. "
        "See [sensors and wind](../explanation/sensors.md).",
    ),
    "Helicopter": (
        VehicleFile,
        "A helicopter: `--vehicle FILE.toml`. See [the helicopter](../explanation/vehicle.md).",
    ),
    "Multirotor": (
        MultirotorFile,
        "A multirotor: `--vehicle FILE.toml`. See [the multirotor](../explanation/multirotor.md).",
    ),
    "Dispersion": (
        DispersionFile,
        "The parameters that differ from flight to flight: a scenario's `[dispersion]` names the file.",
    ),
    "Validation": (ValidationFile, "Which recorded flights the simulator is held against: `flownav validate`."),
}
HEADER = "| key | unit | value | range | default | meaning |\n|---|---|---|---|---|---|\n"
BOUNDS = {"ge": "≥ {}", "gt": "> {}", "le": "≤ {}", "lt": "< {}", "min_length": "at least {} entries"}


def page() -> str:
    """The page: a chapter for each kind of file, and in it a table for each table of the file."""
    chapters = [
        f"## {title}\n\n{words}\n\n" + "\n\n".join(_tables(model, "")) for title, (model, words) in FILES.items()
    ]
    return INTRODUCTION + "\n" + "\n\n".join(chapters) + "\n"


def _tables(model: type[BaseModel], where: str) -> list[str]:
    """The table of a model's own keys under its name in the file, then those of the tables in it."""
    rows, below = [], []
    for key, field in model.model_fields.items():
        inner = [found for found in _classes(field.annotation) if issubclass(found, BaseModel)]
        for found in dict.fromkeys(inner):
            below += _tables(found, f"{where}.{key}" if where else key)
        if not inner:
            rows.append(_row(model, key, field))
    heading = f"**`[{where}]`**" if where else "**At the top of the file**"
    words = f" {_sentence(model)}" if where and _sentence(model) else ""
    return ([f"{heading}{words}\n\n{HEADER}" + "\n".join(rows)] if rows else []) + below


def _row(model: type[BaseModel], key: str, field: FieldInfo) -> str:
    """One key's row."""
    default = "" if field.is_required() else f"`{_shown(field.get_default(call_default_factory=True))}`"
    cells = (f"`{key}`", unit_of(key), _kind(field.annotation), _range(field), default, _meaning(model, key, field))
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _shown(default: Any) -> str:
    """A default as it would be written in the file; "none" where the key has no effect unless it is given."""
    if default is None:
        return "none"
    if isinstance(default, bool):
        return str(default).lower()
    return f"{default:g}" if isinstance(default, float) else str(default)


def _kind(annotation: Any) -> str:
    """The values that a field takes: a number, text, one of some words, a list."""
    origin, inner = get_origin(annotation), get_args(annotation)
    if origin is Literal:
        return " or ".join(f"`{value}`" for value in inner)
    if origin in (Union, types.UnionType):
        return " or ".join(dict.fromkeys(_kind(part) for part in inner if part is not types.NoneType))
    if origin in (tuple, list):
        return f"list of {_kind(inner[0])}"
    if origin is dict:
        return f"table of {_kind(inner[1])}"
    if origin is not None and inner:  # Annotated
        return _kind(inner[0])
    return {float: "number", int: "whole number", str: "text", bool: "true or false"}.get(annotation, "value")


def _range(field: FieldInfo) -> str:
    """The bounds of a number, in mathematical signs."""
    found = []
    for bound in field.metadata:
        for name, words in BOUNDS.items():
            if (limit := getattr(bound, name, None)) is not None:
                found.append(words.format(f"{limit:g}"))
    return ", ".join(found)


def _meaning(model: type[BaseModel], key: str, field: FieldInfo) -> str:
    """A key's description; where it has none, the comment beside it, or what the docstring says after `key:`."""
    if field.description:
        return field.description
    for owner in model.__mro__:
        if issubclass(owner, ParameterModel) and key in inspect.get_annotations(owner):
            beside = re.search(rf"^    {key}: [^\n]*?  # (.+)$", inspect.getsource(owner), re.MULTILINE)
            told = re.search(rf"\b{key}: (.+?)(?=;|\.\s|\.$|\n\n|$)", inspect.getdoc(owner) or "", re.DOTALL)
            found = beside or told
            return " ".join(found[1].split()) if found else ""
    return ""


def _sentence(model: type[BaseModel]) -> str:
    """The first line of a model's docstring."""
    return (inspect.getdoc(model) or "").split("\n", 1)[0]


def _classes(annotation: Any) -> list[type]:
    """Every class that an annotation names."""
    inner = [found for part in get_args(annotation) for found in _classes(part)]
    return inner or ([annotation] if isinstance(annotation, type) else [])
