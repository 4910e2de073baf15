"""The only door to Numba: scalar equations, procedures, kernels, units, and the lanes they are built on.

An `@equation` is a short pure function of scalars and named tuples. Called from Python it is plain Python,
which takes floats, complex numbers (for exact derivatives) and, where it has no branch, NumPy arrays; called
from a kernel it is compiled and inlined. A `@procedure` is an equation too long for that: it is compiled once
and called. A `@kernel` is an entry point: it releases the interpreter lock and is cached on disk. A `unit` is
a part of a kernel that is compiled by itself and called through its address.

*Lanes* are flights that a kernel advances side by side. A kernel takes a lane marker, `ONE_LANE` or
`LANES`, whose length is part of its type and so a compile-time constant: the same source compiles to the
scalar build (one lane) and to the vectorised one. State lives in one flat buffer, a row of `len(lanes)` values
for each scalar, at constant row offsets, reached through `pointer`.

The same equations run on a CUDA device, a flight a thread: `device_runner`, and `strided` for the rows of one thread.

Floating-point contraction is off, so that a flight has the same bytes alone, in any batch and on any
number of threads.
"""

from collections.abc import Callable
from typing import Any

from flownav.core.compiling.bundles import (
    FlatAccess,
    columns_of,
    flat_access,
    gathering,
    lane_access,
    passing,
    places_of,
    replacing,
    row_of,
    row_store,
    row_view,
    stepping,
    width_of,
    write_function,
)
from flownav.core.compiling.cache import depends_also
from flownav.core.compiling.elementary import (
    arccos,
    arcsin,
    arctan2,
    cos,
    cosh,
    cosine_of_eighth,
    exp,
    log_of_unit,
    sin,
    sine_of_eighth,
    sinh,
)
from flownav.core.compiling.engine import LANES_WIDE, equation, kernel, procedure, sparingly
from flownav.core.compiling.parallel import begin_in_parallel, compile_in_parallel, meanwhile
from flownav.core.compiling.pointers import invoke, pointer
from flownav.core.compiling.progress import announce_compilation
from flownav.core.compiling.records import Layout, OnLanes, compiled, dressed
from flownav.core.compiling.scalars import (
    STAGES,
    bits_from_float,
    clamp,
    float_from_bits,
    larger,
    magnitude,
    runge_kutta,
    smaller,
    squared,
)
from flownav.core.compiling.strided import WARP, NoDeviceError, Runner, strided
from flownav.core.compiling.units import Unit, unit

Work = Any  # the lane buffer: a flat float64 array in Python, the address of its first element in kernels (`pointer`)
Lanes = tuple[int, ...]  # how many lanes a kernel has, as part of a type: `len(lanes)` is a compile-time constant

ONE_LANE: Lanes = (0,)
LANES: Lanes = (0,) * LANES_WIDE


def device_runner(instead: Callable[..., None]) -> Runner:
    """The CUDA device of this machine, or Numba's simulator of one where NUMBA_ENABLE_CUDASIM=1.

    instead: an equation that `invoke` calls on a device, whatever the address. NoDeviceError where there is none.
    """
    from flownav.core.compiling.launch import Gpu, Simulator, is_simulated

    return Simulator() if is_simulated() else Gpu(instead)
