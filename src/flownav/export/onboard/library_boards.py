"""The library on four processors behind one interface: natively (ctypes), emulated (unicorn), in wasmtime.

unicorn and wasmtime are imported where a board of theirs is made: ImportError where they are not installed.
"""

from __future__ import annotations

import ctypes
import hashlib
from pathlib import Path
from typing import Any

import numpy as np

from flownav.core.measurement import Array
from flownav.export.onboard.board import NOTHING, UNTOUCHED, Outcome
from flownav.export.onboard.elf import read_object, shared_object
from flownav.export.onboard.interface import SYMBOLS
from flownav.export.onboard.package import Asked, code_of
from flownav.export.onboard.wasm import STACK_BYTES
from flownav.navigation import onboard, progress, waiting, waiting_records
from flownav.navigation.now import NOW_NUMBERS, NowRow, now_row
from flownav.navigation.rings import Given
from flownav.navigation.rows import EVENT_COLUMNS, INNOVATION_COLUMNS
from flownav.navigation.waiting_records import READING

HEAD = len(onboard.OutcomeHead._fields)
FUEL = 1 << 60  # of wasmtime: about one an instruction
INNOVATIONS, EVENTS = onboard.MOST_INNOVATIONS * INNOVATION_COLUMNS, onboard.MOST_EVENTS * EVENT_COLUMNS


class LibraryBoard:
    """The part that the three boards have in common: memory that is allocated, written and read, and calls."""

    def __init__(self, settings: Array, sizes: waiting_records.Sizes) -> None:
        rings = waiting.rows_of(sizes)
        self.work, self.rings = self.room(progress.BOARD_ROWS), self.room(rings)
        self.settings, self.at, self.reading = self.room(len(settings)), self.room(2), self.room(READING)
        self.head, self.innovation, self.event = self.room(HEAD), self.room(INNOVATIONS), self.room(EVENTS)
        self.state, self.found = self.room(NOW_NUMBERS), self.room(1)
        garbage = np.full(progress.BOARD_ROWS + rings, 1e300)  # whatever lay there
        self.put(self.work, garbage[: progress.BOARD_ROWS])
        self.put(self.rings, np.concatenate([sizes, garbage[progress.BOARD_ROWS + len(sizes) :]]))
        self.put(self.settings, settings)
        self.run("begin", self.work, self.rings, self.settings)

    def room(self, numbers: int) -> Any:
        """A place for this number of float64s."""
        raise NotImplementedError

    def put(self, at: Any, values: Array) -> None:
        """Write numbers to a place."""
        raise NotImplementedError

    def get(self, at: Any, numbers: int) -> Array:
        """Read this number of float64s from a place."""
        raise NotImplementedError

    def call(self, symbol: str, *pointers: Any) -> int:
        """Call an entry; its status."""
        raise NotImplementedError

    def count(self) -> None:
        """Count instructions, and look at the stack, from now on."""
        raise NotImplementedError

    @property
    def instructions(self) -> int:
        """How many there were since `count`."""
        raise NotImplementedError

    @property
    def stack_bytes(self) -> int:
        """The most of the stack that was used since `count`."""
        raise NotImplementedError

    def run(self, name: str, *pointers: Any) -> None:
        """Call an entry, which must not fail."""
        assert self.call(SYMBOLS[name], *pointers) == 0, name

    def take(self, given: Given) -> Outcome:
        """`flownav_take`."""
        self.put(self.at, np.array([given.t_s, float(given.sensor)]))
        self.put(self.reading, given.numbers)
        self.run(
            "take", self.work, self.rings, self.settings, self.at, self.reading, self.head, self.innovation, self.event
        )
        head = onboard.OutcomeHead(*self.get(self.head, HEAD).tolist())
        innovation = self.get(self.innovation, int(head.innovations) * INNOVATION_COLUMNS)
        event = self.get(self.event, int(head.events) * EVENT_COLUMNS)
        return Outcome(head, innovation.reshape(-1, INNOVATION_COLUMNS), event.reshape(-1, EVENT_COLUMNS))

    def finish(self) -> None:
        """`flownav_work` until nothing is left."""
        while self.take(NOTHING).head.parts > 0.0:
            pass

    def now_numbers(self, t_s: float) -> Array:
        """`flownav_now`, as it lies in memory."""
        self.put(self.at, np.array([t_s, 0.0]))
        self.run("now", self.work, self.rings, self.settings, self.at, self.state)
        return self.get(self.state, NOW_NUMBERS)

    def now(self, t_s: float) -> NowRow[Array]:
        """`flownav_now`."""
        row: NowRow[Array] = now_row(self.now_numbers(t_s))
        return row

    def digest(self) -> int:
        """`flownav_digest`."""
        self.run("digest", self.work, self.found)
        return int(self.get(self.found, 1).view(np.uint64)[0])


