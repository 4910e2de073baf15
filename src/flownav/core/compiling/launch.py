"""Functions of one thread, run by many: on a CUDA device, or in Numba's simulator of one.

A function takes the number of its thread and how many threads there are, then its arguments: numbers, arrays and named
tuples of them. `Gpu` compiles it once for the device at hand, keeps the machine code in the cache of kernels, and
passes arguments as the code takes them, field by field (`flattened`). `Simulator` runs the Python function, a thread at
a time, where NUMBA_ENABLE_CUDASIM=1.
"""

import hashlib
import inspect
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numba
import numpy as np

from flownav.core.compiling import device
from flownav.core.compiling.bundles import write_function
from flownav.core.compiling.cache import STORE, SUFFIX, file_name
from flownav.core.compiling.compiler import described
from flownav.core.compiling.device import Capability, DeviceCode, call_instead, compile_for_device
from flownav.core.compiling.progress import compiling
from flownav.core.compiling.strided import WARP, Constants, NoDeviceError

THREADS = 64  # of a block
SIMULATED_BYTES = 1 << 30


def per_thread(function: Callable[..., None], constants: Constants) -> Callable[..., None]:
    """The kernel whose every thread calls this equation; constants: parameters fixed in it."""
    from numba import cuda

    named = argument_names(function, constants)
    given = ", ".join(f"{name}={name}" for name in (*named, *constants))
    source = (
        f"def kernel(threads, {', '.join(named)}):\n"
        "    thread = cuda.grid(1)\n"
        "    if thread < threads:\n"
        f"        function(thread, threads, {given})\n"
    )
    return write_function("kernel", source, {"cuda": cuda, "function": function, **constants})


def argument_names(function: Callable[..., None], constants: Constants) -> list[str]:
    """The parameters of a function of one thread that its caller passes, in order."""
    return [name for name in list(inspect.signature(function).parameters)[2:] if name not in constants]


def flattened(value: Any, address: Callable[[Any], int]) -> Iterator[Any]:
    """An argument as compiled code takes it: tuples field by field, of an array also its size, shape and strides.

    address: of a device's array. What is None is a pointer to nothing.
    """
    if isinstance(value, tuple):
        for part in value:
            yield from flattened(part, address)
    elif value is None:
        yield 0
    elif isinstance(value, bool | int | float):
        yield value
    elif isinstance(value, np.bool_ | np.integer | np.floating):
        yield value.item()
    else:
        yield from (0, 0, math.prod(value.shape), value.dtype.itemsize, address(value), *value.shape, *value.strides)


def with_arrays(value: Any, change: Callable[[Any], Any]) -> Any:
    """A value with every array in it changed; named tuples keep their classes."""
    if isinstance(value, np.ndarray):
        return change(value)
    if isinstance(value, tuple):
        parts = [with_arrays(part, change) for part in value]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    return value


def argument_type(value: Any) -> Any:
    """Numba's type of an argument; a device's array counts as the NumPy array that it is a copy of."""
    from numba.core import types
    from numba.core.typing.typeof import typeof

    if isinstance(value, tuple):
        parts = [argument_type(part) for part in value]
        if hasattr(value, "_fields"):
            return types.NamedTuple(parts, type(value)) if len(set(parts)) != 1 else types.NamedUniTuple(
                parts[0], len(parts), type(value)
            )  # fmt: skip
        return types.Tuple(parts)
    if hasattr(value, "dtype") and hasattr(value, "shape") and value.shape != ():
        return types.Array(numba.from_dtype(value.dtype), len(value.shape), "C")
    return typeof(value)


