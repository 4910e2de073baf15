"""One recorded link: a live session that is given the library's state of now sends the same bytes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from flownav.core.measurement import Array
from flownav.export.onboard.board import Board
from flownav.export.onboard.library_boards import LibraryBoard, library_board
from flownav.live import filtering
from flownav.navigation import progress
from flownav.navigation.now import NowRow
from flownav.navigation.rings import Due, Given, Rings
from flownav.navigation.waiting_records import Sizes
from recorded_link import Arrival, Sent, arrivals, play

ROOM = Sizes(1024.0, 1024.0, 128.0, 8192.0)  # as much as a Cortex-M7's emulated memory has room for
PATIENT = progress.Pace(
    horizon_s=np.inf, leap_s=np.inf, anew_s=np.inf, start_wait_s=np.nan
)  # live's clock judges times
SQUARE, GYRO_ALONE = "ardupilot-live/square", "px4-live/px4-no-gps-heading"


class Begun(NamedTuple):
    """A navigator begins: its settings, and the rings as they are then."""

    settings: Array
    rings: Array


class Told(NamedTuple):
    """The state of now at an instant."""

    t_s: float
    row: NowRow[Array]


Step = Given | float | Begun | Told  # a float: what is of instants up to this is fed


class Watched(Rings):
    """Rings that note what is done with them."""

    steps: list[Step]
    said: Iterator[NowRow[Array]] | None = None  # given in place of the values of these rings

    def __init__(self, sizes: Sizes, most: int) -> None:
        super().__init__(sizes, most)
        self._most, self._settings = most, np.zeros(0)

    def take(self, given: Given) -> int:
        self.steps.append(given._replace(numbers=given.numbers.copy()))
        return super().take(given)

    def release(self, settings: Array, until_s: float) -> Due:
        if settings is not self._settings:
            self._settings = settings
            self.steps.append(Begun(settings.copy(), self.rings.copy()))
        found = super().release(settings, until_s)
        times = found.queue.t_s
        self.steps.append(until_s if len(times) < self._most else float(times[-1]))
        return found

    def now(self, work: Array, settings: Array, t_s: float) -> NowRow[Array]:
        told = super().now(work, settings, t_s) if self.said is None else next(self.said)
        self.steps.append(Told(t_s, told))
        return told


def flown(
    monkeypatch: pytest.MonkeyPatch, frames: list[Arrival], said: Iterator[NowRow[Array]] | None = None
) -> tuple[list[Step], list[Sent]]:
    """The steps of a session with its rings, and the messages it sent."""
    kind: Any = type("Noted", (Watched,), {"steps": [], "said": said})
    monkeypatch.setattr(filtering, "Rings", kind)
    monkeypatch.setattr(filtering, "ROOM", ROOM)
    _, sent = play(frames)
    return kind.steps, sent


def begun(begin: Begun, target: str | None, folder: Path) -> Board | LibraryBoard:
    """The library as a session's navigator begins, with what waits for it."""
    settings = np.concatenate([begin.settings, PATIENT])
    if target is None:
        here = Board(settings, ROOM)
        here.rings[:] = begin.rings
        return here
    there = library_board(target, settings, ROOM, folder)
    there.put(there.rings, begin.rings)
    return there


def feed(board: Board | LibraryBoard, until_s: float, newest_s: float) -> None:
    """Feed the readings of instants up to until_s: the horizon is where a session has it."""
    for horizon_s, work in ((newest_s - until_s, True), (np.inf, False)):
        if isinstance(board, Board):
            board.settings[progress.PACE] = horizon_s
        else:
            board.put(board.settings, np.concatenate([board.get(board.settings, progress.PACE), [horizon_s]]))
        if work:
            board.finish()


def told_by(target: str | None, steps: list[Step], folder: Path) -> list[NowRow[Array]]:
    """The library's states of now where the session was given one."""
    board, newest_s, found = None, -np.inf, []
    for step in steps:
        if isinstance(step, Begun):
            board = begun(step, target, folder)
            newest_s = -np.inf
        elif board is None:
            continue
        elif isinstance(step, Given):
            said = board.take(step).head.status
            assert said in (progress.TAKEN, progress.LATE)
            if said == progress.TAKEN:
                newest_s = max(newest_s, step.t_s - step.numbers[10])
        elif isinstance(step, Told):
            found.append(board.now(step.t_s))
        elif np.isfinite(newest_s):
            feed(board, step, newest_s)
    return found


@pytest.mark.parametrize(
    ("recording", "until_s", "target"),
    [(SQUARE, 25.0, None), (GYRO_ALONE, 20.0, None), (SQUARE, 13.0, "cortex-m7"), (SQUARE, 13.0, "wasm32")],
)
def test_a_session_and_the_library_say_the_same_of_one_recorded_link(
    recording, until_s, target, data_folder, monkeypatch, tmp_path
):
    frames = arrivals(data_folder / recording, until_s)
    steps, sent = flown(monkeypatch, frames)
    told = [step for step in steps if isinstance(step, Told)]
    there = told_by(target, steps, tmp_path)
    assert len(there) == len(told) > 200
    for here, found in zip(told, there, strict=True):
        assert found.status == progress.STATE_GIVEN
        for name, value in here.row._asdict().items():
            np.testing.assert_array_equal(getattr(found, name), value, err_msg=f"{name} at {here.t_s}")
    _, again = flown(monkeypatch, frames, iter(there))
    assert [bytes(m.get_msgbuf()) for _, m in again] == [bytes(m.get_msgbuf()) for _, m in sent]
    assert sum(m.msgname == "ODOMETRY" for _, m in sent) > 200


def test_a_session_that_was_told_something_else_would_send_something_else(data_folder, monkeypatch):
    frames = arrivals(data_folder / SQUARE, 13.0)
    steps, sent = flown(monkeypatch, frames)
    moved = (step.row._replace(pos_ned_m=step.row.pos_ned_m + 1e-3) for step in steps if isinstance(step, Told))
    _, again = flown(monkeypatch, frames, moved)
    assert [bytes(m.get_msgbuf()) for _, m in again] != [bytes(m.get_msgbuf()) for _, m in sent]
