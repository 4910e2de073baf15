"""Checks a certificate's folder: the parts that hold, that do not, and that could not be checked.

Everything that certificate.json states is made anew: files by their hashes, rows by their digests, the plan and every
figure from the requirement's file and the rows, the page from the figures, and a random sample of the flights by flying
them, to the bit. Parts that are not checked are named.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple

from flownav.campaigns.certification.again import SAMPLE
from flownav.campaigns.certification.cells import plan_of
from flownav.campaigns.certification.certify import Certificate, checked, judged_from, with_ranking
from flownav.campaigns.certification.signing import SIGNATURE, SIGNATURE_BYTES, is_signed_by, public_key
from flownav.campaigns.certification.written import FACTS, PAGE, assumed, drawn, hashes_again
from flownav.campaigns.chain import DamagedError, read_part, root_of
from flownav.campaigns.engines import Engine, Part
from flownav.campaigns.plan import Plan, Ready
from flownav.campaigns.requirement import Requirement, load_requirement
from flownav.campaigns.store import Dataset, plan_in
from flownav.core.errors import InputError
from flownav.core.guard import an_input, object_in
from flownav.core.measurement import Array
from flownav.core.parameter_files import shipped
from flownav.core.provenance import code_sha256, hash_of
from flownav.core.version import __version__
from flownav.report.campaign import render_certificate

Found = Literal["holds", "does not hold", "not checked"]
MOST_FACTS_BYTES = 8 << 20  # of certificate.json, which has some 0.1 MB; lists in it take thirty times as much
MADE_ANEW = ("worst", "flown_again")  # facts that need more than the rows
RANKING_KEYS = ("ranking", "split")
NEEDED = ("plan", "figures", "flights flown again")  # without these a folder can hold anything
NOT_LOOKED_AT = (
    ("flights of the ranking", "their outcomes are held by their hashes; they are not flown again"),
    ("records of the worst flights", "they are held by their hashes; `flownav report` reads them"),
    ("whether flights were planned and flown elsewhere before these", "no folder tells; ask who signs"),
)


class Check(NamedTuple):
    """A checked part, the finding, and a sentence on it."""

    what: str
    found: Found
    said: str


@dataclass
class Verification:
    """The checks of a folder so far. facts: certificate.json."""

    folder: Path
    facts: dict[str, Any]
    checks: list[Check] = field(default_factory=list)

    def note(self, what: str, wrong: str | None, right: str) -> bool:
        """Something that was looked at; wrong: what is wrong with it, None where nothing is. Whether it holds."""
        self.checks.append(
            Check(what, "holds" if wrong is None else "does not hold", right if wrong is None else wrong)
        )
        return wrong is None

    def leave(self, what: str, why: str) -> None:
        """Something that could not be looked at."""
        self.checks.append(Check(what, "not checked", why))

    @property
    def verification(self) -> str:
        """Whether it holds; "not shown" where nothing is wrong, but flights or figures could not be looked at."""
        if any(check.found == "does not hold" for check in self.checks):
            return "does not hold"
        shown = {check.what for check in self.checks if check.found == "holds"}
        return "holds" if shown >= set(NEEDED) else "not shown"

    @property
    def wrong(self) -> list[str]:
        """The checks that do not hold; of a certificate that is not shown, those that could not be made and why."""
        if self.verification == "not shown":
            return [f"{check.what}: not checked: {check.said}" for check in self.checks
                    if check.found == "not checked" and set(check.what.split(", ")) & set(NEEDED)]  # fmt: skip
        return [f"{check.what}: {check.said}" for check in self.checks if check.found == "does not hold"]

    def as_json(self) -> dict[str, Any]:
        """The checks as `flownav certify --verify --json` prints them."""
        stored = self.facts.get("requirement")
        return {
            "folder": str(self.folder),
            "requirement": stored.get("name") if isinstance(stored, dict) else None,
            "verdict": self.facts.get("verdict"),
            "flights": self.facts.get("flights"),
            "verification": self.verification,
            "checks": [check._asdict() for check in self.checks],
        }


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
        certificate = _figures(made, asked, plan) if _plan(made, plan, stored_plan, ours=ours) else None
        if certificate is not None and ours:
            _flights(made, certificate, engine, sample, on_progress)
            _ranking(made, certificate)
            _page(made, certificate)
        elif ours:
            made.leave("flights flown again, page", "they could only be others than those that stand here")
    else:
        made.leave("plan, figures, flights flown again", "the requirement's file is not there; name it as well")
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
    wrong = hashes_again({str(place_of(name)): digest for name, digest in list(files.items())[1:]}, None)
    if named is None and not path.is_file():
        return None
    asked = load_requirement(str(path))
    stated = [one["sentence"] for one in made.facts["requirement"]["requirements"]]
    ours = [table.sentence() for table in asked.requirement]
    differs = next((f"it asks for {own}, the certificate for {other}" for own, other in zip(ours, stated, strict=False)
                    if own != other), None)  # fmt: skip
    if differs is None and len(ours) != len(stated):
        differs = f"it asks for {len(ours)} things, the certificate for {len(stated)}"
    if differs is None and hash_of(path) != files[first]:
        differs = "it is another than when the flights were flown"
    made.note("requirement", differs and f"{path}: {differs}", f"{path} asks for what was judged")
    made.note("files that the flights are made from", wrong, f"{len(files)} files have their hashes")
    return asked


def place_of(name: str) -> Path:
    """Where a file lies that went in, by its name in the certificate."""
    own = "flownav/data/"
    return shipped(name.removeprefix(own)) if name.startswith(own) else Path(name)


def _is_of_this_code(made: Verification) -> bool:
    by = made.facts["made_by"]
    if by["flownav"] == __version__ and by["code_sha256"] == code_sha256():
        made.note("version", None, f"flownav {__version__}, of the same code")
        return True
    made.leave("version, flights flown again, page", f"made by flownav {by['flownav']} of another code than this one")
    return False


OF_THE_CODE = ("flownav", "code_sha256")  # keys of a plan


def _plan(made: Verification, plan: Plan, stored: dict[str, Any], *, ours: bool) -> bool:
    own = json.loads(json.dumps(plan.as_json))
    keys = [key for key in own | stored if ours or key not in OF_THE_CODE]
    differs = ", ".join(key for key in keys if own.get(key) != stored.get(key))
    wrong = f"campaign.json has another {differs} than the requirement makes" if differs else None
    return made.note("plan", wrong, f"seed {plan.seed}, {plan.flights} flights a cell, as the requirement makes them")


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
    again = certificate.again
    statement = (
        f"{again.sample} of {len(certificate.flown.rows)} drawn at random and {again.margin} at the margin are the same"
    )
    made.note("flights flown again", wrong, statement)


class _NotFlown:
    """Stands for a ranking's engine where its outcomes are not in the folder; `fly` cannot be used."""

    piece = 1

    def fly(
        self, cell: Ready, seed: int, parts: Sequence[Part], on_progress: Callable[[int], object]
    ) -> Iterator[tuple[Part, Array]]:
        """InputError."""
        raise InputError("outcomes of its samples are missing or damaged")


def _ranking(made: Verification, certificate: Certificate) -> None:
    """The ranking from the outcomes of its samples."""
    wrong, own = None, {key: None for key in RANKING_KEYS}
    try:
        if made.facts["ranking"] is not None:
            rows = made.facts["ranking_rows"]
            found = with_ranking(certificate, _NotFlown(), made.folder, rows).ranking
            own = json.loads(json.dumps(found))
        wrong = next((_differs(k, made.facts.get(k), own[k]) for k in own if made.facts.get(k) != own[k]), None)
    except InputError as error:
        wrong = str(error)
    made.note("ranking", wrong, "it is what its outcomes make" if made.facts["ranking"] else "none was asked for")


def _page(made: Verification, certificate: Certificate) -> None:
    """The page drawn again from the certificate's own facts."""
    facts = {key: value for key, value in made.facts.items() if key != "schema"}
    facts["files"] = {key: value for key, value in facts["files"].items() if key != "page"}
    page = render_certificate(facts, drawn(certificate)).encode("utf-8", errors="backslashreplace")
    same = hash_of(made.folder / PAGE) == hashlib.sha256(page).hexdigest()
    made.note("page", None if same else f"{PAGE} is not what {FACTS} makes", f"{PAGE} is what {FACTS} makes")
