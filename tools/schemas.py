"""Writes the schemas of files anew from the models that read them, `make schemas`; a test compares them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import core_schema

from flownav.core.schemas import DRAFT

FOLDER = Path(__file__).resolve().parents[1] / "src" / "flownav" / "data" / "schemas"
PROVENANCE = "_value_of"  # of parameter_files.Number: a number may carry its provenance


class WithProvenance(GenerateJsonSchema):
    """Numbers stand bare or as { value = ..., uncertainty = ..., source = ... }."""

    schema_dialect = DRAFT

    def function_before_schema(self, schema: core_schema.BeforeValidatorFunctionSchema) -> JsonSchemaValue:
        """A number's schema, and that of a number with provenance."""
        inner = super().function_before_schema(schema)
        if getattr(schema["function"]["function"], "__name__", "") != PROVENANCE:
            return inner
        rest = {"uncertainty": {"type": ["number", "string"]}, "source": {"type": "string"}}
        table = {"type": "object", "properties": {"value": inner, **rest}, "required": ["value"]}
        return {"anyOf": [inner, {**table, "additionalProperties": False}]}


def generated() -> dict[str, dict[str, Any]]:
    """The schemas by name."""
    from flownav.campaigns.requirement import Requirement
    from flownav.core.record_file import Manifest
    from flownav.navigation.settings import NavigatorSettingsFile
    from flownav.sensors.datasheet import FlowSensor
    from flownav.simulation.scenario import Scenario
    from flownav.vehicle.schema import MultirotorFile, VehicleFile

    models: dict[str, type[BaseModel]] = {
        "file-scenario": Scenario,
        "file-helicopter": VehicleFile,
        "file-multirotor": MultirotorFile,
        "file-sensor": FlowSensor,
        "file-settings": NavigatorSettingsFile,
        "file-requirement": Requirement,
        "record-manifest": Manifest,
    }
    return {name: _of(name, model) for name, model in models.items()}


RANGES = {"ge": "minimum", "le": "maximum", "gt": "exclusiveMinimum", "lt": "exclusiveMaximum"}


def _spelled(node: Any) -> Any:
    """Ranges that pydantic leaves in its own words, beside a choice of types, as JSON Schema has them."""
    if isinstance(node, list):
        return [_spelled(each) for each in node]
    if not isinstance(node, dict):
        return node
    return {RANGES.get(key, key) if "anyOf" in node else key: _spelled(value) for key, value in node.items()}


def _of(name: str, model: type[BaseModel]) -> dict[str, Any]:
    found: dict[str, Any] = _spelled(model.model_json_schema(schema_generator=WithProvenance, mode="validation"))
    if name == "file-requirement":  # conditions name dispersed numbers in tables of their own: wind.speed_20ft_m_s
        found["$defs"]["Conditions"]["additionalProperties"] = True
    if name == "file-scenario":  # vehicle = "quad-450" is short for the section
        found["properties"]["vehicle"] = {"anyOf": [found["properties"]["vehicle"], {"type": "string"}]}
    return {"$schema": DRAFT, "$id": f"urn:flownav:schema:{name}:1", **found}


if __name__ == "__main__":
    for name, schema in generated().items():
        (FOLDER / f"{name}.json").write_text(json.dumps(schema, indent=1) + "\n", encoding="utf-8")
        print(f"{name}.json")
