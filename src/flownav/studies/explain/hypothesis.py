"""A row of the table of hypotheses, and the words of each cause."""

import tomllib
from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

from flownav.core.parameter_files import shipped
from flownav.studies.explain.case import Case
from flownav.studies.explain.cure import Curing
from flownav.studies.explain.sign import Found
from flownav.studies.explain.trials import Repairing

WORDS_FILE = "causes.toml"


class Hypothesis(NamedTuple):
    """name; what it needs of the log; the parameters that it reads; the look, the trial and the cure."""

    name: str
    needs: str
    parameters: tuple[str, ...]
    look: Callable[[Case], Found]
    repair: Repairing | None
    cure: Curing
    explains: tuple[str, ...] = ()
    named_last: bool = False  # it does less harm than any other

    @property
    def words(self) -> dict[str, str]:
        """title, sentence, looks, why, prevent; inav where INAV has a setting."""
        return words()[self.name]


@lru_cache(maxsize=1)
def words() -> dict[str, dict[str, str]]:
    """The words of each cause, by its name."""
    content = tomllib.loads(shipped(WORDS_FILE).read_text(encoding="utf-8"))
    return {name: group for name, group in content.items() if isinstance(group, dict)}
