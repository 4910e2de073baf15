"""Pointers into arrays, and calls through addresses: what Numba makes slow or cannot say.

Numba compiles `array[i]` as `array[i + n if i < 0 else i]` and takes the whole array structure apart at each
access; that select stands between LLVM and its vectoriser. `pointer(array)[i]` is one address and one load. What
compiled code makes of them stands in `taught`.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

Buffer = TypeVar("Buffer")


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
