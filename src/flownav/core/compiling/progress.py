"""Progress of compilation, with its name and time: written on standard error, at least every second on a terminal."""

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

EVERY_S = 0.5


class Progress:
    """Reports of compilation, while a block asks for them (`announce`)."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._listeners = 0
        self._throughout = 0
        self._what = ""
        self._working: list[str] = []
        self._start = 0.0
        self._done = 0
        self._expected = 0
        self._whole = ""
        self._announced = False  # whether the line with the whole was written where lines cannot be written over
        self._stop = threading.Event()
        self._ticking: threading.Thread | None = None

    @contextmanager
    def announce(self, what: str, whole: str = "", *, throughout: bool = False) -> Iterator[None]:
        """Report compilation inside the block; write nothing where all is in the cache.

        whole: what it is for and how long it takes, in words for people, in place of the names of its parts.
        throughout: a whole run, in which blocks within have their own names and sums.
        """
        with self._lock:
            if self._listeners == self._throughout:
                self._begin(what, whole)
            self._listeners += 1
            self._throughout += throughout
        try:
            yield
        finally:
            with self._lock:
                self._listeners -= 1
                self._throughout -= throughout
                if self._listeners == self._throughout:
                    self._finish()
                    self._begin("flownav")

    def _begin(self, what: str, whole: str = "") -> None:
        self._what, self._start, self._done, self._expected = what, 0.0, 0, 0
        self._whole, self._announced = whole, False

    @contextmanager
    def expect(self, parts: int, whole: str = "") -> Iterator[None]:
        """Report each of `parts` parts by name. whole: their common name, written in place of theirs."""
        before, around = self._expected, self._whole
        self._expected, self._whole = self._done + parts, around or whole
        self._announced = self._announced and bool(around)
        try:
            yield
        finally:
            self._expected, self._whole = before, around

    @contextmanager
    def working(self, name: str) -> Iterator[None]:
        """A part is being compiled inside the block; what is compiled for it goes under its name."""
        self.begin(name)
        done = False
        try:
            yield
            done = True
        finally:
            self.end(name, done)

    def begin(self, name: str) -> None:
        """A part is being compiled from now on."""
        with self._lock:
            self._working.append(name)
            if not self._listeners or threading.current_thread() is self._ticking:
                return
            self._start = self._start or time.monotonic()
            if self._on_terminal():
                self._tick()
            elif not self._announced if self._whole else len(self._working) == 1 or self._expected:
                self._announced = bool(self._whole)
                self._write(f"flownav: {self._line()} ...\n")

    def end(self, name: str, done: bool = True) -> None:
        """A part is compiled, or has failed."""
        with self._lock:
            self._working.remove(name)
            self._done += done and (not self._working or self._expected > 0)

    def _line(self) -> str:
        """Such as "compiling navigator (2 of 3)", or in words for people what all parts are together."""
        if self._whole:
            return f"compiling {self._whole}"
        names = ", ".join(name.replace("_", " ") for name in self._working[: None if self._expected else 1])
        place = f" ({min(self._done + 1, self._expected)} of {self._expected})" if self._expected else ""
        return f"compiling {names}{place}"

    def _tick(self) -> None:
        if self._ticking is None:
            self._stop.clear()
            self._ticking = threading.Thread(target=self._run, daemon=True)
            self._ticking.start()

    def _run(self) -> None:
        while True:
            with self._lock:
                if self._working:
                    self._write(f"\r\x1b[Kflownav: {self._line()}, {time.monotonic() - self._start:.0f} s ...")
            if self._stop.wait(EVERY_S):
                return

    def _finish(self) -> None:
        ticking, self._ticking = self._ticking, None
        if ticking is not None:
            self._stop.set()
            self._lock.release()
            ticking.join()
            self._lock.acquire()
            self._write("\r\x1b[K")
        if self._done:
            parts = "1 kernel" if self._done == 1 else f"{self._done} kernels"
            taken = time.monotonic() - self._start
            self._write(f"flownav: compiled {parts} ({self._what}) in {taken:.1f} s\n")

    @staticmethod
    def _on_terminal() -> bool:
        """Whether a line can be written over: not where another display has taken hold of standard error."""
        return sys.stderr is sys.__stderr__ and sys.stderr is not None and sys.stderr.isatty()

    @staticmethod
    def _write(text: str) -> None:
        if sys.stderr is not None:
            sys.stderr.write(text)
            sys.stderr.flush()


PROGRESS = Progress()
announce_compilation = PROGRESS.announce
compiling = PROGRESS.working
