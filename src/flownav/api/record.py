"""Record: a flight as an object that shows itself, gives its tables as data frames, plots, reports and scores."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from flownav import record as ground
from flownav.api.table import Table


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
        return f"crashed: {', '.join(landing['broken'])}" if self.scores.get("crashed") and landing.get("broken") else ""

    @classmethod
    def load(cls, path: str | Path) -> Record:
        """Read a record file."""
        return cls.of(ground.Record.load(Path(path)))
