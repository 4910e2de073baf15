"""From signs to a verdict: how likely each cause is, which is another's consequence, and which is the first.

How likely a cause is by its sign: the odds are a power of the strength. `make explain CALIBRATE=1` fits the two numbers
on made flights with and without faults, apart from those that judge it; those here are near them, and round.
"""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flownav.logs.log import Log
from flownav.studies.explain.astray import Astray
from flownav.studies.explain.autopilot_settings import dialect_of
from flownav.studies.explain.case import Case
from flownav.studies.explain.cure import Cure, text_of
from flownav.studies.explain.hypothesis import Hypothesis
from flownav.studies.explain.replay_verdict import difference
from flownav.studies.explain.sign import Found, Lack, Picture, Sign, Window
from flownav.studies.explain.table import BY_NAME, HYPOTHESES
from flownav.studies.explain.trials import Trial, tried

STEEPNESS, MIDDLE = 6.0, 1.0  # odds = (strength / MIDDLE) ** STEEPNESS
LIKELY, SURE, SHOWN = 0.5, 0.95, 0.02
TRIED_FROM, MOST_TRIED = 0.3, 8
WORSE, WORSE_FACTOR = -0.5, 0.5  # a repair that makes the innovations worse by half speaks against the cause
NAMED_LAST = -10.0  # of a rank
STRONGEST, AS_SURE_AS_ANY = 6.0, 3.0


class Checked(NamedTuple):
    """One hypothesis looked into: its sign, how likely it is, what was tried, and whose consequence it is."""

    hypothesis: Hypothesis
    sign: Sign
    probability: float
    trial: Trial | None = None
    consequence_of: str = ""


class Finding(NamedTuple):
    """A cause that is named.

    name, title, sentence; window_s: the seconds; probability; explained: share of the sensors' disagreement with the
    path that the repair takes away (None where nothing could be replayed, or nothing disagrees); astray: how far the
    autopilot's own estimate was off meanwhile (None where nothing shows it); figures: the numbers of the sentence;
    pictures; cure; beside_replay: why `flownav replay` calls the blamed sensor harmless all the same, else "".
    """

    name: str
    title: str
    sentence: str
    window_s: Window
    probability: float
    explained: float | None
    astray: Astray | None
    figures: dict[str, float | str]
    pictures: tuple[Picture, ...]
    cure: Cure
    beside_replay: str = ""


class Explanation(NamedTuple):
    """The explanation of a log: the causes, the first one first; every hypothesis that was checked; and the data that
    each of the others needs and the log lacks.
    """

    log: str
    dialect: str
    findings: tuple[Finding, ...]
    checked: tuple[Checked, ...]
    missing: tuple[tuple[str, str], ...]

    @property
    def first(self) -> Finding | None:
        """The first cause; None where nothing wrong was found."""
        return self.findings[0] if self.findings else None

    @property
    def verdict(self) -> str:
        """In one sentence, with the seconds and how sure it is."""
        if self.first is None:
            return f"Nothing wrong was found; {len(self.checked)} causes were looked for."
        t0, t1 = self.first.window_s
        phrases = [f"{t0:.0f} to {t1:.0f} s", f"{min(100.0 * self.first.probability, 99.0):.0f} % sure"]
        astray = self.first.astray
        if astray is not None and astray.is_large:
            phrases.append(f"meanwhile {astray.words}")
        return f"{self.first.sentence} ({'; '.join(phrases)})"

    def cure_text(self, dialect: str = "") -> str:
        """The parameter file against the causes, for the log's own autopilot or another. ValueError of no dialect."""
        chosen = dialect or self.dialect
        if not chosen:
            raise ValueError("the log does not show whose parameters are needed: px4, ardupilot or inav")
        return text_of(chosen, [(one.sentence, one.cure) for one in self.findings])


def probability_of(strength: float) -> float:
    """How likely a cause is by its sign alone."""
    if strength <= 0.0:
        return 0.0
    odds = math.exp(STEEPNESS * math.log(strength / MIDDLE))
    return odds / (1.0 + odds)


def explain(log: Log, *, dialect: str = "", quick: bool = False) -> Explanation:
    """Look into every hypothesis, try those that remain, and name the causes.

    dialect: whose parameters the cure is for, where the log does not show it. quick: nothing is tried.
    """
    case = Case(log)
    checked, missing = looked(case)
    checked = consequences(checked)
    if not quick:
        checked = _tried(case, checked)
    chosen = dialect or dialect_of(log.parameters)
    named = [one for one in checked if one.probability >= LIKELY and not one.consequence_of]
    named.sort(key=lambda one: -_rank(one))
    findings = tuple(_finding(case, one, chosen) for one in named)
    return Explanation(Path(log.path).name, chosen, findings, tuple(checked), tuple(missing))


