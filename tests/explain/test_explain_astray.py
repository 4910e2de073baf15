"""How far the autopilot's own estimate was off: in the frame and by the law of the scores."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flownav.core.measurement import Sensor, Stream
from flownav.core.record import POSITION_NED
from flownav.logs.log import Log
from flownav.scoring.path import autopilot_errors
from flownav.studies.explain.astray import Astray, astray
from flownav.studies.explain.case import Case

T_S = np.arange(0.0, 60.0, 0.1)
PATH = np.column_stack([12.0 * np.sin(0.2 * T_S), 9.0 * np.cos(0.13 * T_S), np.full(len(T_S), -2.0)])
ALWAYS = (0.0, 60.0)
WANDER = np.where((T_S > 20.0) & (T_S < 30.0), 4.0, 0.0)


def table(path: np.ndarray) -> dict[str, Any]:
    return {"t_s": T_S, **dict(zip(POSITION_NED, path.T, strict=True))}


def turned(path: np.ndarray) -> np.ndarray:
    """In another frame: turned by 63 degrees, its origin elsewhere."""
    c, s = np.cos(1.1), np.sin(1.1)
    return path @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) + [30.0, -8.0, 1.0]


def off(axis: int = 0) -> np.ndarray:
    """The path as the autopilot has it: wrong by 4 m for ten seconds."""
    own = PATH.copy()
    own[:, axis] += WANDER
    return own


def fixes(path: np.ndarray, delay_s: float = 0.22) -> dict[Sensor, Stream]:
    return {Sensor.GPS_POSITION: Stream.of(Sensor.GPS_POSITION, T_S + delay_s, path)}


def case(own: np.ndarray, truth: np.ndarray | None = None, streams: dict[Sensor, Stream] | None = None) -> Case:
    log = Log(Path("log"), streams or {}, autopilot=table(own), truth=None if truth is None else table(truth))
    found = Case(log)
    found.__dict__["flight_s"] = ALWAYS
    return found


def run(path: np.ndarray, std_m: float) -> Any:
    return SimpleNamespace(
        estimate_rows=SimpleNamespace(t_s=T_S, pos_ned_m=path, std_pos_ned_m=np.full((len(T_S), 3), std_m))
    )


@pytest.mark.parametrize("axis", [0, 1])
def test_over_the_whole_log_the_figure_is_that_of_the_scores_whatever_the_references_frame(axis):
    own = off(axis)
    found = astray(case(own, turned(PATH)), None, ALWAYS, gps_is_blamed=False)
    scored = autopilot_errors(table(own), table(turned(PATH)), {})
    assert found is not None
    assert found.against == "truth"
    assert found.rms_m == pytest.approx(scored["horizontal_rms_m"])
    assert found.most_m == pytest.approx(scored["horizontal_max_m"])
    right = astray(case(PATH, turned(PATH)), None, ALWAYS, gps_is_blamed=False)
    assert right is not None
    assert right.most_m < 1e-6
    assert not right.is_large


def test_only_the_seconds_of_the_cause_count():
    wrong = case(off(), turned(PATH))
    meanwhile = astray(wrong, None, (20.5, 29.5), gps_is_blamed=False)
    later = astray(wrong, None, (32.0, 58.0), gps_is_blamed=False)
    assert meanwhile is not None
    assert later is not None
    assert meanwhile.rms_m > 2.5 > 1.5 > later.rms_m
    assert astray(wrong, None, (59.9, 80.0), gps_is_blamed=False) is None  # too few rows


def test_without_a_reference_gps_serves_unless_it_is_what_is_blamed():
    own = off(1)
    found = astray(case(own, streams=fixes(PATH)), None, ALWAYS, gps_is_blamed=False)
    assert found is not None
    assert found.against == "gps"
    scored = autopilot_errors(table(own), None, {k: replace(s, delay_s=0.22) for k, s in fixes(PATH).items()})
    assert found.rms_m == pytest.approx(scored["horizontal_rms_m"])
    assert astray(case(own, streams=fixes(PATH)), None, ALWAYS, gps_is_blamed=True) is None


def test_the_replay_serves_where_it_knows_its_position():
    by_replay = astray(case(off(), streams=fixes(off())), run(turned(PATH), 0.1), ALWAYS, gps_is_blamed=True)
    assert by_replay is not None
    assert by_replay.against == "replay"
    assert by_replay.rms_m > 1.0
    assert by_replay.is_large
    assert astray(case(off()), run(turned(PATH), 40.0), ALWAYS, gps_is_blamed=True) is None


def test_without_an_estimate_of_its_own_nothing_was_off():
    assert astray(Case(Log(Path("log"), fixes(PATH))), None, ALWAYS, gps_is_blamed=False) is None


def test_a_receivers_own_noise_is_no_error_of_the_autopilot():
    assert not Astray(2.0, 4.0, "gps").is_large
    assert Astray(2.0, 4.0, "truth").is_large
    assert "2.0 m rms (4.0 m at most) off the reference" in Astray(2.0, 4.0, "truth").words
