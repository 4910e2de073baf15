"""Functions of one thread that are run by many: what is asked of a device, and pointers with a stride to its rows.

Thirty-two threads that fly side by side read the same row at the same time. Their rows lie as those of lanes do:
row `r` of thread `k` at `r * WARP + k`, so that a warp reads a row as one piece of memory. The equations know nothing
of it: they fly `ONE_LANE`, whose row `r` is `work[r]`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

WARP = 32


class Strided:
    """`strided(array, first)` in Python: element i is `array[first + i * WARP]`."""

    def __init__(self, array: NDArray[np.float64], first: int) -> None:
        self._elements = array[first::WARP]

    def __getitem__(self, index: int) -> float:
        value: float = self._elements[index]
        return value

    def __setitem__(self, index: int, value: float) -> None:
        self._elements[index] = value


def strided(array: NDArray[np.float64], first: int) -> Any:
    """Every WARP-th element of a flat float64 array from `first` on; on a device an address, indexed unchecked."""
    return Strided(array, first)


def teach_strided_pointers() -> None:
    """Make numba-cuda compile `strided`, and what it gives."""
    from llvmlite import ir
    from numba.core import types
    from numba.cuda.extending import core_models, register_model

    class StridedType(types.Type):
        """An address of float64s that lie WARP apart."""

        def __init__(self) -> None:
            super().__init__(name=f"strided({WARP})")

    @register_model(StridedType)
    class _Model(core_models.PrimitiveModel):  # type: ignore[misc]
        def __init__(self, manager: Any, record: Any) -> None:
            super().__init__(manager, record, ir.DoubleType().as_pointer())

    _teach_types(StridedType())
    _teach_code(StridedType)


def _teach_types(kind: Any) -> None:
    """Declare the type that `strided` gives, and reading and writing through it."""
    import operator

    from numba.core import types
    from numba.cuda.typing.templates import AbstractTemplate, infer_global, signature

    @infer_global(strided)
    class _Strided(AbstractTemplate):  # type: ignore[misc]
        def generic(self, args: Any, kws: Any) -> Any:
            array, _first = args
            plain = isinstance(array, types.Array) and array.layout == "C" and array.ndim == 1
            return signature(kind, array, types.int64) if plain and array.dtype == types.float64 else None

    @infer_global(operator.getitem)
    class _Load(AbstractTemplate):  # type: ignore[misc]
        def generic(self, args: Any, kws: Any) -> Any:
            pointer, index = args
            fits = pointer == kind and isinstance(index, types.Integer)
            return signature(types.float64, pointer, types.int64) if fits else None

    @infer_global(operator.setitem)
    class _Store(AbstractTemplate):  # type: ignore[misc]
        def generic(self, args: Any, kws: Any) -> Any:
            pointer, index, _value = args
            fits = pointer == kind and isinstance(index, types.Integer)
            return signature(types.none, pointer, types.int64, types.float64) if fits else None


def _teach_code(strided_type: Any) -> None:
    """The instructions: an address, a load, a store."""
    import operator

    from llvmlite import ir
    from numba.core import types
    from numba.cuda.extending import lower_builtin

    def lower_address(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        data = context.make_array(sig.args[0])(context, builder, value=args[0]).data
        return builder.gep(data, [args[1]])

    def place(builder: Any, pointer: Any, index: Any) -> Any:
        return builder.gep(pointer, [builder.mul(index, ir.Constant(ir.IntType(64), WARP))])

    def lower_load(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.load(place(builder, args[0], args[1]))

    def lower_store(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        builder.store(args[2], place(builder, args[0], args[1]))
        return context.get_dummy_value()

    lower_builtin(strided, types.Array, types.Integer)(lower_address)
    lower_builtin(operator.getitem, strided_type, types.Integer)(lower_load)
    lower_builtin(operator.setitem, strided_type, types.Integer, types.Float)(lower_store)


Constants = dict[str, Any]


class NoDeviceError(Exception):
    """There is no CUDA device to run on; why, in a few words."""


class Runner(Protocol):
    """Threads, and the memory that they work on. in_python: functions are run as plain Python."""

    in_python: bool

    def free_bytes(self) -> int:
        """How much of its memory is free."""

    def put(self, value: Any) -> Any:
        """A copy of a contiguous array in the device's memory; of a tuple one with copies of its arrays."""

    def new(self, shape: tuple[int, ...], dtype: Any) -> Any:
        """An array in the device's memory, whatever lies there."""

    def fetch(self, array: Any) -> Any:
        """A NumPy copy of a device's array."""

    def run(self, function: Callable[..., None], threads: int, named: dict[str, Any], constants: Constants) -> None:
        """`function(thread, threads, **told, **constants)` for each thread; arrays in `told` are the device's."""
