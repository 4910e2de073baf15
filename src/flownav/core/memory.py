"""A process that gives memory back as soon as it is free: for commands whose peak is what their machine must have."""

import ctypes
import sys
from contextlib import suppress

# parameters of glibc's mallopt (malloc.h)
M_TRIM_THRESHOLD, M_MMAP_THRESHOLD, M_ARENA_MAX = -1, -3, -8
LARGE_BYTES = 1 << 20  # a piece of this size is asked of the system, and goes back to it when it is free


def give_back_early() -> None:
    """From now on, in this process: large pieces do not stay in the heap, threads share one, Arrow keeps none.

    By itself glibc keeps pieces of up to 32 MB once one of that size was freed, in a heap for each thread. Another C
    library does what it does.
    """
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            mallopt = ctypes.CDLL(None).mallopt
            for parameter, value in (
                (M_MMAP_THRESHOLD, LARGE_BYTES),
                (M_TRIM_THRESHOLD, LARGE_BYTES),
                (M_ARENA_MAX, 1),
            ):
                mallopt(parameter, value)
    import pyarrow

    pyarrow.set_memory_pool(pyarrow.system_memory_pool())
