"""A vehicle that slides over the ground before it flies, by the position reference alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flownav.core.measurement import Sensor, Stream
from flownav.core.record import POSITION_NED
from flownav.logs.log import Log
from flownav.studies.explain import slip_signs
from flownav.studies.explain.case import Case
from flownav.studies.explain.judge import explain
from flownav.studies.explain.sign import Lack, Sign

T_S = np.arange(0.0, 40.0, 0.02)
LIFT_S = 12.0
UP = np.clip(0.5 * (T_S - LIFT_S), 0.0, 1.0)


def log(north: np.ndarray, east: np.ndarray, up: np.ndarray = UP) -> Log:
    place = np.column_stack([5.0 + north, east - 3.0, 0.4 - up])
    baro = Stream.of(Sensor.BARO, T_S, up[:, None])
    return Log(Path("log"), {Sensor.BARO: baro}, truth={"t_s": T_S, **dict(zip(POSITION_NED, place.T, strict=True))})


def slides(size_m: float, from_s: float) -> np.ndarray:
    return np.clip((T_S - from_s) / 0.5, 0.0, 1.0) * size_m


def sign(of: Log) -> Sign:
    found = slip_signs.slid(Case(of))
    assert isinstance(found, Sign), found
    return found


@pytest.mark.parametrize("axis", [0, 1])
def test_what_it_slides_before_it_lifts_is_found_with_its_seconds(axis):
    ways = [np.zeros(len(T_S)), np.zeros(len(T_S))]
    ways[axis] = slides(0.09, LIFT_S - 1.0)
    found = sign(log(*ways))
    assert found.strength == pytest.approx(0.09 / slip_signs.SLID_M, rel=0.02)
    assert found.figures["centimetres"] == pytest.approx(9.0, abs=0.1)
    assert found.window_s == (pytest.approx(LIFT_S - 0.9, abs=0.1), pytest.approx(LIFT_S + 0.05, abs=0.05))
    assert [one.name for one in explain(log(*ways)).findings] == ["slid_on_ground"]


@pytest.mark.parametrize("from_s", [2.0, LIFT_S + 0.5], ids=["carried about long before", "flies"])
def test_what_it_moves_at_another_time_is_no_slide(from_s):
    assert sign(log(slides(0.5, from_s), np.zeros(len(T_S)))).strength < 0.1


@pytest.mark.parametrize(
    "up", [np.zeros(len(T_S)), np.clip(0.5 * (T_S - 0.1), 0.0, 1.0)], ids=["never lifts", "flies from the start"]
)
def test_without_a_stand_before_take_off_nothing_is_known(up):
    assert isinstance(slip_signs.slid(Case(log(slides(0.3, 5.0), np.zeros(len(T_S)), up))), Lack)


def test_without_a_reference_nothing_is_known():
    found = slip_signs.slid(Case(Log(Path("log"), {})))
    assert isinstance(found, Lack)
    assert "reference" in found.what
