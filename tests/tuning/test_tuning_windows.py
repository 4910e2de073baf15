"""Which windows are fitted and which judge: apart from each other, enough of them, whole logs held out."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from flownav.core.errors import InputError
from flownav.core.measurement import Sensor, Stream
from flownav.logs.log import Log
from flownav.studies.tuning.knobs import GAP_SHARE, LEAST_JUDGES, split_flight, split_flights


def log_of(duration_s: float, landed_s: float | None = None) -> Log:
    """A barometer, and where landed_s is given a landed signal that ends then."""
    t_s = np.arange(0.0, duration_s + 0.05, 0.1)
    streams = {Sensor.BARO: Stream.of(Sensor.BARO, t_s, 0.0 * t_s[:, None])}
    if landed_s is not None:
        streams[Sensor.LANDED] = Stream.of(Sensor.LANDED, t_s, (t_s < landed_s)[:, None].astype(float))
    return Log(Path("made"), streams)


@pytest.mark.parametrize(("duration_s", "length_s", "fit", "held"), [
    (36.0, 3.0, 6, 6), (60.0, 5.0, 6, 6), (80.0, 5.0, 8, 8), (240.0, 10.0, 12, 12), (849.0, 30.0, 14, 14),
])  # fmt: skip
def test_windows_alternate_with_gaps_between(duration_s, length_s, fit, held):
    split = split_flight(log_of(duration_s))
    assert (len(split.fit), len(split.held), split.whole) == (fit, held, False)
    windows = sorted([*split.fit, *split.held])
    assert windows[::2] == list(split.fit)
    assert all(t1 - t0 == pytest.approx(length_s * (1.0 - GAP_SHARE)) for t0, t1 in windows)
    gaps = [after[0] - before[1] for before, after in pairwise(windows)]
    assert gaps == pytest.approx([length_s * GAP_SHARE] * len(gaps))
    assert windows[0][0] >= 0.0
    assert windows[-1][1] <= duration_s


def test_the_ground_is_in_no_window():
    split = split_flight(log_of(100.0, landed_s=40.0))
    assert split.fit[0][0] == pytest.approx(40.0, abs=0.1)
    assert len(split.held) == LEAST_JUDGES


@pytest.mark.parametrize(("log", "what"), [
    (log_of(35.0), "made: the log lasts 35.0 s, too short for 12 windows of 3 s; give a log of 36 s or more"),
    (log_of(100.0, landed_s=90.0), "made: the flight lasts 10.0 s"),
])  # fmt: skip
def test_a_short_flight_is_told_in_one_line(log, what):
    with pytest.raises(InputError) as caught:
        split_flight(log)
    assert what in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("count", "whole"), [(1, []), (2, [1]), (3, [1]), (5, [1, 4]), (6, [1, 4])])
def test_of_several_logs_one_in_three_is_held_out_whole(count, whole):
    splits = split_flights([log_of(80.0)] * count)
    assert [number for number, split in enumerate(splits) if split.whole] == whole
    assert all((split.fit == ()) == split.whole for split in splits)
    assert len({split.held for split in splits}) == 1