class NativeBoard(LibraryBoard):
    """This processor's library, through ctypes."""

    def __init__(self, settings: Array, sizes: waiting_records.Sizes, library: Path) -> None:
        self._library = ctypes.CDLL(str(library))
        super().__init__(settings, sizes)

    def room(self, numbers: int) -> Any:
        return np.zeros(numbers)

    def put(self, at: Any, values: Array) -> None:
        at[: len(values)] = values

    def get(self, at: Any, numbers: int) -> Array:
        found: Array = at[:numbers].copy()
        return found

    def call(self, symbol: str, *pointers: Any) -> int:
        return int(getattr(self._library, symbol)(*(ctypes.c_void_p(p.ctypes.data) for p in pointers)))


class EmulatedBoard(LibraryBoard):
    """A Cortex-M7, an AArch64 or an x86-64 in unicorn."""

    def __init__(self, settings: Array, sizes: waiting_records.Sizes, content: bytes) -> None:
        from flownav.export.onboard.emulated import Processor

        self.processor = Processor(read_object(content))
        super().__init__(settings, sizes)

    def room(self, numbers: int) -> Any:
        return self.processor.room(numbers)

    def put(self, at: Any, values: Array) -> None:
        self.processor.put(at, values)

    def get(self, at: Any, numbers: int) -> Array:
        return self.processor.get(at, numbers)

    def call(self, symbol: str, *pointers: Any) -> int:
        return self.processor.call(symbol, *pointers)

    def count(self) -> None:
        self.processor.count()
        self.processor.paint_stack()

    @property
    def instructions(self) -> int:
        return self.processor.instructions

    @property
    def stack_bytes(self) -> int:
        return self.processor.stack_used()


def _exports_of(instance: Any, store: Any) -> Any:
    """The memory, the numbers and the functions of a module, by name."""
    return instance.exports(store)


class WasmBoard(LibraryBoard):
    """A module in wasmtime, which counts its instructions if asked."""

    def __init__(self, settings: Array, sizes: waiting_records.Sizes, content: bytes, *, counts: bool = False) -> None:
        import wasmtime

        config = wasmtime.Config()
        config.consume_fuel = counts
        engine = wasmtime.Engine(config)
        self._store = wasmtime.Store(engine)
        if counts:
            self._store.set_fuel(FUEL)
        self._exports = _exports_of(wasmtime.Instance(self._store, wasmtime.Module(engine, content), []), self._store)
        self._memory = self._exports["memory"]
        self._heap = self._free = int(self._exports["heap"].value(self._store))
        super().__init__(settings, sizes)

    def room(self, numbers: int) -> Any:
        at, self._free = self._free, self._free + (8 * numbers + 15) // 16 * 16
        assert self._free <= self._memory.data_len(self._store)
        return at

    def put(self, at: Any, values: Array) -> None:
        self._memory.write(self._store, np.ascontiguousarray(values).tobytes(), at)

    def get(self, at: Any, numbers: int) -> Array:
        return np.frombuffer(bytes(self._memory.read(self._store, at, at + 8 * numbers)), np.float64)

    def call(self, symbol: str, *pointers: Any) -> int:
        return int(self._exports[symbol](self._store, *pointers))

    def count(self) -> None:
        self._before = int(self._store.get_fuel())
        self._memory.write(self._store, bytes([UNTOUCHED]) * STACK_BYTES, self._heap - STACK_BYTES)

    @property
    def instructions(self) -> int:
        return self._before - int(self._store.get_fuel())

    @property
    def stack_bytes(self) -> int:
        stack = bytes(self._memory.read(self._store, self._heap - STACK_BYTES, self._heap))
        return STACK_BYTES - next((i for i, byte in enumerate(stack) if byte != UNTOUCHED), STACK_BYTES)


def library_board(
    target: str, settings: Array, sizes: waiting_records.Sizes, folder: Path, *, lag: bool = False,
    without: tuple[str, ...] = (), native: bool = True,
) -> LibraryBoard:  # fmt: skip
    """The library of a target, built and ready. native: code of this processor runs on it, not in the emulator."""
    code = code_of(Asked(target, without=without), lag)
    if target == "wasm32":
        return WasmBoard(settings, sizes, code.content, counts=not native)
    if target == "linux-x86_64" and native:
        library = folder / f"libflownav-{hashlib.sha256(code.content).hexdigest()[:12]}.so"
        if not library.is_file():  # one that is loaded must not be written over
            library.write_bytes(shared_object(read_object(code.content), library.name))
        return NativeBoard(settings, sizes, library)
    return EmulatedBoard(settings, sizes, code.content)
