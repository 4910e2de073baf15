"""What the paper printed: Tables 1 to 3, figures of its text, its inconsistencies, and the landings it compares with.

Tables 5 and 6 are `scoring.paper_tables`.
"""

from __future__ import annotations

import csv
import math
from typing import NamedTuple

from flownav.core.parameter_files import shipped
from flownav.sensors.datasheet import IdentifiedModel

HEIGHTS_M = (0.6, 0.8, 1.0, 1.5)
MODELS = 7
RELATION_FITS = {
    0.6: 87.0,
    0.8: 78.0,
    1.0: 72.0,
    1.5: 57.0,
}  # section III.E, the four relations (model 2 of each height)
SELECTED = (0.6, 2)  # "natural frequency 13.8528 rad/s": Table 1, 60 cm, model 2
LARGEST_CLAIM_M = 0.27


class ErrorRow(NamedTuple):
    """A row of Table 2 (or, with model 0, of Table 3): mean and standard deviation of the error [m/s]."""

    height_m: float
    model: int
    mean_error: float
    std_error: float


class Inconsistency(NamedTuple):
    """Where the paper contradicts itself or cannot be meant: what is printed, and the reading used here."""

    number: int
    where: str
    printed: str
    reading: str


class LandingSystem(NamedTuple):
    """A landing of another system that the paper compares itself with."""

    system: str
    reference: str
    figure_cm: float
    printed: str
    measures: str
    kind: str
    elsewhere: str


def _rows(name: str) -> list[dict[str, str]]:
    with shipped(name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def table_1() -> list[IdentifiedModel]:
    """The 28 identified models a/(s^2 + b s + c)."""
    return [
        IdentifiedModel(
            height_m=float(row["height_m"]),
            model=int(row["model"]),
            fit_percent=float(row["fit_percent"]),
            a_1_s2=float(row["a"]),
            b_1_s=float(row["b"]),
            c_1_s2=float(row["c"]),
        )
        for row in _rows("paper_table1_identified_models.csv")
    ]


def table_2() -> list[ErrorRow]:
    """Validation errors of the 28 models."""
    return [
        ErrorRow(float(row["height_m"]), int(row["model"]), float(row["mean_error_m_s"]), float(row["std_error_m_s"]))
        for row in _rows("paper_table2_validation.csv")
    ]


def table_3() -> list[ErrorRow]:
    """Errors of the selected model at each height."""
    return [
        ErrorRow(float(row["height_m"]), 0, float(row["mean_error_m_s"]), float(row["std_error_m_s"]))
        for row in _rows("paper_table3_selected_model.csv")
    ]


def selected_model() -> IdentifiedModel:
    """The model that the paper's Table 3 and its filter use."""
    return next(row for row in table_1() if (row.height_m, row.model) == SELECTED)


def inconsistencies() -> list[Inconsistency]:
    """All of them, in the paper's order."""
    return [
        Inconsistency(int(row["number"]), row["where"], row["printed"], row["reading"])
        for row in _rows("paper_inconsistencies.csv")
    ]


def landing_systems() -> list[LandingSystem]:
    """The four figures of the paper's comparison, its own last."""
    return [
        LandingSystem(
            row["system"],
            row["reference"],
            float(row["figure_cm"]),
            row["printed"],
            row["measures"],
            row["kind"],
            row["elsewhere"],
        )
        for row in _rows("paper_landing_systems.csv")
    ]


def accuracy_law(height_m: float) -> float:
    """Fit [%] that the paper's rule predicts: fit x h/h0 x velocity ratio = 90 %, which is 90 sqrt(0.6/h)."""
    return 90.0 * math.sqrt(0.6 / height_m)
