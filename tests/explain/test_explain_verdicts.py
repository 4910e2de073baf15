"""Planted faults are named, sound flights are not, and missing data are reported."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flownav.core.measurement import Sensor, Stream
from flownav.logs.log import Log
from flownav.studies.explain.hypothesis import words
from flownav.studies.explain.judge import explain, probability_of
from flownav.studies.explain.table import BY_NAME, HYPOTHESES
from planted_logs import fault, log_of, sound

# one of each sensor and kind of trial; `make explain` has them all
PLANTED = (
    ("own", "flow signs both wrong outdoors"),
    ("own", "flow 150 ms late"),
    ("own", "blurred below a quarter of a metre"),
    ("own", "lamps flicker in the flow's picture"),
    ("own", "one range in four is an echo"),
    ("own", "a step in the floor"),
    ("own", "GPS off by twenty-five metres for eight seconds"),
    ("own", "compass a half turn off"),
    ("own", "power cable beside the compass"),
    ("own", "motors unbalanced"),
    ("own", "inertial unit restarts"),
    ("own", "reported as landed while it hovers low"),
    ("own", "flow never switched on"),
    ("own", "flow stamped with two thirds of its time"),
    ("own", "a shadow of the airframe in the flow's picture"),
    ("forum", "range is height reference, no GPS"),
    ("forum", "switched to flow too high up"),
    ("forum", "rangefinder hangs"),
)


@pytest.mark.parametrize(("which", "name"), PLANTED)
def test_a_planted_fault_is_the_first_cause(tmp_path, which, name):
    planted = fault(which, name)
    explained = explain(log_of(planted, tmp_path))
    assert explained.first is not None
    assert explained.first.name == planted.causes[0]
    assert explained.first.probability > 0.5
    assert explained.dialect == planted.dialect
    assert explained.first.sentence in explained.verdict
    assert "{" not in explained.verdict


@pytest.mark.parametrize(
    ("kind", "dialect", "seed"),
    [("yard", "px4", 21), ("hall", "ardupilot", 22), ("low", "px4", 23), ("climb", "ardupilot", 24)],
)
def test_nothing_is_named_of_a_sound_flight_and_what_was_checked_is_told(tmp_path, kind, dialect, seed):
    explained = explain(log_of(sound(kind, dialect, seed), tmp_path))
    assert explained.findings == ()
    assert explained.verdict == f"Nothing wrong was found; {len(explained.checked)} causes were looked for."
    assert len(explained.checked) > 15
    assert {one.hypothesis.name for one in explained.checked} | {name for name, _ in explained.missing} == set(BY_NAME)


def test_the_window_is_that_of_the_fault(tmp_path):
    planted = fault("own", "inertial unit restarts")
    first = explain(log_of(planted, tmp_path)).first
    assert first is not None
    assert first.window_s == pytest.approx((39.0, 41.0), abs=0.2)


def test_a_trial_explains_what_its_repair_takes_away(tmp_path):
    explained = explain(log_of(fault("own", "flow signs both wrong outdoors"), tmp_path))
    assert explained.first is not None
    assert explained.first.explained is not None
    assert explained.first.explained > 0.7
    quick = explain(log_of(fault("own", "flow signs both wrong outdoors"), tmp_path), quick=True)
    assert quick.first is not None
    assert quick.first.explained is None


def test_a_consequence_is_told_as_one(tmp_path):
    explained = explain(log_of(fault("forum", "switched to flow too high up"), tmp_path))
    by_name = {one.hypothesis.name: one for one in explained.checked}
    assert by_name["low_texture"].consequence_of == "switched_to_bad_flow"
    assert "low_texture" not in [one.name for one in explained.findings]


def test_two_causes_are_both_named(tmp_path):
    explained = explain(log_of(fault("pairs", "inertial gap and a glitch"), tmp_path))
    assert {"imu_gap", "gps_glitch"} <= {one.name for one in explained.findings}


def test_a_log_of_one_sensor_lacks_almost_everything(tmp_path):
    t_s = np.arange(0.0, 20.0, 0.1)
    log = Log(tmp_path / "poor", {Sensor.BARO: Stream.of(Sensor.BARO, t_s, np.zeros((len(t_s), 1)))})
    explained = explain(log)
    assert explained.findings == ()
    assert dict(explained.missing)["flow_axes"] == "no optical flow"
    assert dict(explained.missing)["vibration"].startswith("no inertial readings")


def test_without_parameters_their_causes_are_missing_and_not_guessed(tmp_path):
    log = replace(log_of(sound("hall", "px4", 22), tmp_path), parameters={})
    explained = explain(log)
    assert {"height_noise", "source_never_switched", "flow_refused"} <= {name for name, _ in explained.missing}
    assert explained.dialect == ""
    with pytest.raises(ValueError, match="px4, ardupilot or inav"):
        explained.cure_text()


def test_a_flood_of_copies_of_one_instant_is_no_cause(tmp_path):
    """As a flooded link leaves behind: most inertial readings stand at the instant of the one before."""
    log = log_of(sound("yard", "px4", 21), tmp_path)
    imu = log.streams[Sensor.IMU]
    rows = np.repeat(np.arange(len(imu)), 3)
    flooded = Stream.of(Sensor.IMU, imu.t_s[rows], imu.value[rows], delay_s=imu.delay_s)
    assert explain(replace(log, streams=log.streams | {Sensor.IMU: flooded})).findings == ()


def test_probability_grows_with_the_sign():
    assert probability_of(0.0) == 0.0
    assert probability_of(0.5) < 0.1
    assert probability_of(3.0) > 0.95
    assert np.all(np.diff([probability_of(x) for x in np.linspace(0.05, 5.0, 50)]) > 0.0)


def test_every_row_has_its_words_and_explains_rows_that_exist():
    assert set(words()) == set(BY_NAME)
    for row in HYPOTHESES:
        assert set(row.words) - {"inav"} == {"title", "sentence", "looks", "why", "prevent"}
        assert row.repair is None or row.repair.__doc__  # its page says how it is tried
        assert set(row.explains) <= set(BY_NAME)
