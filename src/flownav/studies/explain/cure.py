"""The cure of a cause: parameters of the log's own autopilot, each with its reason, and what to do by hand.

A parameter is computed from the log's content and the sign's figures. Where no parameter can cure a cause, none is
made up: the text states what to do.
"""

from collections.abc import Callable
from typing import NamedTuple

from flownav.lab.identification.parameter_file import AUTOPILOTS, FLOAT, INTEGER, Parameter, file_text
from flownav.studies.explain.autopilot_settings import ARDUPILOT, INAV, PX4
from flownav.studies.explain.case import Case
from flownav.studies.explain.sign import Sign

SUFFIX = AUTOPILOTS


class Cure(NamedTuple):
    """settings: the parameters, which may be none. by_hand: what to do besides, or instead. holds: whether the
    parameters alone are meant to cure it.
    """

    settings: tuple[Parameter, ...]
    by_hand: str
    holds: bool = True


Settings = tuple[Parameter, ...]
Curing = Callable[[Case, Sign, str], Cure]


def whole(name: str, value: float, reason: str) -> Parameter:
    """A parameter of a whole number."""
    return Parameter(name, value, INTEGER if float(value).is_integer() else FLOAT, reason)


def decimal(name: str, value: float, reason: str) -> Parameter:
    """A parameter of any number."""
    return Parameter(name, value, FLOAT, reason)


def either(
    dialect: str,
    px4: tuple[Parameter, ...],
    ardupilot: tuple[Parameter, ...],
    by_hand: str,
    holds: bool = True,
    inav: tuple[Parameter, ...] = (),
) -> Cure:
    """The cure by the dialect of the log's autopilot."""
    settings = {PX4: px4, ARDUPILOT: ardupilot, INAV: inav}.get(dialect, ())
    return Cure(settings, by_hand, holds and bool(settings))


def by_hand_only(words: str) -> Curing:
    """A cure that no parameter is."""
    return lambda case, sign, dialect: Cure((), words, holds=False)


def number(sign: Sign, name: str) -> float:
    """A figure of a sign."""
    return float(sign.figures[name])


def text_of(dialect: str, cures: list[tuple[str, Cure]]) -> str:
    """The parameter file; cures: of each cause its sentence."""
    lines = file_text(
        dialect, [setting for _, cure in cures for setting in cure.settings], tuple(words for words, _ in cures)
    )
    return lines.replace("# flownav identify, for", "# flownav explain, for", 1)
