"""Tuning: from logs to a proposal, whether it is to be accepted, and the settings file that it becomes."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flownav.core.errors import InputError
from flownav.core.guard import written_whole
from flownav.core.marks import marked
from flownav.core.parameter_files import load
from flownav.core.version import __version__
from flownav.logs.log import Log
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.replays.fed import as_fed
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import replay
from flownav.studies.compare.job import LeftOut, names_of
from flownav.studies.tuning.knobs import (
    KNOBS,
    LEAST_STARTS,
    Knob,
    Split,
    knobs_of,
    rounded,
    split_flights,
    too_short,
    turned,
)
from flownav.studies.tuning.scores import Course, Gains, Trials, course_of, reference_name
from flownav.studies.tuning.search import UNMOVED, Found, Judged, Judgement, judge, search

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
    """The result: settings moved, the judgement, and each log's part; runs: how many replays the fit took."""

    proposed: list[Proposed]
    judgement: Judgement
    logs: list[OfLog]
    runs: int
    left_out: list[LeftOut]

    @property
    def accepted(self) -> bool:
        """Whether there is a proposal that helps."""
        return self.judgement.accepted


def tune(
    paths: Sequence[Path], logs: Sequence[Log], options: ReplayOptions, stated: NavigatorSettingsFile | None,
    on_progress: Callable[[int], None] = lambda done: None,
) -> Tuned:  # fmt: skip
    """Settings fitted to some windows of the logs and judged by the others. The order of the logs does not matter.

    stated: what the fit starts from (None: as shipped). Logs that are too short are left out. InputError where all are,
    where a log is given twice, holds no sensor whose settings could be tuned, or the filter never starts.
    """
    names, order = names_of(paths), _ordered(paths, logs)
    short = {k: why for k in order if (why := too_short(logs[k]))}
    order = [k for k in order if k not in short] or order
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
        [(names[k], why) for k, why in short.items()],
    )  # fmt: skip


def runs_expected(logs: Sequence[Log]) -> int:
    """About how many replays a tuning takes."""
    logs = [log for log in logs if not too_short(log)] or logs
    fitted, settings = sum(not split.whole for split in split_flights(logs)), NavigatorSettingsFile()
    return RUNS_A_KNOB * fitted * max(len(knobs_of(log, settings, starts=fitted >= LEAST_STARTS)) for log in logs)


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
    """The knobs that any of the logs can turn; of the start, those that at least LEAST_STARTS logs can. InputError
    where there is none, or nothing to score.
    """
    found = [knob for course in courses for knob in knobs_of(course.flown.log, settings, starts=True)]
    knobs = [knob for knob in KNOBS if found.count(knob) >= (LEAST_STARTS if knob.start else 1)]
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


# -- the settings file -------------------------------------------------------------------------------------------
def write_settings(path: Path, tuned: Tuned, stated: NavigatorSettingsFile | None, command: str) -> None:
    """Write an accepted proposal, and read it back as `replay --settings` does.

    stated: what the fit started from; its other keys are kept. InputError where the file cannot be written.
    """
    try:
        with written_whole(path) as temporary:
            temporary.write_bytes(marked(settings_text(tuned, stated, command)))
            load(temporary, NavigatorSettingsFile)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); give another name") from error


def settings_text(tuned: Tuned, stated: NavigatorSettingsFile | None, command: str) -> str:
    """The file as TOML; the same for the same logs, command and version."""
    proposed = {row.key for row in tuned.proposed}
    kept = {} if stated is None else stated.model_dump(exclude_unset=True)
    lines = [
        "# Settings of flownav's navigator; use them with `flownav replay LOG --settings FILE`.",
        f"# Made with flownav {__version__} by: {' '.join(command.split())}",
        *(f"# {_part(log)}" for log in tuned.logs),
        *(f"# {_printable(name)}: left out: {why}" for name, why in tuned.left_out),
        f"# Held-out windows: {gain_words(tuned.judgement.error)}.",
        "",
        *(f"{key} = {float(value)!r}" for key, value in kept.items() if key not in proposed),
        *(_line(row) for row in tuned.proposed),
    ]
    return "\n".join(lines) + "\n"


def gain_words(error: Judged | None) -> str:
    """The effect of the proposal on the path's error, with the interval."""
    if error is None:
        return "nothing shows the path's error"
    interval = f"95 % interval {error.low:.3f} to {error.high:.3f}, {error.windows} windows"
    return f"gain of the path's error {error.mean:.3f} nats ({interval}); half the error would be 0.53"


def _part(log: OfLog) -> str:
    """How a log took part, in one line of a comment."""
    fitted = "held out whole" if log.split.whole else f"fitted on {len(log.split.fit)} windows"
    return f"{_printable(log.name)}: {fitted}, judged on {len(log.split.held)}, by {log.reference or 'nothing'}"


def _printable(name: str) -> str:
    return "".join(character if character.isprintable() else "?" for character in name)


def _line(row: Proposed) -> str:
    interval = f"95 % {row.low:.4g} to {row.high:.4g}"
    return f"{row.key} = {row.value!r}  # {row.unit}; was {row.default:g}; {interval}; {row.knob}"
