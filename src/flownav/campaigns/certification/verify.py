"""Checks a certificate's folder: the parts that hold, that do not, and that could not be checked.

Everything that certificate.json states is made anew: files by their hashes, rows by their digests, the plan from the
requirement's file, what each flight drew from the plan, every figure from the rows, the page from the figures, and a
random sample of the flights by flying them, to the bit. Parts that are not checked are named.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from flownav.campaigns.certification.again import SAMPLE
from flownav.campaigns.certification.cells import plan_of
from flownav.campaigns.certification.certify import Certificate, checked, judged_from, with_ranking
from flownav.campaigns.certification.findings import NOT_LOOKED_AT, Verification
from flownav.campaigns.certification.remade import require_drawn, require_numbered
from flownav.campaigns.certification.signing import SIGNATURE, SIGNATURE_BYTES, is_signed_by, public_key
from flownav.campaigns.certification.stated import as_written
from flownav.campaigns.certification.written import (
    FACTS,
    PAGE,
    assumed,
    drawn,
    files_in,
    hashes,
    hashes_again,
    place_of,
    written,
)
from flownav.campaigns.chain import DamagedError, read_part, root_of
from flownav.campaigns.engines import Engine, Part
from flownav.campaigns.plan import Plan, Ready
from flownav.campaigns.requirement import Requirement, load_requirement
from flownav.campaigns.store import LOCK, Dataset, plan_in
from flownav.core.errors import InputError
from flownav.core.guard import an_input, object_in
from flownav.core.measurement import Array
from flownav.core.provenance import code_sha256, hash_of
from flownav.core.version import __version__
from flownav.report.campaign import render_certificate

MOST_FACTS_BYTES = 8 << 20  # of certificate.json, which has some 0.1 MB; lists in it take thirty times as much
SHOWN = 3  # files that are named
MADE_ANEW = ("worst", "flown_again")  # facts that need more than the rows
RANKING_KEYS = ("ranking", "split")


def verify(
    folder: Path, engine: Engine, *, requirement: str | None = None, sample: int = SAMPLE, key: Path | None = None,
    on_progress: Callable[[int], object] = lambda flown: None,
) -> Verification:  # fmt: skip
    """Look a certificate's folder through. requirement: its file, where it lies elsewhere now; sample: flights that are
    flown again; key: the signer's public key. InputError where the folder holds no certificate, or the key is none.
    """
    made = Verification(folder, _facts_in(folder))
    try:
        _look(made, engine, requirement, sample, key, on_progress)
    except (KeyError, TypeError, AttributeError, ValueError, IndexError) as error:  # facts of another make
        made.note(FACTS, f"is not as certify writes it ({type(error).__name__}: {error})"[:200], "")
    return made


def _look(
    made: Verification, engine: Engine, requirement: str | None, sample: int, key: Path | None,
    on_progress: Callable[[int], object],
) -> None:  # fmt: skip
    _signature(made, None if key is None else public_key(key))
    _files(made)
    stored_plan = plan_in(made.folder)
    _rows(made, stored_plan)
    asked = _requirement(made, requirement)
    ours = _is_of_this_code(made)
    if asked is not None:
        chosen = made.facts["chosen"]
        plan = plan_of(asked, chosen["flights"], chosen["vehicle"])
        _made_from(made, asked, plan, requirement)
        sound = _plan(made, plan, stored_plan, ours=ours) and _drawn(made, plan, ours)
        certificate = _figures(made, asked, plan) if sound else None
        if certificate is not None and ours:
            _flights(made, certificate, engine, sample, on_progress)
            _whole(made, _ranking(made, certificate))
            _page(made, certificate)
        elif ours:
            made.leave("flights flown again, page", "they could only be others than those that stand here")
    else:
        made.leave("plan, flights and inputs, figures, flights flown again",
                   "the requirement's file is not there; name it as well")  # fmt: skip
    for what, why in NOT_LOOKED_AT:
        made.leave(what, why)


def _facts_in(folder: Path) -> dict[str, Any]:
    facts = object_in(folder / FACTS, "give the folder of a certificate", MOST_FACTS_BYTES)
    if not {"verdict", "files", "made_by"} <= set(facts):
        raise InputError(f"{folder / FACTS}: is no certificate; give the folder of one")
    return facts


def _signature(made: Verification, key: Any) -> None:
    path = made.folder / SIGNATURE
    if not path.is_file():
        if key is None:
            made.leave("signature", "there is none, so that who made this folder is not known")
        else:
            made.note("signature", f"there is no {SIGNATURE} for this key", "")
        return
    if key is None:
        made.leave("signature", "there is one; --key holds it against the signer's public key")
        return
    with an_input(path).open("rb") as file:
        signature = file.read(SIGNATURE_BYTES + 1)
    good = is_signed_by((made.folder / FACTS).read_bytes(), signature, key)
    made.note(
        "signature", None if good else "certificate.json was not signed by this key", "certificate.json is signed"
    )


def _files(made: Verification) -> None:
    """The hashes of what lies in the folder."""
    hashes = made.facts["files"]["out"] | made.facts["files"].get("page", {})
    needed = {"campaign.json", PAGE} - set(hashes)
    if needed:
        made.note("files", f"{', '.join(sorted(needed))}: has no hash", "")
    made.note("files", hashes_again(hashes, made.folder), f"{len(hashes)} files have their hashes")
    others = [name for name in _names_in(made.folder) if name not in {*hashes, FACTS, SIGNATURE, LOCK}]
    if others:
        more = f" and {len(others) - SHOWN} more" if len(others) > SHOWN else ""
        made.leave("files without a hash", f"{', '.join(others[:SHOWN])}{more}: no part of the certificate")


def _names_in(folder: Path) -> list[str]:
    """The files of a folder, by their names relative to it; links to folders are not followed."""
    found = [Path(place, name) for place, _, names in os.walk(folder) for name in names]
    return sorted(path.relative_to(folder).as_posix() for path in found)


def _rows(made: Verification, plan: dict[str, Any]) -> None:
    """The digests of all flights, from the plan on, and that their files are those that have hashes."""
    rows, wrong = 0, None
    data, hashes = Dataset(made.folder), set(made.facts["files"]["out"])
    for cell in range(len(plan["cells"])):
        link = root_of(plan, cell)
        for path in data.parts(cell):
            name = path.relative_to(made.folder).as_posix()
            try:
                part = read_part(path)
                if part.before != link:
                    raise DamagedError("it does not follow the flights before it")
            except DamagedError as error:
                wrong = wrong or f"{name}: {error}"
                break
            rows, link = rows + len(part.table), part.last
            wrong = wrong or (None if name in hashes else f"{name}: has no hash")
    made.note("digests", wrong, f"{rows} flights follow each other from the plan on")


def _requirement(made: Verification, named: str | None) -> Requirement | None:
    """The requirement, from its file where that is as it was. None where it is not there."""
    files = made.facts["files"]["in"]
    first = next(iter(files))
    path = Path(named) if named else place_of(first)
    if named is None and not path.is_file():
        return None
    asked = load_requirement(str(path))
    stated = [one["sentence"] for one in made.facts["requirement"]["requirements"]]
    ours = [table.sentence() for table in asked.requirement]
    differs = next((f"it asks for {own}, the certificate for {other}" for own, other in zip(ours, stated, strict=False)
                    if own != other), None)  # fmt: skip
    if differs is None and len(ours) != len(stated):
        differs = f"it asks for {len(ours)} things, the certificate for {len(stated)}"
    if differs is None and hash_of(an_input(path)) != files[first]:
        differs = "it is another than when the flights were flown"
    made.note("requirement", differs and f"{path}: {differs}", f"{path} asks for what was judged")
    return asked


def _made_from(made: Verification, asked: Requirement, plan: Plan, named: str | None) -> None:
    """That the certificate has the hashes of all other files that its flights are made from, and of no more."""
    stated = made.facts["files"]["in"]
    theirs = [(Path(name).name, digest) for name, digest in stated.items()][1:]
    path = named or str(place_of(next(iter(stated))))
    ours = [(Path(name).name, digest) for name, digest in hashes(files_in(path, asked.scenario, plan)).items()][1:]
    wrong = None
    for name, digest in ours:
        if (name, digest) not in theirs:
            known = any(other == name for other, _ in theirs)
            wrong = wrong or f"{name}: has {'another SHA-256 than the certificate says' if known else 'no hash'}"
    strange = next((name for name, digest in theirs if (name, digest) not in ours), None)
    if wrong is None and strange is not None:
        wrong = f"{strange}: the flights are not made from it"
    made.note("files that the flights are made from", wrong, f"{len(stated)} files have their hashes")


def _is_of_this_code(made: Verification) -> bool:
    by = made.facts["made_by"]
    if by["flownav"] == __version__ and by["code_sha256"] == code_sha256():
        made.note("version", None, f"flownav {__version__}, of the same code")
        return True
    made.leave(
        "version, flights and inputs, flights flown again, page",
        f"made by flownav {by['flownav']} of another code than this one",
    )
    return False


OF_THE_CODE = ("flownav", "code_sha256")  # keys of a plan


def _plan(made: Verification, plan: Plan, stored: dict[str, Any], *, ours: bool) -> bool:
    own = json.loads(json.dumps(plan.as_json))
    keys = [key for key in own | stored if ours or key not in OF_THE_CODE]
    differs = ", ".join(key for key in keys if own.get(key) != stored.get(key))
    wrong = f"campaign.json has another {differs} than the requirement makes" if differs else None
    return made.note("plan", wrong, f"seed {plan.seed}, {plan.flights} flights a cell, as the requirement makes them")


def _drawn(made: Verification, plan: Plan, ours: bool) -> bool:
    """That the rows are all of the plan's flights, by its inputs, or by their numbers where another version drew."""
    wrong, flights = None, plan.flights * len(plan.cells)
    try:
        (require_drawn if ours else require_numbered)(plan, Dataset(made.folder))
    except InputError as error:
        wrong = str(error)
    if ours:
        return made.note("flights and inputs", wrong, f"all {flights} rows are the plan's, with what it draws for each")
    return made.note("flights", wrong, f"all {flights} rows have the numbers of the plan's")


