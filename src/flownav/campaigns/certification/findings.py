"""Findings about a certificate's folder: of each part whether it holds, does not hold, or was not checked."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple

Found = Literal["holds", "does not hold", "not checked"]
NEEDED = ("plan", "flights and inputs", "figures", "flights flown again")  # without these a folder can hold anything
NOT_LOOKED_AT = (
    ("flights of the ranking", "their outcomes are held by their hashes; they are not flown again"),
    ("records of the worst flights", "they are held by their hashes; `flownav report` reads them"),
    (
        "command, time, libraries, and how many flights were drawn when it was written",
        "they are as who wrote them states",
    ),
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
