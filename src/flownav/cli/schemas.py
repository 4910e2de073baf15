"""The published JSON schemas: of commands' `--json` objects, of files (TOML), and of a record's manifest.

Those of files and of the manifest are made from the models that read them. Those of commands are data
(`data/schemas/commands.json`), in short: a string is a type (`number|string`, with `?` where null is allowed too) or
`#` and the name of a part that several share. `$id` has a schema's name and number; the number stands in every object
as `schema`. `flownav schema NAME` prints one.
"""

from __future__ import annotations

import json
from functools import cache
from importlib import import_module, resources
from typing import Any

from flownav.core.errors import InputError

DRAFT = "https://json-schema.org/draft/2020-12/schema"
COMMANDS = resources.files("flownav") / "data" / "schemas" / "commands.json"
SHARED = "shared"  # the parts that several commands' schemas have in common
MODELS = {
    "file-helicopter": ("flownav.vehicle.schema", "VehicleFile"),
    "file-multirotor": ("flownav.vehicle.schema", "MultirotorFile"),
    "file-requirement": ("flownav.campaigns.requirement", "Requirement"),
    "file-scenario": ("flownav.simulation.scenario", "Scenario"),
    "file-sensor": ("flownav.sensors.datasheet", "FlowSensor"),
    "file-settings": ("flownav.navigation.settings", "NavigatorSettingsFile"),
    "record-manifest": ("flownav.core.record_file", "Manifest"),
}
PROVENANCE = "_value_of"  # of parameter_files.Number: a number may carry its provenance
RANGES = {"ge": "minimum", "le": "maximum", "gt": "exclusiveMinimum", "lt": "exclusiveMaximum"}


def names() -> list[str]:
    """The published schemas."""
    return sorted([*(_commands().keys() - {SHARED}), *MODELS])


def id_of(name: str) -> str:
    """The `$id` of a schema: its name and its number."""
    return f"urn:flownav:schema:{name}:1"


def title_of(name: str) -> str:
    """The title of a schema, without building those of models. InputError where there is no such schema."""
    return MODELS[name][1] if name in MODELS else str(schema_of(name)["title"])


def schema_of(name: str) -> dict[str, Any]:
    """A schema by its name. InputError where there is none."""
    if name not in names():
        raise InputError(f"{name}: no such schema; choose from {', '.join(names())}")
    about = {"$schema": DRAFT, "$id": id_of(name)}
    return about | (_of_model(name) if name in MODELS else _in_full(_commands()[name], _commands()[SHARED]))


# -- of commands ------------------------------------------------------------------------------------------------
@cache
def _commands() -> dict[str, Any]:
    found = json.loads(COMMANDS.read_text(encoding="utf-8"))
    assert isinstance(found, dict)
    return found


def _in_full(node: Any, shared: dict[str, Any]) -> dict[str, Any]:
    """A node of `commands.json` as JSON Schema has it."""
    if isinstance(node, str):
        return _in_full(shared[node[1:]], shared) if node.startswith("#") else {"type": _types(node)}
    return {key: _keyword(key, value, shared) for key, value in node.items()}


def _keyword(key: str, value: Any, shared: dict[str, Any]) -> Any:
    if key == "type":
        return _types(value)
    if key == "properties":
        return {name: _in_full(inner, shared) for name, inner in value.items()}
    if key in ("items", "additionalProperties") and not isinstance(value, bool):
        return _in_full(value, shared)
    return value


def _types(text: str) -> str | list[str]:
    """`number?` is a number or null; one type alone stands without a list."""
    kinds = sorted(text.removesuffix("?").split("|") + ["null"] * text.endswith("?"))
    return kinds if len(kinds) > 1 else kinds[0]


# -- of models --------------------------------------------------------------------------------------------------
def _of_model(name: str) -> dict[str, Any]:
    """The schema of a file from the model that reads it."""
    module, model = MODELS[name]
    schema = getattr(import_module(module), model).model_json_schema(
        schema_generator=_with_provenance(), mode="validation"
    )
    found: dict[str, Any] = _in_its_words(schema)
    if name == "file-requirement":  # conditions name dispersed numbers in tables of their own: wind.speed_20ft_m_s
        found["$defs"]["Conditions"]["additionalProperties"] = True
    if name == "file-scenario":  # vehicle = "quad-450" is short for the section
        found["properties"]["vehicle"] = {"anyOf": [found["properties"]["vehicle"], {"type": "string"}]}
    return found


def _with_provenance() -> Any:
    """Pydantic's generator, for which numbers stand bare or as { value = ..., uncertainty = ..., source = ... }."""
    from pydantic.json_schema import GenerateJsonSchema

    class WithProvenance(GenerateJsonSchema):
        schema_dialect = DRAFT

        def function_before_schema(self, schema: Any) -> dict[str, Any]:
            """A number's schema, and that of a number with provenance."""
            inner = super().function_before_schema(schema)
            if getattr(schema["function"]["function"], "__name__", "") != PROVENANCE:
                return inner
            rest = {"uncertainty": {"type": ["number", "string"]}, "source": {"type": "string"}}
            table = {"type": "object", "properties": {"value": inner, **rest}, "required": ["value"]}
            return {"anyOf": [inner, {**table, "additionalProperties": False}]}

    return WithProvenance


def _in_its_words(node: Any) -> Any:
    """Ranges that pydantic leaves in its own words, next to a choice of types, as JSON Schema has them."""
    if isinstance(node, list):
        return [_in_its_words(each) for each in node]
    if not isinstance(node, dict):
        return node
    return {RANGES.get(key, key) if "anyOf" in node else key: _in_its_words(value) for key, value in node.items()}
