"""Kernels that several workers of the suite need are compiled by one of them: the others wait for its file in the
cache.
"""

from __future__ import annotations

import fcntl
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from flownav.core.compiling import parallel
from flownav.core.compiling.cache import SUFFIX, Store, cache_folder

HUNG_S = 900.0  # whoever compiles for so long hangs, and is not waited for any more


class Turns:
    """Names that one process has at a time."""

    def __init__(self) -> None:
        self._folder = cache_folder() / "turns"
        self._held: dict[str, int] = {}

    def take(self, name: str) -> bool:
        """Wait for a name and have it; False where this process has it already, or nobody gives it back."""
        if name in self._held:
            return False
        self._folder.mkdir(parents=True, exist_ok=True)
        file, until_s = os.open(self._folder / name, os.O_CREAT | os.O_RDWR | os.O_CLOEXEC), time.monotonic() + HUNG_S
        while True:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                if time.monotonic() > until_s:
                    os.close(file)
                    return False
                time.sleep(0.05)
            else:
                self._held[name] = file
                return True

    def give(self, name: str) -> None:
        """Let others have it."""
        file = self._held.pop(name, -1)
        if file >= 0:
            fcntl.flock(file, fcntl.LOCK_UN)
            os.close(file)


def begin() -> None:
    """From now on, this process compiles nothing that another one is compiling."""
    turns = Turns()
    load, save = Store.load, Store.save
    are_missing, compiling = parallel._are_both_missing, parallel._compiling_elsewhere

    def load_or_wait(self: Store, name: str) -> bytes | None:
        found = load(self, name)
        if found is None and name.endswith(SUFFIX) and turns.take(name):
            found = load(self, name)
            if found is not None:
                turns.give(name)
        return found

    def save_and_give(self: Store, name: str, payload: bytes) -> None:
        save(self, name, payload)
        turns.give(name)

    def are_missing_still(*asked: Any) -> bool:
        if not are_missing(*asked) or not parallel.can_pay():
            return False
        turns.take("beside")
        if still := are_missing(*asked):
            return still
        turns.give("beside")
        return False

    @contextmanager
    def compiling_and_give(*asked: Any) -> Iterator[Any]:
        try:
            with compiling(*asked) as other:
                yield other
        finally:
            turns.give("beside")

    Store.load, Store.save = load_or_wait, save_and_give
    parallel._are_both_missing, parallel._compiling_elsewhere = are_missing_still, compiling_and_give
