"""The reduced model that the paper prints: A_red, B_red, R and Q (equations 18-23), verbatim."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator

from flownav.core.parameter_files import Number, ParameterModel, load, shipped

SHIPPED_MODEL = "paper_reduced_model.toml"

Array = NDArray[np.float64]
Row4 = tuple[float, float, float, float]
Row6 = tuple[float, float, float, float, float, float]


class ReducedModelFile(ParameterModel):
    """The file of a six-state, four-input model, schema 1."""

    schema_version: Literal[1]
    source: str
    update_rate_hz: Number = Field(gt=0.1, lt=10000.0)
    states: tuple[str, str, str, str, str, str]
    inputs: tuple[str, str, str, str]
    A: tuple[Row6, Row6, Row6, Row6, Row6, Row6]
    B: tuple[Row4, Row4, Row4, Row4, Row4, Row4]
    measurement_variance: Row6
    process_variance: Row6

    @field_validator("measurement_variance", "process_variance")
    @classmethod
    def _positive(cls, variances: Row6) -> Row6:
        if min(variances) < 0.0:
            raise ValueError("variances should not be negative")
        return variances


class ReducedModel(NamedTuple):
    """ẋ = A·x + B·u with x = (x, y, z [m, earth], u, v, w [m/s, body]) and u = (lon, lat, col, ped) [rad from trim].

    a (6, 6) and b (6, 4) continuous [1/s]; r (6, 6) and q (6, 6) covariances at each update of the filter.
    """

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    a: Array
    b: Array
    r: Array
    q: Array
    update_rate_hz: float


def load_paper_model(path: Path | None = None) -> ReducedModel:
    """The paper's model, or one of the same form from a file. InputError names file, key and what is allowed."""
    file = load(path or shipped(SHIPPED_MODEL), ReducedModelFile)
    return ReducedModel(
        states=file.states,
        inputs=file.inputs,
        a=np.array(file.A),
        b=np.array(file.B),
        r=np.diag(file.measurement_variance),
        q=np.diag(file.process_variance),
        update_rate_hz=file.update_rate_hz,
    )
