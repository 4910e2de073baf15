"""Logs flown again and again by other settings, each run scored in its windows against the start's."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from flownav.core.errors import InputError
from flownav.core.measurement import Array
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.replays.session import Replay, replay_again
from flownav.studies.compare.like_for_like import Window
from flownav.studies.tuning.knobs import Knob, turned
from flownav.studies.tuning.scores import LOSS, Gains, Scores, gains_of, scores_of, with_cuts

WORKERS = 2


@dataclass(frozen=True)
class Course:
    """A log prepared once, the settings that it starts from, its windows, and what the start is worth in them."""

    flown: Replay
    windows: tuple[Window, ...]
    start: Scores

    def scores(self, keys: dict[str, float]) -> Scores:
        """By the starting settings with some keys changed. InputError where the filter never starts."""
        return _scores(self.flown, self.windows, keys)

    def gains(self, keys: dict[str, float]) -> Gains:
        """Over the start; a filter that no longer starts loses everywhere."""
        try:
            return gains_of(self.scores(keys), self.start)
        except InputError:
            lost = np.full(len(self.windows), LOSS)
            return Gains(lost, np.where(np.isfinite(self.start.log_error), LOSS, np.nan))


def course_of(flown: Replay, windows: Sequence[Window]) -> Course:
    """A log on these windows, with `scores.with_cuts` in them and nowhere else."""
    return Course(flown, tuple(windows), _scores(flown, windows, {}))


def _scores(flown: Replay, windows: Sequence[Window], keys: dict[str, float]) -> Scores:
    settings = NavigatorSettingsFile.model_validate(flown.settings.model_dump(exclude_unset=True) | keys)
    options = with_cuts(flown.log, flown.options, windows)
    return scores_of(replay_again(flown, options, settings), windows)


class Trials:
    """Several courses flown by the same factors; a pair of factors is flown once."""

    def __init__(
        self, courses: Sequence[Course], knobs: Sequence[Knob], settings: NavigatorSettingsFile,
        on_progress: Callable[[int], None],
    ) -> None:  # fmt: skip
        self.courses = list(courses)
        self.knobs = list(knobs)
        self._settings = settings
        self._on_progress = on_progress
        self._known: dict[tuple[float, ...], list[Gains]] = {}

    @property
    def flown(self) -> int:
        """How many different factors were flown."""
        return len(self._known)

    def gains(self, log_factors: Array) -> list[Gains]:
        """Course by course."""
        factors = tuple(round(float(factor), 6) for factor in log_factors)
        if factors not in self._known:
            keys = turned(self._settings, self.knobs, factors)
            with ThreadPoolExecutor(WORKERS) as pool:
                self._known[factors] = list(pool.map(lambda course: course.gains(keys), self.courses))
            self._on_progress(len(self.courses))
        return self._known[factors]