def looked(case: Case) -> tuple[list[Checked], list[tuple[str, str]]]:
    """Every hypothesis: its sign, or what the log lacks for it."""
    checked, missing = [], []
    for one in HYPOTHESES:
        found = _look(one, case)
        if isinstance(found, Lack):
            missing.append((one.name, found.what))
        else:
            found = found._replace(strength=min(float(found.strength), STRONGEST))
            checked.append(Checked(one, found, probability_of(found.strength)))
    return checked, missing


def _look(one: Hypothesis, case: Case) -> Found:
    """The sign; a log so poor that it cannot be worked out is one that lacks something, with that reason."""
    try:
        with np.errstate(all="ignore"):
            found: Found = one.look(case)
    except (ValueError, IndexError, np.linalg.LinAlgError) as error:
        return Lack(f"too few readings to work it out ({type(error).__name__}: {error})")
    if isinstance(found, Sign) and not math.isfinite(found.strength):
        return Lack("too few readings to work it out")
    return found


def consequences(checked: list[Checked]) -> list[Checked]:
    """Each that another likely cause explains, which happened at the same time."""
    likely = {one.hypothesis.name: one for one in checked if one.probability >= LIKELY}
    kept_causes = []
    for one in checked:
        cause = next(
            (
                name
                for name, other in likely.items()
                if name != one.hypothesis.name
                and one.hypothesis.name in BY_NAME[name].explains
                and _overlap(one.sign.window_s, other.sign.window_s)
                and other.probability >= min(one.probability, SURE)  # what is less sure explains nothing that is surer
                and not (name in one.hypothesis.explains and one.sign.strength > other.sign.strength)
            ),
            "",
        )
        kept_causes.append(one._replace(consequence_of=cause if one.probability >= SHOWN else ""))
    return kept_causes


def _overlap(one: Window, other: Window) -> bool:
    return one[0] <= other[1] + 2.0 and other[0] <= one[1] + 2.0


def _tried(case: Case, checked: list[Checked]) -> list[Checked]:
    """The candidates that remain, tried; a repair that makes things much worse halves its sign."""
    candidates = sorted(
        (one for one in checked if one.probability >= TRIED_FROM and not one.consequence_of),
        key=lambda one: -one.probability,
    )
    names = {one.hypothesis.name for one in candidates[:MOST_TRIED]}
    kept_causes = []
    for one in checked:
        if one.hypothesis.name not in names:
            kept_causes.append(one)
            continue
        trial = tried(case, one.sign, one.hypothesis.repair)
        worse = trial.explained is not None and trial.explained < WORSE
        kept_causes.append(
            one._replace(
                trial=trial, probability=one.probability * (WORSE_FACTOR if worse and one.probability < 0.95 else 1.0)
            )
        )
    return kept_causes


def _rank(one: Checked) -> float:
    """The surer first; of those that are as sure, the one that explains more and began earlier.

    What cannot be tried counts as if it explained all: that there is no replay of it is not held against it.
    """
    explained = one.trial.explained if one.trial is not None and one.trial.explained is not None else 0.0
    explained = 1.0 if one.hypothesis.repair is None else explained
    return (
        NAMED_LAST * one.hypothesis.named_last
        + math.log(min(max(one.sign.strength, 1e-3), AS_SURE_AS_ANY))
        + 0.3 * max(explained, 0.0)
        - 1e-4 * one.sign.window_s[0]
    )


def _finding(case: Case, one: Checked, dialect: str) -> Finding:
    row = one.hypothesis
    trial = one.trial or Trial("", None, None)
    return Finding(
        row.name,
        row.words["title"],
        sentence_of(row, one.sign),
        one.sign.window_s,
        one.probability,
        trial.explained,
        trial.astray,
        one.sign.figures,
        one.sign.pictures,
        row.cure(case, one.sign, dialect),
        difference(case, row.name) if one.trial is not None else "",
    )


def sentence_of(row: Hypothesis, sign: Sign) -> str:
    """The cause in one sentence, with its figures."""
    return row.words["sentence"].format(**sign.figures).strip()
