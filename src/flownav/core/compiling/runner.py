"""Where functions of one thread are run by many threads: what is asked of a device, or of what stands for one."""

from collections.abc import Callable
from typing import Any, Protocol

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

    def run(self, function: Callable[..., None], threads: int, told: dict[str, Any], constants: Constants) -> None:
        """`function(thread, threads, **told, **constants)` for each thread; arrays in `told` are the device's."""