def _figures(made: Verification, asked: Requirement, plan: Plan) -> Certificate | None:
    """Every figure of certificate.json but the ranking's, from the rows; what they make, None where that is another."""
    try:
        certificate = judged_from(asked, plan, Dataset(made.folder))
    except InputError as error:
        made.note("figures", str(error), "")
        return None
    own = json.loads(json.dumps(certificate.as_json() | {"assumed": assumed(plan)}))
    keys = [key for key in own if key not in (*MADE_ANEW, "ranking", "split")]
    wrong = next(
        (_differs(key, made.facts.get(key), own[key]) for key in keys if made.facts.get(key) != own[key]), None
    )
    worst = [{name: one.get(name) for name in own["worst"][0]} for one in made.facts["worst"]]
    if wrong is None and worst != own["worst"]:
        wrong = "worst: the flights are others"
    good = made.note("figures", wrong, f"the verdict, {made.facts['verdict']}, and all figures are those of the rows")
    return certificate if good else None


def _differs(key: str, stored: Any, own: Any) -> str:
    """The first difference, by its dotted name, as deep as both are tables."""
    if isinstance(stored, dict) and isinstance(own, dict):
        inner = next((name for name in own | stored if own.get(name) != stored.get(name)), "")
        return _differs(f"{key}.{inner}", stored.get(inner), own.get(inner))
    if isinstance(stored, list) and isinstance(own, list) and len(stored) == len(own):
        place = next((k for k, pair in enumerate(zip(stored, own, strict=True)) if pair[0] != pair[1]), 0)
        return _differs(f"{key}[{place}]", stored[place], own[place])
    return f"{key} is {_short(stored)} in the certificate and {_short(own)} by the rows"


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 80 else f"{text[:80]}..."


