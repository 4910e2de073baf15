"""Record: a flight as an object that shows itself, gives its tables as data frames, plots, reports and scores."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from flownav import record as ground
from flownav.api.table import Table
from flownav.errors import InputError


class Record(ground.Record):
    """A flight as data: what flew (`manifest`), its tables, and what they score.

    Example:
        >>> import flownav
        >>> record = flownav.fly("landing", seed=1)
    """

    @classmethod
    def of(cls, record: ground.Record) -> Record:
        """The same record, with what this class offers.

        Example:
            >>> 1
            1
        """
        tables: dict[str, Any] = {name: Table(table, name) for name, table in record.tables.items()}
        return cls(record.manifest, tables)

    @property
    def name(self) -> str:
        """What it is called after: its scenario, or its log without the suffix.

        Example:
            >>> flownav.fly("landing", seed=1, flight={"duration_s": 6.0}).name
            'landing'
        """
        return str(self.manifest.get("scenario") or Path(str(self.manifest.get("log") or "record")).stem)

    @property
    def scores(self) -> dict[str, Any]:
        """What scoring found of this flight."""
        found: dict[str, Any] = self.manifest.get("scores") or {}
        return found

    @property
    def verdict(self) -> str:
        """What is wrong with the flight or its log, in one line; "" where nothing is.

        Of a simulated flight: what it crashed on. Of a replay: that the flow itself is wrong, or that a horizontal
        sensor was heard and never fused.

        Example:
            >>> flownav.fly("landing", seed=1, flight={"duration_s": 6.0}).verdict
            ''
        """
        bad = [found["text"] for found in self.manifest.get("findings") or () if found.get("bad")]
        if bad:
            return str(bad[0])
        landing = self.scores.get("touchdown") or {}
        return (
            f"crashed: {', '.join(landing['broken'])}" if self.scores.get("crashed") and landing.get("broken") else ""
        )

    def save(self, path: str | Path, *, replacing: bool = False) -> Path:  # type: ignore[override]
        """Write the record as one file, whole or not at all; where it lies.

        replacing: whatever is there may go. InputError where nothing can be written there, or, unless replacing, where
        something lies that flownav did not write.

        Example:
            >>> flownav.fly("landing", seed=1, flight={"duration_s": 6.0}).save(folder / "landing.fnr").suffix
            '.fnr'
        """
        path = Path(path)
        try:
            super().save(path, replacing=replacing)
        except OSError as error:
            raise InputError(f"{path}: cannot be written ({error.strerror}); give another path") from error
        return path

    def report(self, path: str | Path | None = None) -> Path:
        """Write the record's report: one HTML page that works offline; where it lies.

        path: NAME.html in the folder that the program runs in, after the scenario or the log, where it is None.
        InputError where nothing can be written there.

        Example:
            >>> flownav.fly("landing", seed=1, flight={"duration_s": 6.0}).report(folder / "landing.html").name
            'landing.html'
        """
        from flownav.report.html import write_report

        page = Path(f"{self.name}.html") if path is None else Path(path)
        try:
            write_report(self, page)
        except OSError as error:
            raise InputError(f"{page}: cannot be written ({error.strerror}); give another path") from error
        return page

    @classmethod
    def load(cls, path: str | Path) -> Record:
        """Read a record that fly, replay or live wrote. InputError where the file is missing or no record.

        Example:
            >>> kept = flownav.fly("landing", seed=1, flight={"duration_s": 6.0}).save(folder / "landing.fnr")
            >>> flownav.Record.load(kept).name
            'landing'
        """
        return cls.of(ground.Record.load(Path(path)))


def load(path: str | Path) -> Record:
    """Read a record that fly, replay or live wrote. InputError where the file is missing or no record.

    Example:
        >>> import flownav
        >>> kept = flownav.fly("landing", seed=1, flight={"duration_s": 6.0}).save(folder / "landing.fnr")
        >>> flownav.load(kept).scores["crashed"]
        False
    """
    return Record.load(path)
