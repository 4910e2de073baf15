"""A vehicle's parameters held against what flownav needs: rows, what blocks arming, and a verdict."""

from __future__ import annotations

from typing import Any, NamedTuple

from flownav.live.setup.knowledge import SETS, Arming, Knowledge, Wanted
from flownav.mavlink.parameters import Value

EXTERNAL_NAV = 6  # AP_NavEKF_Source


class Row(NamedTuple):
    """A parameter beside what is wanted.

    status: `right`, `wrong` (must change), `unusual` (works, another value is advised), `shown` (nothing is wanted of
    it), `absent` (must be there), `not there` (need not be). has: None where the vehicle did not answer.
    """

    name: str
    has: float | None
    wanted: str
    status: str
    why: str
    set_to: float | None
    reboot: bool
    source: str

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return self._asdict()


class Block(NamedTuple):
    """Why the vehicle would not arm: a parameter, its value, the make's own words."""

    name: str
    has: float
    says: str
    source: str


def source_set(known: Knowledge, values: dict[str, Value], asked: int | None = None) -> int:
    """The source set for flownav: the one asked for, else one on external navigation, else the first free one."""
    if asked is not None or not known.first_source_set:
        return asked or 0

    def has(n: int, what: str) -> float:
        value = values.get(f"EK3_SRC{n}_{what}")
        return value.number if value else 0.0

    for n in SETS:
        if has(n, "POSXY") == EXTERNAL_NAV:
            return n
    free = [n for n in SETS[1:] if has(n, "POSXY") == 0.0 and has(n, "VELXY") == 0.0]
    return free[0] if free else known.first_source_set


def rows_of(wanted: list[Wanted], values: dict[str, Value]) -> list[Row]:
    """One row for each parameter that matters."""
    return [_any_of(row, values) if row.any_of else _row(row, values) for row in wanted]


def _row(row: Wanted, values: dict[str, Value]) -> Row:
    name = next((n for n in (row.name, *row.alternatives) if n in values), row.name)
    value = values.get(name)
    if value is None:
        status = "absent" if row.level == "must" and not row.optional else "not there"
        return Row(name, None, _words(row), status, row.why, None, row.reboot, row.source)
    fits = row.fits(value.number)
    status = "shown" if row.level == "shown" else "right" if fits else _fault(row)
    set_to = None if fits or row.level == "shown" else row.repaired(value.number)
    return Row(name, value.number, _words(row), status, row.why, set_to, row.reboot, row.source)


def _any_of(row: Wanted, values: dict[str, Value]) -> Row:
    fitting = [name for name in row.any_of if name in values and row.fits(values[name].number)]
    if fitting:
        return Row(fitting[0], values[fitting[0]].number, _words(row), "right", row.why, None, row.reboot, row.source)
    return Row(row.name, None, _words(row), _fault(row), row.why, None, row.reboot, row.source)


def _fault(row: Wanted) -> str:
    return "wrong" if row.level == "must" else "unusual"


def _words(row: Wanted) -> str:
    said = " ".join(part for part in (row.words(), row.unit) if part)
    return f"{said} ({row.meaning})" if row.meaning and said else said or row.meaning or row.unit


def blocks_of(known: Knowledge, values: dict[str, Value]) -> list[Block]:
    """What keeps the vehicle from arming, of what is known here."""

    def words(rule: Arming, name: str) -> str:
        needed = f"; {rule.needs} is {values[rule.needs].number:g}" if rule.needs else ""
        return rule.says.replace("{name}", name) + needed

    return [
        Block(name, values[name].number, words(rule, name), rule.source)
        for rule in known.arming
        for name in known.arming_names(rule)
        if rule.blocks(name, values)
    ]
