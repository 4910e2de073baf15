"""A range that is not the height: named with its second, and the scale that of what is left."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_identification_flight import GAIN_X, GAIN_Y, written

from flownav.core.errors import InputError
from flownav.core.measurement import Sensor, Stream
from flownav.lab.identification.flight_identification import identify_flight
from flownav.lab.identification.quantities import CANDIDATES
from flownav.lab.identification.range_truth import untrue
from flownav.logs.csv_folder import read_csv_folder
from flownav.studies.inspection import summarise

FROM_S = 61.4


@pytest.fixture
def flown(tmp_path):
    return written(tmp_path / "flight", turned_rad=0.0)


def changed(folder, change):
    """The range.csv with another range from FROM_S on; change takes its ranges there."""
    table = np.genfromtxt(folder / "range.csv", delimiter=",", names=True)
    rng = np.random.default_rng(3)
    table["range_m"] = np.round(table["range_m"] + 0.01 * rng.normal(size=len(table)), 3)  # of a sensor with noise
    late = table["t_s"] > FROM_S
    table["range_m"][late] = change(table["range_m"][late])
    rows, header = table.view(float).reshape(len(table), -1), ",".join(table.dtype.names)
    np.savetxt(folder / "range.csv", rows, delimiter=",", header=header, comments="")
    return folder


@pytest.mark.parametrize(("change", "what"), [
    (lambda range_m: np.full_like(range_m, 1.1), "it repeats 1.10 m"),
    (lambda range_m: np.full_like(range_m, 9.0), "it stands at its ceiling of 9.00 m"),
    (lambda range_m: 0.5 * range_m, "it reads 0.49 of the height of truth.csv"),
])  # fmt: skip
def test_the_second_is_named_and_the_gains_are_of_the_true_part(flown, change, what):
    folder = changed(flown, change)
    found = identify_flight(folder, CANDIDATES)
    said = [note for note in found.notes if "stopped being true" in note]
    assert len(said) == 1
    assert what in said[0]
    at_s = float(said[0].split(" at ")[1].split(" s")[0])
    assert at_s == pytest.approx(FROM_S, abs=0.3)
    for response, gain in zip(found.responses, (GAIN_X, GAIN_Y), strict=True):
        assert response.gain.value == pytest.approx(gain, abs=0.03)
    assert any(what in line for line in summarise(read_csv_folder(folder))["warnings"])


def test_a_range_that_is_true_has_nothing_said_of_it(flown):
    log = read_csv_folder(changed(flown, lambda range_m: range_m))
    flying = np.ones(len(log.streams[Sensor.RANGE]), bool)
    assert untrue(log, flying).notes == ()
    assert not untrue(log, flying).flags.any()


def test_a_range_that_was_never_true_is_refused_with_its_reason(flown):
    table = np.genfromtxt(flown / "range.csv", delimiter=",", names=True)
    table["range_m"][5:] = 1.0
    rows, header = table.view(float).reshape(len(table), -1), ",".join(table.dtype.names)
    np.savetxt(flown / "range.csv", rows, delimiter=",", header=header, comments="")
    with pytest.raises(InputError, match=r"the range stopped being true at \S+ s: it"):
        identify_flight(flown, CANDIDATES)


@pytest.mark.parametrize(("drift_m", "named"), [(0.0, True), (6.0, False)])
def test_a_barometer_names_the_seconds_unless_it_has_drifted(tmp_path, drift_m, named):
    """Without a reference; a climb to 12 m of which the range sees 4."""
    t_s = np.arange(0.0, 60.0, 0.05)
    height = np.interp(t_s, [0.0, 5.0, 20.0, 40.0, 55.0, 60.0], [0.5, 0.5, 12.0, 12.0, 0.5, 0.5])
    rng = np.random.default_rng(5)
    read = np.minimum(height, 4.0) + 0.01 * rng.normal(size=len(t_s))
    level = np.tile([1.0, 0.0, 0.0, 0.0], (len(t_s), 1))
    log = read_csv_folder(written(tmp_path / "other", duration_s=10.0))
    baro = height + 0.1 * rng.normal(size=len(t_s)) + drift_m * t_s / 60.0
    streams = [Stream.of(Sensor.RANGE, t_s, read[:, None]), Stream.of(Sensor.BARO, t_s, baro[:, None]),
               Stream.of(Sensor.ATTITUDE, t_s, level)]  # fmt: skip
    alone = replace(log, streams={stream.sensor: stream for stream in streams}, truth=None)
    found = untrue(alone, np.ones(len(t_s), bool))
    assert bool(found.notes) == named
    assert not found.flags.any()
    if named:
        assert "of the height of the barometer" in found.notes[0]


def test_a_hover_that_a_truth_confirms_is_no_range_that_stands_still(tmp_path):
    """Twenty seconds at 5.00 m within a millimetre, by a sensor of whole centimetres; one that sticks in a climb is."""
    t_s = np.arange(0.0, 60.0, 0.05)
    climbs = np.interp(t_s, [0.0, 10.0, 30.0, 50.0, 60.0], [1.0, 5.0, 5.0, 9.0, 9.0])
    height = climbs + 1e-3 * np.sin(t_s)
    log = read_csv_folder(written(tmp_path / "hover", duration_s=10.0))
    level = np.tile([1.0, 0.0, 0.0, 0.0], (len(t_s), 1))
    truth = {"t_s": t_s, "pos_n_m": 0.0 * t_s, "pos_e_m": 0.0 * t_s, "pos_d_m": -height}
    stuck = np.where((t_s > 31.0) & (t_s < 49.0), 5.2, height)

    def found(read):
        streams = [Stream.of(Sensor.RANGE, t_s, np.round(read, 2)[:, None]), Stream.of(Sensor.ATTITUDE, t_s, level)]
        alone = replace(log, streams={stream.sensor: stream for stream in streams}, truth=truth)
        return untrue(alone, np.ones(len(t_s), bool))

    assert found(height).notes == ()
    assert "it repeats 5.20 m" in found(stuck).notes[0]
