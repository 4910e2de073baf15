"""The entries of a smoother's journal, by name; the first number of each is its kind."""

from typing import Annotated, Generic, NamedTuple, TypeVar

from flownav.core.compile import places_of, row_store, row_view, width_of
from flownav.estimation.states import STATES

PREDICTED, CORRECTED, FORGOTTEN, NOTED, DECAYED = 0.0, 1.0, 2.0, 3.0, 4.0
Value = TypeVar("Value")


class PredictionEntry(NamedTuple, Generic[Value]):
    """A prediction over dt, with R_EB in its middle, row by row."""

    kind: Value
    dt_s: Value
    middle: Annotated[Value, 9]
    force_ned_m_s2: Annotated[Value, 3]


class DecayEntry(NamedTuple, Generic[Value]):
    """The Gauss-Markov errors went on by dt."""

    kind: Value
    dt_s: Value


class CorrectionEntry(NamedTuple, Generic[Value]):
    """A correction: nu, S, h and K."""

    kind: Value
    innovation: Value
    variance: Value
    jacobian: Annotated[Value, STATES]
    gain: Annotated[Value, STATES]


class ResetEntry(NamedTuple, Generic[Value]):
    """A state that lost its correlations."""

    kind: Value
    state: Value


ENTRY = width_of(CorrectionEntry)  # the widest
CORRECTION: CorrectionEntry[int] = places_of(CorrectionEntry)
store_prediction, store_decay, store_correction, store_reset = (
    row_store(entry, ENTRY) for entry in (PredictionEntry, DecayEntry, CorrectionEntry, ResetEntry)
)
view_prediction, view_decay, view_correction, view_reset = (
    row_view(entry) for entry in (PredictionEntry, DecayEntry, CorrectionEntry, ResetEntry)
)