def _flights(
    made: Verification, certificate: Certificate, engine: Engine, sample: int, on_progress: Callable[[int], object]
) -> None:
    wrong = None
    try:
        certificate = checked(certificate, Dataset(made.folder), engine, sample, on_progress)
    except InputError as error:
        wrong = str(error)
    again, flights = certificate.again, len(certificate.flown.rows)
    statement = f"{again.sample} of {flights} drawn at random and {again.margin} at the margin are the same"
    made.note("flights flown again", wrong, statement)
    left = flights - again.sample - again.margin
    if wrong is None and left > 0:
        made.leave("scores of the other flights", f"{left} or more; `--again {flights}` flies all")


class _NotFlown:
    """Stands for a ranking's engine where its outcomes are not in the folder; `fly` cannot be used."""

    piece = 1

    def fly(
        self, cell: Ready, seed: int, parts: Sequence[Part], on_progress: Callable[[int], object]
    ) -> Iterator[tuple[Part, Array]]:
        """InputError."""
        raise InputError("outcomes of its samples are missing or damaged")


def _ranking(made: Verification, certificate: Certificate) -> Certificate:
    """The ranking from the outcomes of its samples; the certificate with it, where there is one."""
    wrong, own = None, {key: None for key in RANKING_KEYS}
    try:
        if made.facts["ranking"] is not None:
            rows = made.facts["ranking_rows"]
            certificate = with_ranking(certificate, _NotFlown(), made.folder, rows)
            own = json.loads(json.dumps(certificate.ranking))
        wrong = next((_differs(k, made.facts.get(k), own[k]) for k in own if made.facts.get(k) != own[k]), None)
    except InputError as error:
        wrong = str(error)
    made.note("ranking", wrong, "it is what its outcomes make" if made.facts["ranking"] else "none was asked for")
    return certificate


def _whole(made: Verification, certificate: Certificate) -> None:
    """That certificate.json is as certify writes it, to the last character, so that it holds nothing more."""
    stated = made.facts
    own = as_written(stated, certificate, made.folder)
    wrong = next((f"{key} is not as certify writes it" for key in own | stated
                  if json.dumps(own.get(key)) != json.dumps(stated.get(key))), None)  # fmt: skip
    if wrong is None and (made.folder / FACTS).read_text(encoding="utf-8") != written(own):
        wrong = "it is not written as certify writes it"
    made.note(FACTS, wrong, "it has what certify writes, and nothing more")


def _page(made: Verification, certificate: Certificate) -> None:
    """The page drawn again from the certificate's own facts."""
    facts = {key: value for key, value in made.facts.items() if key != "schema"}
    facts["files"] = {key: value for key, value in facts["files"].items() if key != "page"}
    page = render_certificate(facts, drawn(certificate)).encode("utf-8", errors="backslashreplace")
    same = hash_of(made.folder / PAGE) == hashlib.sha256(page).hexdigest()
    made.note("page", None if same else f"{PAGE} is not what {FACTS} makes", f"{PAGE} is what {FACTS} makes")
