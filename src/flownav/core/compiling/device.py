"""Equations on a CUDA device: what numba-cuda must know of them, and their kernels as code for a device.

numba-cuda (extra `gpu`) is imported where it is used and nowhere else. Nothing here asks for a GPU: code is compiled
for a compute capability that is named, so that it can be made and looked at on any machine.

Floating-point contraction is off (`-fma=0`: every product and every sum is rounded by itself, as on the CPU), so
that additions, products, quotients and roots are the CPU's to the last bit, and so are sines and exponentials, which
are made of them (`elementary`).
"""

import inspect
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any, NamedTuple

from flownav.core.compiling.declared import begin_compiling
from flownav.core.compiling.engine import EQUATIONS
from flownav.core.compiling.pointers import invoke
from flownav.core.compiling.strided import teach_strided_pointers

Capability = tuple[int, int]
NVVM_OPTIONS = {"opt": 3, "fastmath": False}
EXACT = {"fma": 0}


class DeviceCode(NamedTuple):
    """A kernel compiled for a device. name: of its entry; ptx: empty of what came from the cache."""

    name: str
    ptx: str
    cubin: bytes


class _Named(NamedTuple):
    """A device that need not be there: all that the compiler asks of one."""

    compute_capability: tuple[int, int, str]


def compile_for_device(function: Callable[..., None], arguments: tuple[Any, ...], capability: Capability) -> DeviceCode:
    """A kernel of these argument types (Numba's) as PTX and as machine code for a compute capability.

    ImportError without numba-cuda; NumbaError and RuntimeError where the code cannot be compiled.
    """
    library = lowered(function, arguments, capability)
    asked = (*capability, "")
    ptx = library.get_asm_str(cc=asked)
    return DeviceCode(library._entry_name, ptx, bytes(library.get_cubin(cc=asked).code))


def lowered(function: Callable[..., None], arguments: tuple[Any, ...], capability: Capability) -> Any:
    """numba-cuda's library of a kernel: its code for LLVM, with that of all that it calls."""
    from numba.core import types
    from numba.cuda.compiler import compile_cuda, kernel_fixup

    begin_compiling()
    asked = (*capability, "")
    with _device_named(asked):
        teach_equations()
        result = compile_cuda(
            function, types.void, arguments, fastmath=False, nvvm_options=dict(NVVM_OPTIONS), cc=asked
        )
    library = result.library
    entry = library.get_function(result.fndesc.llvm_func_name)
    library._entry_name = result.fndesc.llvm_func_name
    kernel_fixup(entry, False)
    library._nvvm_options.update(EXACT)
    return library


@contextmanager
def _device_named(capability: tuple[int, int, str]) -> Iterator[None]:
    """Functions that a kernel calls are compiled for this capability, whether or not there is a device."""
    from numba.cuda import dispatcher

    before = dispatcher.get_current_device
    dispatcher.get_current_device = lambda: _Named(capability)
    try:
        yield
    finally:
        dispatcher.get_current_device = before


class _Extensions:
    """Equations that numba-cuda knows already as device functions, which must be kept alive."""

    functions: dict[Callable[..., Any], Any] = {}  # noqa: RUF012


def teach_equations() -> None:
    """Every equation and procedure that is defined by now is a device function for numba-cuda."""
    from numba import cuda
    from numba.core import types
    from numba.cuda.descriptor import cuda_target

    _teach_once()
    context = cuda_target.typing_context
    context.refresh()
    for function, inlined in EQUATIONS.items():
        if function not in _Extensions.functions:
            _Extensions.functions[function] = cuda.jit(device=True, forceinline=inlined, lto=False)(
                inspect.unwrap(function)
            )
            _say(context, function, types.Dispatcher(_Extensions.functions[function]))


def call_instead(function: Callable[..., None]) -> None:
    """On a device `invoke` calls this equation, whatever the address: there is one navigator, and it is at hand."""
    from numba.core import types
    from numba.cuda.descriptor import cuda_target

    teach_equations()
    _say(cuda_target.typing_context, invoke, types.Dispatcher(_Extensions.functions[function]))


def _say(context: Any, function: Callable[..., Any], kind: Any) -> None:
    """The type of a global value is this, whatever was known of it."""
    if context._lookup_global(function) is not None:
        context._remove_global(function)
    context._insert_global(function, kind)


@cache
def _teach_once() -> None:
    """Teach numba-cuda the scalar functions of NumPy that it lacks, and pointers with a stride."""
    import math

    import numpy as np
    from numba.core import types
    from numba.cuda import libdevice, ufuncs
    from numba.cuda.descriptor import cuda_target
    from numba.cuda.mathimpl import get_unary_impl_for_fn_and_ty

    def of_math(function: Any) -> Callable[..., Any]:
        return lambda context, builder, sig, args: get_unary_impl_for_fn_and_ty(function, types.float64)(
            context, builder, sig, args
        )

    def rounded(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return context.get_function(libdevice.rint, types.float64(types.float64))(builder, args)

    def finite(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.fcmp_ordered("==", builder.fsub(args[0], args[0]), context.get_constant(types.float64, 0.0))

    def infinite(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        size = of_math(math.fabs)(context, builder, types.float64(types.float64), args)
        return builder.fcmp_ordered("==", size, context.get_constant(types.float64, math.inf))

    known = ufuncs.ufunc_db()
    for name in ("sqrt", "floor", "ceil"):
        known.setdefault(getattr(np, name), {})["d->d"] = of_math(getattr(math, name))
    known.setdefault(np.absolute, {})["d->d"] = of_math(math.fabs)
    known.setdefault(np.rint, {})["d->d"] = rounded
    known.setdefault(np.isfinite, {})["d->?"] = finite
    known.setdefault(np.isinf, {})["d->?"] = infinite
    cuda_target.typing_context.refresh()
    cuda_target.target_context.refresh()
    teach_strided_pointers()
