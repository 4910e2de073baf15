"""Tuning: from logs to a proposal, and whether it is to be accepted."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flownav.core.errors import InputError
from flownav.logs.log import Log
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.replays.fed import as_fed
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import replay
from flownav.studies.compare.rows import names_of
from flownav.studies.tuning.judge import UNMOVED, Judgement, judge
from flownav.studies.tuning.knobs import Knob, knobs_of, rounded, turned
from flownav.studies.tuning.scores import Gains, reference_name
from flownav.studies.tuning.search import Found, search
from flownav.studies.tuning.trials import Course, Trials, course_of
from flownav.studies.tuning.windows import Split, split_flights

RUNS_A_KNOB = 30  # about as many as a search takes, for the progress bar


class Proposed(NamedTuple):
    """One setting: what it was, what it should be, and its 95 % interval."""

    key: str
    unit: str
    knob: str
    default: float
    value: float
    low: float
    high: float


class OfLog(NamedTuple):
    """How one log took part, and what the proposal is worth in its held-out windows.

    error and start_error: medians of the path's error, of the proposal and of the start; None without a reference.
    """

    name: str
    path: Path
    split: Split
    reference: str | None
    gain: float
    start_error: float | None
    error: float | None


class Tuned(NamedTuple):
    """What came out: settings moved, the judgement, and each log's part; runs: how many replays the fit took."""

    proposed: list[Proposed]
    judgement: Judgement
    logs: list[OfLog]
    runs: int

    @property
    def accepted(self) -> bool:
        """Whether there is a proposal that helps."""
        return self.judgement.accepted


def tune(
    paths: Sequence[Path], logs: Sequence[Log], options: ReplayOptions, stated: NavigatorSettingsFile | None,
    on_progress: Callable[[int], None] = lambda done: None,
) -> Tuned:  # fmt: skip
    """Settings fitted to some windows of the logs and judged by the others. The order of the logs does not matter.

    stated: what the fit starts from (None: as shipped). InputError where a log is given twice, is too short, holds no
    sensor whose settings could be tuned, or the filter never starts.
    """
    names, order = names_of(paths), _ordered(paths, logs)
    logs = [logs[k] for k in order]
    splits = split_flights(logs)
    settings = stated or NavigatorSettingsFile()
    flown = [replay(log, *as_fed(log, options, settings)) for log in logs]
    fitted = [course_of(run, split.fit) for run, split in zip(flown, splits, strict=True) if not split.whole]
    knobs = _knobs(fitted, settings)
    trials = Trials(fitted, knobs, settings, on_progress)
    found = search(trials, settings)
    held = [course_of(run, split.held) for run, split in zip(flown, splits, strict=True)]
    keys = turned(settings, knobs, found.log_factors)
    gains = [course.gains(keys) for course in held]
    return Tuned(
        proposals(found, knobs, settings),
        judge(gains, [split.whole for split in splits]) if keys else UNMOVED,
        [_of_log(names[k], paths[k], split, course, gain, keys)
         for k, split, course, gain in zip(order, splits, held, gains, strict=True)],
        trials.flown * len(fitted),
    )  # fmt: skip


def runs_expected(logs: Sequence[Log]) -> int:
    """About how many replays a tuning takes."""
    fitted = sum(not split.whole for split in split_flights(logs))
    return RUNS_A_KNOB * fitted * max(len(knobs_of(log, NavigatorSettingsFile())) for log in logs)


def proposals(found: Found, knobs: Sequence[Knob], settings: NavigatorSettingsFile) -> list[Proposed]:
    """Key by key, what the factors make of the start."""
    rows = []
    for knob, factor, interval in zip(knobs, found.log_factors, found.intervals, strict=True):
        if interval is not None:
            for key in knob.keys:
                default = float(getattr(settings, key))
                values = (rounded(default * math.exp(x)) for x in (float(factor), *interval))
                rows.append(Proposed(key, knob.unit_of(key), knob.name, default, *values))
    return rows


def _ordered(paths: Sequence[Path], logs: Sequence[Log]) -> list[int]:
    """The logs in an order that does not depend on how they were given. InputError where two are the same."""
    contents = [tuple(sorted(log.inputs.values())) or (str(path.resolve()),)
                for path, log in zip(paths, logs, strict=True)]  # fmt: skip
    for k, content in enumerate(contents):
        if content in contents[:k]:
            raise InputError(
                f"{paths[k]}: the same log as {paths[contents.index(content)]}; one that is fitted cannot judge the fit"
            )
    names = names_of(paths)
    return sorted(range(len(paths)), key=lambda k: (names[k], contents[k]))


def _knobs(courses: Sequence[Course], settings: NavigatorSettingsFile) -> list[Knob]:
    """Those that any of the logs could turn. InputError where there is none, or nothing to score."""
    found = [knob for course in courses for knob in knobs_of(course.flown.log, settings)]
    knobs = sorted(set(found), key=found.index)
    first = courses[0].flown.log.path
    if not any(np.isfinite(course.start.density).any() for course in courses) or not knobs:
        raise InputError(
            f"{first}: in no window was any sensor predicted, so that nothing can be tuned; see `flownav info`"
        )
    return knobs


def _of_log(name: str, path: Path, split: Split, course: Course, gain: Gains, keys: dict[str, float]) -> OfLog:
    before = course.start.error
    after = course.scores(keys).error if keys else before
    both = np.isfinite(before) & np.isfinite(after)
    medians = (float(np.median(before[both])), float(np.median(after[both]))) if both.any() else (None, None)
    return OfLog(name, path, split, reference_name(course.flown.log), float(gain.total.mean()), *medians)
