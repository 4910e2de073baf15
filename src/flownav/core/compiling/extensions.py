"""Numba's lessons before it compiles anything of ours: records as arguments, kernels that call kernels, pointers, calls
through addresses, the bits of a float.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.core.typing.typeof import typeof_impl
from numba.extending import intrinsic, lower_builtin, overload

from flownav.core.compiling.engine import Kernel
from flownav.core.compiling.pointers import invoke, pointer
from flownav.core.compiling.scalars import bits_from_float, float_from_bits

PASSED = (types.CPointer, types.Integer, types.Float, types.Boolean)

try:
    from flownav.core.compiling.record_arguments import pass_records_whole
except (ImportError, AttributeError):
    pass  # a Numba with other models of tuples: it takes each apart, which costs time only
else:
    pass_records_whole()


@typeof_impl.register(Kernel)
def _type_of_kernel(value: Kernel, _: Any) -> Any:
    """A kernel that another one calls is what Numba's dispatcher of it is."""
    return types.Dispatcher(value.dispatcher)


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


@intrinsic
def _bitcast_to_float(typing_context: Any, bits: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], ir.DoubleType())

    return types.float64(types.uint64), generate


@intrinsic
def _bitcast_to_bits(typing_context: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], ir.IntType(64))

    return types.uint64(types.float64), generate


@overload(float_from_bits, inline="always")
def _compiled_float_from_bits(bits):  # type: ignore[no-untyped-def]
    return lambda bits: _bitcast_to_float(bits)  # type: ignore[call-arg]


@overload(bits_from_float, inline="always")
def _compiled_bits_from_float(value):  # type: ignore[no-untyped-def]
    return lambda value: _bitcast_to_bits(value)  # type: ignore[call-arg]