class Gpu:
    """The first CUDA device. NoDeviceError where there is none, or no numba-cuda.

    instead: what `invoke` calls there, whatever the address (`device.call_instead`). block: threads of a block.
    """

    in_python = False

    def __init__(self, instead: Callable[..., None], block: int = THREADS) -> None:
        try:
            import numba_cuda  # noqa: F401
            from cuda.core import Device
            from numba import cuda
        except ImportError as error:
            raise NoDeviceError('numba-cuda is not installed (pip install "flownav[gpu]")') from error
        if not cuda.is_available():
            raise NoDeviceError("no CUDA device was found")
        call_instead(instead)
        self._cuda = cuda
        self._device = Device(cuda.get_current_device().id)
        self._device.set_current()
        self._block = block
        self._kernels: dict[str, Any] = {}
        major, minor = cuda.get_current_device().compute_capability[:2]
        self.capability: Capability = (int(major), int(minor))

    def free_bytes(self) -> int:
        """How much of the device's memory is free."""
        return int(self._cuda.current_context().get_memory_info().free)

    def put(self, value: Any) -> Any:
        """A copy of a contiguous array in the device's memory; of a tuple one with copies of its arrays."""
        return with_arrays(value, self._cuda.to_device)

    def new(self, shape: tuple[int, ...], dtype: Any) -> Any:
        """An array in the device's memory, whatever lies there."""
        return self._cuda.device_array(shape, dtype)

    def fetch(self, array: Any) -> Any:
        """A NumPy copy of a device's array."""
        return array.copy_to_host()

    def run(self, function: Callable[..., None], threads: int, named: dict[str, Any], constants: Constants) -> None:
        """`function(thread, threads, **told, **constants)` for each thread, and wait for the last."""
        from cuda.core import LaunchConfig, ObjectCode, launch

        arguments = (threads, *(named[name] for name in argument_names(function, constants)))
        code = compiled(function, constants, tuple(map(argument_type, arguments)), self.capability)
        known = hashlib.sha256(code.cubin).hexdigest()
        if known not in self._kernels:
            self._kernels[known] = ObjectCode.from_cubin(code.cubin).get_kernel(code.name)
        config = LaunchConfig(grid=-(-threads // self._block), block=self._block)
        passed = flattened(arguments, lambda array: int(array.device_ctypes_pointer.value or 0))
        launch(self._device.default_stream, config, self._kernels[known], *passed)
        self._device.sync()


def is_simulated() -> bool:
    """Whether Numba simulates a device in this process (NUMBA_ENABLE_CUDASIM=1)."""
    return bool(numba.config.ENABLE_CUDASIM)  # type: ignore[attr-defined]


class Simulator:
    """Numba's simulator of a CUDA device, in Python: about a thousand times slower than compiled code."""

    in_python = True

    def __init__(self) -> None:
        if not is_simulated():
            raise NoDeviceError("the simulator is asked for by NUMBA_ENABLE_CUDASIM=1")

    def free_bytes(self) -> int:
        """More than is needed: few flights are simulated."""
        return SIMULATED_BYTES

    def put(self, value: Any) -> Any:
        """A copy of an array, or of the arrays in a tuple."""
        return with_arrays(value, np.copy)

    def new(self, shape: tuple[int, ...], dtype: Any) -> Any:
        """A new array, filled with poison values."""
        return np.full(shape, np.nan if np.issubdtype(dtype, np.floating) else 77, dtype)

    def fetch(self, array: Any) -> Any:
        """A copy of the array."""
        return array.copy()

    def run(self, function: Callable[..., None], threads: int, named: dict[str, Any], constants: Constants) -> None:
        """`function(thread, threads, **told, **constants)` for each thread."""
        from numba import cuda

        kernel = cuda.jit(per_thread(function, constants))
        kernel[-(-threads // WARP), WARP](threads, *(named[name] for name in argument_names(function, constants)))


def compiled(
    function: Callable[..., None], constants: Constants, kinds: tuple[Any, ...], capability: Capability
) -> DeviceCode:
    """The machine code of a function of one thread, from the cache where it is there."""
    name = _file_name(function, constants, kinds, capability)
    payload = STORE.load(name) if name else None
    if payload is not None:
        entry, _, cubin = payload.partition(b"\n")
        return DeviceCode(entry.decode(), "", cubin)
    with compiling(function.__name__):
        code = compile_for_device(per_thread(function, constants), kinds, capability)
    if name:
        STORE.save(name, code.name.encode() + b"\n" + code.cubin)
    return code


def _file_name(
    function: Callable[..., None], constants: Constants, kinds: tuple[Any, ...], capability: Capability
) -> str | None:
    """The name of its file in the cache; None where it cannot be kept."""
    import numba_cuda

    host = file_name(function, constants, described(kinds))
    if host is None:
        return None
    stem, digest = host.removesuffix(SUFFIX).rsplit("-", 1)
    made_by = b"".join(Path(file).read_bytes() for file in (__file__, device.__file__))
    named = f"{digest} sm_{capability[0]}{capability[1]} numba-cuda {numba_cuda.__version__}\n".encode() + made_by
    return f"{stem}-{hashlib.sha256(named).hexdigest()[:24]}{SUFFIX}"
