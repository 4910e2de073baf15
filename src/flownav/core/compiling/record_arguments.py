"""Records that a compiled function passes to another as one argument, in place of one for each number in them.

A flight is 900 numbers. Numba takes a tuple apart at every call and puts it together in the function that is called,
which is most of the text that LLVM is given; LLVM takes values of whole structures and does the same by itself, where
it must. How a tuple is passed belongs to its type, so it holds for every function of the process, also for one that
Numba compiles by itself; tuples of other packages, whose code may lie in a cache of theirs, stay as they are.
"""

from typing import Any

from numba import types
from numba.core.datamodel.models import TupleModel, UniTupleModel
from numba.core.datamodel.registry import default_manager

from flownav.core.compiling.level import Leanness

OURS = "flownav."


class _Whole:
    """Arguments of a tuple's model: the value itself."""

    def get_argument_type(self: Any) -> Any:
        return self.get_value_type()

    def as_argument(self, builder: Any, value: Any) -> Any:
        return value

    def from_argument(self, builder: Any, value: Any) -> Any:
        return value


class RecordModel(_Whole, TupleModel):
    """A named tuple of fields of any types."""


class UniformRecordModel(_Whole, UniTupleModel):
    """A named tuple of fields of one type."""


def _record_model(models: Any, kind: Any) -> Any:
    """The model of a named tuple; other targets (CUDA) hand over as they do."""
    uniform = isinstance(kind, types.NamedUniTuple)
    if models is default_manager and kind.instance_class.__module__.startswith(OURS):
        return (UniformRecordModel if uniform else RecordModel)(models, kind)
    return (UniTupleModel if uniform else TupleModel)(models, kind)


def pass_records_whole() -> None:
    """From now on, in this process; not with `FLOWNAV_PLAIN=1`."""
    if not Leanness.wanted:
        return
    for kind in (types.NamedTuple, types.NamedUniTuple):
        default_manager.register(kind, _record_model)
