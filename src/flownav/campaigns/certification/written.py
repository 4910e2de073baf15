"""A certificate written down: records of the worst flights, hashes of every file, JSON and the page."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from flownav.campaigns.again import record_again, record_path
from flownav.campaigns.certification.assumed import assumed, files_in, hashes
from flownav.campaigns.certification.certify import Certificate
from flownav.campaigns.certification.envelope import failing
from flownav.campaigns.certification.ranked import FOLDER as RANKING
from flownav.campaigns.measures import MEASURES, NOT_LANDED, ROW_COLUMNS, measured
from flownav.campaigns.store import RECORDS, Dataset, Store
from flownav.core.provenance import code_sha256, command_line, hash_of, provenance
from flownav.report.campaign import render_certificate
from flownav.report.html import write_report

PAGE, FACTS = "certificate.html", "certificate.json"
SCHEMA = 1  # schemas/certificate.json says what stands in it


def write_certificate(
    certificate: Certificate, store: Store, name: str, records: int,
    on_recorded: Callable[[int], object] = lambda done: None,
) -> dict[str, Any]:  # fmt: skip
    """Records and reports of so many of the worst flights, certificate.json and certificate.html; the facts of them.

    name: the requirement's, as it was given. OSError where a file cannot be written.
    """
    facts = certificate.as_json()
    for flight, told in zip(certificate.worst[:records], facts["worst"], strict=False):
        told["record"], told["report"] = _recorded(certificate, flight, store.folder, name)
        on_recorded(1)
    facts |= {"assumed": assumed(certificate.plan), "made_by": _made_by(), "files": _files(certificate, store, name)}
    page = render_certificate(facts, drawn(certificate))
    store.keep_text(PAGE, page)
    facts["files"]["page"] = {PAGE: hash_of(store.folder / PAGE)}
    store.keep_text(FACTS, json.dumps({"schema": SCHEMA} | facts, indent=1) + "\n")
    return facts | {"out": str(store.folder / PAGE)}


def drawn(certificate: Certificate) -> dict[str, Any]:
    """What the page's figures show of each flight: figures of the measures, places of the touchdowns [m]."""
    rows, requirement = certificate.flown.rows, certificate.requirement
    measures = [table.measure for table in requirement.requirement]
    of = "rest" if "touchdown.rest_m" in measures else "contact"
    of_touchdown = any(MEASURES[name].of_touchdown or name == NOT_LANDED for name in measures)
    good = np.isfinite(measured("touchdown.rest_m" if of == "rest" else "touchdown.horizontal_m", rows))
    north_m, east_m = (
        np.where(good, rows[:, ROW_COLUMNS.index(f"touchdown.{of}.{axis}_m")], np.inf) for axis in ("north", "east")
    )
    return {
        "figures": {table.measure: measured(table.measure, rows) for table in requirement.requirement},
        "failed": failing(requirement, rows).any(axis=0),
        "of": of,
        "north_m": north_m,
        "east_m": east_m,
        "places": of_touchdown and bool(np.isfinite(north_m).any()),
    }


def _recorded(certificate: Certificate, flight: int, folder: Path, name: str) -> tuple[str, str]:
    """Record and report of one flight; where they lie, relative to the page."""
    cell, number = int(certificate.flown.cell[flight]), int(certificate.flown.number[flight])
    path = record_path(folder / RECORDS, cell, number)
    page = path.with_suffix(".html")
    record = record_again(certificate.plan, cell, number)
    record.manifest["command"] = f"flownav certify {name}"
    record.save(path)
    write_report(record, page)
    return path.relative_to(folder).as_posix(), page.relative_to(folder).as_posix()


def _files(certificate: Certificate, store: Store, name: str) -> dict[str, dict[str, str]]:
    """SHA-256 of everything that went in and came out, but for the page and the facts."""
    folder, data = store.folder, Dataset(store.folder)
    out = [path for cell in range(len(certificate.plan.cells)) for path in data.parts(cell)]
    out += sorted((folder / RANKING).glob("*/*.parquet")) + sorted((folder / RECORDS).glob("*"))
    went_in = files_in(name, certificate.requirement.scenario, certificate.plan)
    return {"in": hashes(went_in), "out": hashes([folder / "campaign.json", *out], folder)}


def _made_by() -> dict[str, Any]:
    """The command, the versions and the code."""
    made = provenance()
    return {
        "command": command_line(),
        "flownav": made["flownav"],
        "code_sha256": code_sha256(),
        "python": made["python"],
        **made["libraries"],
        "written_utc": made["written_utc"],
    }
