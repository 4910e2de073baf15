"""The verdict of `flownav replay` on the sensor that a cause blames stands beside the cause where the two differ."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from flownav.core.measurement import Sensor
from flownav.logs.log import Log
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import replay
from flownav.scoring.sensor_verdict import ACT, verdict
from flownav.studies.explain import replay_verdict
from flownav.studies.explain.judge import explain
from flownav.studies.explain.table import BY_NAME
from planted_logs import fault, log_of

SOUND = {"nis_per_dof": 1.0, "white": True, "refused": 0.0}


@pytest.mark.parametrize(
    ("judged", "words"),
    [
        (SOUND, "as expected"),
        (SOUND | {"nis_per_dof": 0.2}, "harmless: less scatter than the filter expects"),
        (SOUND | {"white": False}, "harmless: its errors last"),
        (SOUND | {"nis_per_dof": 9.0}, ""),
        (SOUND | {"refused": 0.3}, ""),
        (None, ""),
    ],
)
def test_only_a_verdict_that_calls_for_nothing_is_explained(monkeypatch, judged, words):
    scores = {} if judged is None else {"baro": judged}
    monkeypatch.setattr(replay_verdict, "consistency_scores", lambda *_: scores)
    case: Any = SimpleNamespace(base=SimpleNamespace(innovation=None), log=Log(Path("log"), {}))
    found = replay_verdict.difference(case, "baro_wash")
    assert (f'calls the barometer "{words}"' in found) if words else found == ""
    assert replay_verdict.difference(case, "vibration") == ""
    assert replay_verdict.difference(SimpleNamespace(base=None, log=case.log), "baro_wash") == ""  # type: ignore[arg-type]


def test_a_cause_that_blames_a_sensor_is_one_of_the_table():
    assert set(replay_verdict.BLAMED) <= set(BY_NAME)


def test_a_barometer_in_the_wash_has_the_replays_own_word_beside_it(tmp_path):
    log = log_of(fault("forum", "barometer in the propellers' wash"), tmp_path)
    first = explain(log).first
    assert first is not None
    assert first.name == "baro_wash"
    judged = replay(log, ReplayOptions(), NavigatorSettingsFile()).scores()["consistency"][Sensor.BARO.name.lower()]
    words = verdict(judged["nis_per_dof"], white=judged["white"], refused=judged["refused"])
    assert (words in first.beside_replay) != words.startswith(ACT)
