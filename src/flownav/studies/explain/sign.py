"""The result of a hypothesis on a log: a sign with its strength, its seconds and its picture; or what the log lacks."""

from typing import NamedTuple

from flownav.core.measurement import Array

Window = tuple[float, float]


class Trace(NamedTuple):
    """A line, or dots, of a picture: a role of the report's palette, a name, instants [s] and values (n,)."""

    role: str
    name: str
    t_s: Array
    value: Array
    dots: bool = False


class Picture(NamedTuple):
    """Traces on one axis over time; label: with unit; words: what to look for."""

    label: str
    traces: tuple[Trace, ...]
    words: str = ""


class Sign(NamedTuple):
    """strength: the figure over what no sound vehicle exceeds (1: as likely as not). window_s: from when to when.

    figures: numbers and words for the sentence, by the names that it has for them.
    """

    strength: float
    window_s: Window
    figures: dict[str, float | str] = {}  # noqa: RUF012 (a sign's figures are never changed)
    pictures: tuple[Picture, ...] = ()

    @property
    def lasts_s(self) -> float:
        """How long the window is."""
        return self.window_s[1] - self.window_s[0]


class Lack(NamedTuple):
    """A hypothesis that could not be looked into: what the log lacks for it, in words."""

    what: str


Found = Sign | Lack


def nothing(window_s: Window, strength: float = 0.0, **figures: float | str) -> Sign:
    """A sign that is none: the hypothesis was looked into."""
    return Sign(strength, window_s, figures)
