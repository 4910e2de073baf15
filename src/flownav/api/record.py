"""Record: a flight as an object that shows itself, gives its tables as data frames, plots, reports and scores."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast

from flownav.api.arguments import checked, require_kind
from flownav.api.calls import writing
from flownav.api.table import Table
from flownav.core import record as ground
from flownav.core.errors import InputError


class Record(ground.Record):
    """A flight as data: what flew (`manifest`), its tables, and what they score.

    Every table is an attribute, and an entry: `record.estimate`, `record["estimate"]` (docs: records). A record that is
    rescored is another one; none changes.

    Example:
        >>> import flownav
        >>> record = flownav.fly("landing", seed=1)
        >>> record.estimate["pos_n_m"].dtype
        dtype('float64')
        >>> record.scores["touchdown"]["verdict"]
        'landed'
    """

    @checked
    def __init__(self, manifest: dict[str, Any] | None = None, tables: dict[str, Any] | None = None) -> None:
        super().__init__({} if manifest is None else manifest, {} if tables is None else tables)
        _require_kinds(self.manifest)
        for name, table in self.tables.items():
            require_kind(f"table {name}", table, dict[str, Any])

    @classmethod
    def of(cls, record: ground.Record) -> Record:
        """This class's view of a record; one that is of it already is given back.

        Example:
            >>> kept = flownav.fly("landing", flight={"duration_s": 6.0})
            >>> flownav.Record.of(kept).name
            'landing'
        """
        require_kind("record", record, ground.Record)
        tables: dict[str, Any] = {name: Table(table, name) for name, table in record.tables.items()}
        return cls(record.manifest, tables)

    @classmethod
    @checked
    def load(cls, path: str | Path) -> Record:
        """Read a record that fly, replay or live wrote. InputError where the file is missing or no record.

        Example:
            >>> kept = flownav.fly("landing", flight={"duration_s": 6.0}).save(folder / "landing.fnr")
            >>> flownav.Record.load(kept).name
            'landing'
        """
        return cls.of(ground.Record.load(Path(path)))

    # -- tables --------------------------------------------------------------------------------------------------
    def __getitem__(self, table: str) -> Table:
        if table not in self.tables:
            raise KeyError(f"this record has no table {table!r}; it has: {', '.join(self.tables)}")
        found = self.tables[table]
        return found if isinstance(found, Table) else Table(found, table)

    def __getattr__(self, name: str) -> Table:
        tables = self.__dict__.get("tables", {})
        if name.startswith("_") or name not in tables:
            raise AttributeError(f"this record has no table {name!r}; it has: {', '.join(tables)}")
        return self[name]

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self.tables})

    def __iter__(self) -> Iterator[str]:
        return iter(self.tables)

    def __contains__(self, table: object) -> bool:
        return table in self.tables

    # -- scores --------------------------------------------------------------------------------------------------
    @property
    def name(self) -> str:
        """The record's name: its scenario, or its log without the suffix.

        Example:
            >>> flownav.fly("landing", flight={"duration_s": 6.0}).name
            'landing'
        """
        return str(self.manifest.get("scenario") or Path(str(self.manifest.get("log") or "record")).stem)

    @property
    def scores(self) -> dict[str, Any]:
        """Scores from when it flew: the figures that `--json` prints; empty of a live session.

        Example:
            >>> flownav.fly("landing", seed=1).scores["touchdown"]["contact"]["distance_m"] < 1.0
            True
        """
        return cast(dict[str, Any], self.manifest.get("scores") or {})

    def score(self) -> dict[str, Any]:
        """The scores computed anew from the tables, by the functions that score every flight and replay.

        InputError where the record does not hold what they need: that of a live session, or of an older flownav.

        Example:
            >>> record = flownav.fly("landing", flight={"duration_s": 6.0})
            >>> record.score() == record.scores
            True
        """
        from flownav.scoring.recorded import scores_of_record

        return scores_of_record(self)

    @checked
    def rescore(self, estimate: Any, *, from_handover: bool = False, name: str = "another estimate") -> Record:
        """The record with another estimate in the place of its own, scored as ours is.

        estimate: a Table, a mapping of columns, or a data frame of pandas (t_s a column or the index), xarray, polars
        or Arrow: t_s [s] on the record's clock and pos_n_m, pos_e_m, pos_d_m; with vel_u_m_s, vel_v_m_s, vel_w_m_s (or
        vel_n_m_s, vel_e_m_s, vel_d_m_s), qw, qx, qy, qz, and the standard deviations and protection levels of
        `record.TABLES["estimate"]` where it has them. Scores of what it lacks are None.

        A simulated flight's estimate is compared with the truth, at the truth's instants: errors, and the touchdown as
        it would be put down to estimate, guidance and pad. The autopilot uses the navigator's estimate carried on to
        now and counted from where it has the pad, which is `record.flown` and which `scores` score; from_handover
        counts the other one likewise, from where it has the vehicle at the handover to the filter. A replay's estimate
        is compared with the log's GPS and its outages, and with its truth, turned and shifted onto it. InputError, one
        line, for what is missing, and for wrong units, shapes and times.

        Example:
            >>> record = flownav.fly("landing", seed=1)
            >>> record.rescore(estimate=record.flown).scores == record.scores
            True
            >>> shifted = {**record.flown, "pos_n_m": record.flown["pos_n_m"] + 1.0}
            >>> mean = record.rescore(estimate=shifted).scores["states"]["x"]["mean_error"]
            >>> round(mean - record.scores["states"]["x"]["mean_error"], 9)
            1.0
        """
        from flownav.api.rescoring import rescored

        return Record.of(rescored(self, estimate, name, from_handover=from_handover))

    @property
    def verdict(self) -> str:
        """Verdict on the flight or its log, in one line; "" where nothing is wrong.

        Of a simulated flight: the limit that it crashed on. Of a replay: that the flow itself is wrong, or that a
        horizontal sensor was received and never fused.

        Example:
            >>> flownav.fly("landing", flight={"duration_s": 6.0}).verdict
            ''
        """
        with _understood():
            bad = [found["text"] for found in self.manifest.get("findings") or () if found.get("bad")]
            landing = self.scores.get("touchdown") or {}
            if bad:
                return str(bad[0])
            if landing.get("reason"):
                return f"{landing['verdict']}: {landing['reason']}"
            crashed = self.scores.get("crashed") and landing.get("broken")
            return f"crashed: {', '.join(landing['broken'])}" if crashed else ""

    # -- what people look at -------------------------------------------------------------------------------------
    @checked
    def plot(self, what: str = "position") -> Any:
        """A Plotly figure: "position", "velocity", "errors", "innovations" or "path".

        Of a simulated flight, paths and errors of position are those that are scored, counted from the pad.

        InputError for another word, and where the record lacks what it shows.

        Example:
            >>> figure = flownav.fly("landing", flight={"duration_s": 6.0}).plot("errors")
            >>> figure.layout.xaxis6.title.text
            'time [s]'
        """
        from flownav.api.plots import figure_of

        return figure_of(self, what)

    @checked
    def report(self, path: str | Path | None = None) -> Path:
        """Write the record's report: one HTML page that works offline; where it lies.

        path: NAME.html in the folder that the program runs in, after the scenario or the log, where it is None.
        InputError where nothing can be written there.

        Example:
            >>> flownav.fly("landing", flight={"duration_s": 6.0}).report(folder / "landing.html").name
            'landing.html'
        """
        from flownav.report.html import write_report

        page = Path(f"{self.name}.html") if path is None else Path(path)
        self._require_times()
        with writing(page):
            write_report(self, page)
        return page

    @checked
    def save(self, path: str | Path, *, replacing: bool = False) -> Path:  # type: ignore[override]
        """Write the record as one file, whole or not at all; where it lies.

        replacing: whatever is there may go. InputError where nothing can be written there, or, unless replacing, where
        something lies that flownav did not write.

        Example:
            >>> flownav.fly("landing", flight={"duration_s": 6.0}).save(folder / "landing.fnr").suffix
            '.fnr'
        """
        path = Path(path)
        self._require_times()
        with writing(path):
            super().save(path, replacing=replacing)
        return path

    @checked
    def export(self, to: str, path: str | Path | None = None, *, frame: str | None = None) -> list[Path]:
        """Write the record for another tool; the files that were written.

        to: mcap, tum, euroc, parquet, csv or ulog (docs: export). path: beside the program, after the record's name,
        where it is None. frame: "ned" or "enu", of tum and euroc. InputError for an unknown format, where the record
        lacks what it needs, or nothing can be written there.

        Example:
            >>> flownav.fly("landing", flight={"duration_s": 6.0}).export("tum", folder / "landing.tum")[0].suffix
            '.tum'
        """
        from flownav.export.formats import destination, export

        target = destination(Path(f"{self.name}.fnr"), to, None if path is None else Path(path))
        self._require_times()
        with writing(target):
            return [Path(file) for file in export(self, to, target, frame).files]

    def _require_times(self) -> None:
        """InputError where a table has no times, or ones that no flight can have and no reader would take."""
        from flownav.core.record_file import check_times

        try:
            check_times(self.tables, ground.IN_ORDER, ground.LATEST_S, ground.LONGEST_S)
        except KeyError as error:
            raise InputError("a table of this record has no t_s") from error
        except (ValueError, TypeError, AttributeError) as error:
            raise InputError(f"this record cannot be written: {error}") from error

    def __repr__(self) -> str:
        from flownav.api.plots import lines_of

        with _understood():
            return "\n".join(lines_of(self))

    def _repr_html_(self) -> str:
        from flownav.api.plots import html_of

        with _understood():
            return html_of(self)


def _require_kinds(manifest: Mapping[str, Any]) -> None:
    """InputError where a key of a manifest is of a kind that the reader of its file would refuse."""
    from flownav.core.record_file import check_manifest

    try:
        check_manifest(json.loads(json.dumps(manifest, default=str)))
    except (TypeError, ValueError, RecursionError) as error:
        raise InputError(f"no record has this manifest: {error}") from error


@contextmanager
def _understood() -> Iterator[None]:
    """InputError where what lies inside a manifest's keys is of another kind than flownav writes there."""
    try:
        yield
    except (AttributeError, TypeError, KeyError, ValueError, IndexError) as error:
        what = " ".join(str(error).split())[:200]
        raise InputError(f"manifest: flownav writes other scores or facts ({what}); make the record anew") from error


def load(path: str | Path) -> Record:
    """Read a record that fly, replay or live wrote.

    path: the .fnr file. InputError where it is missing or no record.

    Example:
        >>> import flownav
        >>> kept = flownav.fly("landing", flight={"duration_s": 6.0}).save(folder / "landing.fnr")
        >>> flownav.load(kept).scores["crashed"]
        False
    """
    return Record.load(path)
