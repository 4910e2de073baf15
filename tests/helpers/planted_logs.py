"""Planted faults for the tests: logs as files, each made once."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from flownav.logs.log import Log
from flownav.logs.open_log import open_log
from planted.planted import Planted, clean, listed, written


@cache
def fault(which: str, name: str) -> Planted:
    """A fault of a list by its name."""
    return next(one for one in listed(which) if one.name == name)


def log_of(one: Planted, folder: Path) -> Log:
    """Its log, written in the autopilot's format and read back."""
    return open_log(written(one, folder))


def sound(kind: str, dialect: str, seed: int) -> Planted:
    """A flight without a fault."""
    return clean(kind, dialect, seed)
