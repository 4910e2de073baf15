"""Pointers into arrays, and calls through addresses: what Numba makes slow or cannot say.

Numba compiles `array[i]` as `array[i + n if i < 0 else i]` and takes the whole array structure apart at each
access; that select stands between LLVM and its vectoriser. `pointer(array)[i]` is one address and one load.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

from llvmlite import ir
from numba import types
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import lower_builtin

Buffer = TypeVar("Buffer")

PASSED = (types.CPointer, types.Integer, types.Float, types.Boolean)


def pointer(array: Buffer) -> Buffer:
    """The array itself in Python; in a kernel the address of its first element, indexed without a check.

    `array` is contiguous, float64 or int64. A negative index is not counted from the end, and there is no
    `len`. The array must be an argument of the kernel, or be used after the pointer: a pointer keeps no array
    alive.
    """
    return array


def invoke(address: int | Callable[..., object], *arguments: Any) -> None:
    """Call the C function of that address (see `unit`), which returns nothing, from a kernel.

    Each argument is passed as what it is: a pointer, an int64 or a float64. In Python a callable stands in the
    address's place and is called.
    """
    cast(Callable[..., object], address)(*arguments)


@infer_global(pointer)
class _PointerType(AbstractTemplate):
    """`pointer`: array(T, 1d or more, contiguous) -> CPointer(T); a pointer stays what it is."""

    def generic(self, args: Any, kws: Any) -> Any:
        (array,) = args
        if isinstance(array, types.CPointer):
            return signature(array, array)
        if isinstance(array, types.Array) and array.layout == "C" and array.dtype in (types.float64, types.int64):
            return signature(types.CPointer(array.dtype), array)
        return None


def _lower_pointer(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return context.make_array(sig.args[0])(context, builder, value=args[0]).data


def _lower_same_pointer(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return args[0]


@infer_global(invoke)
class _InvokeType(AbstractTemplate):
    """`invoke`: (int64, pointers, int64 and float64 ...) -> None."""

    def generic(self, args: Any, kws: Any) -> Any:
        address, *arguments = args
        if not isinstance(address, types.Integer) or not all(isinstance(a, PASSED) for a in arguments):
            return None
        return signature(types.none, types.int64, *(_passed(a) for a in arguments))


def _passed(argument: Any) -> Any:
    """How C receives an argument: whole numbers and truths as int64, floats as float64, pointers as they are."""
    if isinstance(argument, types.CPointer):
        return argument
    return types.float64 if isinstance(argument, types.Float) else types.int64


def _lower_invoke(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    address, *arguments = args
    callee = ir.FunctionType(ir.VoidType(), [a.type for a in arguments])
    builder.call(builder.inttoptr(address, callee.as_pointer()), arguments)
    return context.get_dummy_value()


lower_builtin(pointer, types.Array)(_lower_pointer)
lower_builtin(pointer, types.CPointer)(_lower_same_pointer)
lower_builtin(invoke, types.Integer, types.VarArg(types.Any))(_lower_invoke)
