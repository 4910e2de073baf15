"""The paper's printed figures: Tables 1 to 3, figures of its text, its inconsistencies, and the landings it compares
with.

Tables 5 and 6 are `scoring.paper_tables`.
"""

import csv
import math
from typing import NamedTuple

from flownav.core.parameter_files import shipped
from flownav.sensors.datasheet import IdentifiedModel

HEIGHTS_M = (0.6, 0.8, 1.0, 1.5)
MODELS = 7
# section III.E, the four relations (model 2 of each height)
RELATION_FITS = {0.6: 87.0, 0.8: 78.0, 1.0: 72.0, 1.5: 57.0}
SELECTED_MODEL = (0.6, 2)  # "natural frequency 13.8528 rad/s": Table 1, 60 cm, model 2
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
            height_m=float(row["height_m"]), model=int(row["model"]), fit_percent=float(row["fit_percent"]),
            a_1_s2=float(row["a"]), b_1_s=float(row["b"]), c_1_s2=float(row["c"]),
        )
        for row in _rows("paper_table1_identified_models.csv")
    ]  # fmt: skip


def table_2() -> list[ErrorRow]:
    """Validation errors of the 28 models."""
    return _error_rows("paper_table2_validation.csv")


def _error_rows(name: str) -> list[ErrorRow]:
    return [
        ErrorRow(
            float(row["height_m"]), int(row.get("model", 0)), float(row["mean_error_m_s"]), float(row["std_error_m_s"])
        )
        for row in _rows(name)
    ]


def table_3() -> list[ErrorRow]:
    """Errors of the selected model at each height."""
    return [row._replace(model=0) for row in _error_rows("paper_table3_selected_model.csv")]


def selected_model() -> IdentifiedModel:
    """The model that the paper's Table 3 and its filter use."""
    return next(row for row in table_1() if (row.height_m, row.model) == SELECTED_MODEL)


def inconsistencies() -> list[Inconsistency]:
    """Every inconsistency, in the paper's order."""
    rows = _rows("paper_inconsistencies.csv")
    return [Inconsistency(int(row["number"]), row["where"], row["printed"], row["reading"]) for row in rows]


def landing_systems() -> list[LandingSystem]:
    """The four figures of the paper's comparison, its own last."""
    rows = ([row[name] for name in LandingSystem._fields] for row in _rows("paper_landing_systems.csv"))
    return [LandingSystem(*row)._replace(figure_cm=float(row[2])) for row in rows]  # type: ignore[arg-type]


def accuracy_law(height_m: float) -> float:
    """Fit [%] that the paper's rule predicts: fit x h/h0 x velocity ratio = 90 %, which is 90 sqrt(0.6/h)."""
    return 90.0 * math.sqrt(0.6 / height_m)
