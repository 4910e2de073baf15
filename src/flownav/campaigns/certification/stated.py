"""The facts of a certificate as certify writes them, with those in it that no flight and no file can show anew."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from flownav.campaigns.certification.again import deciding
from flownav.campaigns.certification.certify import Certificate
from flownav.campaigns.certification.written import PAGE, SCHEMA, assumed, files_out, made_by
from flownav.campaigns.run import record_path
from flownav.campaigns.store import RECORDS


def as_written(stated: Mapping[str, Any], certificate: Certificate, folder: Path) -> dict[str, Any]:
    """The facts that certify writes. stated: certificate.json, from which those are taken that only it can know.

    They are command, time and libraries, how many flights were drawn to be flown again, hashes, and which of the worst
    have a record.

    KeyError, TypeError or ValueError where it lacks them.
    """
    hashes = stated["files"]["out"]
    names = {path.relative_to(folder).as_posix() for path in files_out(certificate.plan, folder)}
    pairs = zip(certificate.worst, stated["worst"], strict=True)
    own = certificate.as_json() | {
        "flown_again": _again(stated["flown_again"], certificate),
        "worst": [_worst(certificate, flight, one, hashes) for flight, one in pairs],
    }
    return (
        {"schema": SCHEMA}
        | own
        | {
            "assumed": assumed(certificate.plan),
            "made_by": {key: stated["made_by"].get(key) for key in made_by()},
            "files": {
                "in": stated["files"]["in"],
                "out": {name: digest for name, digest in hashes.items() if name in names},
                "page": {PAGE: stated["files"]["page"][PAGE]},
            },
        }
    )


def _again(stated: Mapping[str, Any], certificate: Certificate) -> dict[str, int]:
    """How many flights were flown again: all that decided, and as many at random as is stated, from 1 to all."""
    flights, sample = len(certificate.flown.rows), stated["sample"]
    margin = deciding(certificate.requirement, certificate.judgements, certificate.flown.rows)
    return {"sample": sample if sample in range(1, flights + 1) else flights, "margin": len(margin)}


def _worst(certificate: Certificate, flight: int, stated: Mapping[str, Any], hashes: Collection[str]) -> dict[str, Any]:
    """One of the worst flights; its record and its report where it has them, and their hashes are there."""
    own = certificate.facts_of(flight)
    if "record" not in stated:
        return own
    record = record_path(Path(RECORDS), own["cell_number"], own["flight"])
    names = {"record": record.as_posix(), "report": record.with_suffix(".html").as_posix()}
    return own | {key: name for key, name in names.items() if name in hashes}
