"""A reference that leaps, stands, drifts or is turned: named with its second, and the scale is that of the rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_identification_flight import GAIN_X, GAIN_Y, written

from flownav.core.measurement import Sensor, Stream
from flownav.lab.identification.first_look import judged
from flownav.lab.identification.flight_identification import identify_flight, measured
from flownav.lab.identification.quantities import CANDIDATES
from flownav.lab.identification.reference_truth import drift_at_rest, drift_throughout
from flownav.logs.open_log import open_flight

FROM_S, TO_S = 70.2, 85.0


def leap(t_s, place):
    place[t_s > FROM_S, 0] += 6.0


def drift(t_s, place):
    place[:, 1] += 0.8 * np.maximum(t_s - FROM_S, 0.0)


def turn(t_s, place):
    """By 40 degrees; axes of unlike gains make 44 of it."""
    late = t_s > FROM_S
    start, (c, s) = place[late][0, :2].copy(), (np.cos(0.7), np.sin(0.7))
    place[late, :2] = start + (place[late, :2] - start) @ np.array([[c, s], [-s, c]])


def stand(t_s, place):
    still = (t_s > FROM_S) & (t_s < TO_S)
    place[still] = place[still][0]


def sound(t_s, place):
    """As it is."""


@pytest.mark.parametrize(("fault", "said"), [
    (leap, "truth.csv leaps by 6 m"),  # shifted back where the log is read, before anything is fitted
    (drift, "truth.csv drifts by 0.79"),
    (turn, "truth.csv is turned by 44 degrees"),
    (stand, "truth.csv stands still"),  # left out where the log is read
    (sound, ""),
])  # fmt: skip
def test_what_is_wrong_with_the_reference_is_named_and_the_gains_are_right(tmp_path, fault, said):
    folder = written(tmp_path / "flight", turned_rad=0.0)
    table = np.genfromtxt(folder / "truth.csv", delimiter=",", names=True)
    place = np.column_stack([table[name] for name in ("x_m", "y_m", "z_m")])
    fault(table["t_s"], place)
    rows = np.column_stack([table["t_s"], place])
    np.savetxt(folder / "truth.csv", rows, delimiter=",", header="t_s,x_m,y_m,z_m", comments="", fmt="%.9g")
    found = identify_flight(folder, CANDIDATES)
    notes = [note for note in found.notes if note.startswith(("the reference:", "truth.csv leaps", "truth.csv stands"))]
    named = [note for note in notes if said and said in note]
    assert len(named) == bool(said)
    assert said or not notes  # one that stood still leaps when it goes on, which is noted as well
    for note in named:
        assert min(abs(float(word) - FROM_S) for word in note.split() if word[0].isdigit()) < 1.1
    for response, gain in zip(found.responses, (GAIN_X, GAIN_Y), strict=True):
        assert response.gain.value == pytest.approx(gain, abs=0.03)


@pytest.mark.parametrize(
    ("axis", "speed", "offset"), [(0, 0.08, 0.0), (1, -0.15, 0.0), (0, 0.0, 0.0), (0, 0.0, 0.06)]
)  # m/s, rad/s
def test_a_reference_that_drifts_all_the_time_gives_the_flow_no_offset(tmp_path, axis, speed, offset):
    folder = written(tmp_path / "flight", turned_rad=0.0)
    tables = {name: np.genfromtxt(folder / name, delimiter=",", names=True) for name in ("truth.csv", "flow.csv")}
    tables["truth.csv"][("x_m", "y_m")[axis]] += speed * tables["truth.csv"]["t_s"]
    tables["flow.csv"]["flow_y_rad_s"] += offset
    for name, table in tables.items():
        header = ",".join(table.dtype.names)
        np.savetxt(folder / name, np.array(table.tolist()), delimiter=",", header=header, comments="", fmt="%.9g")
    flown, moved, _, _ = judged(open_flight(folder), "truth")
    drift = drift_throughout(flown, moved)
    assert drift == (pytest.approx(abs(speed), abs=0.02) if speed else None)
    found = identify_flight(folder, CANDIDATES).offset
    assert (found is not None and found.matters) == bool(offset)


STANDS = Stream.of(Sensor.LANDED, np.array([0.0, 10.0, 90.0]), np.array([[1.0], [0.0], [1.0]]))


def at_rest(t_s):
    """A level path that stands to 10 s and from 90 s on, and goes round between."""
    angle = 0.4 * (np.clip(t_s, 10.0, 90.0) - 10.0)
    return np.column_stack([3.0 * np.sin(angle), 3.0 * np.cos(angle), 0.0 * t_s])


@pytest.mark.parametrize(("spoilt", "speed"), [
    (lambda t, place: place + np.outer(t, [0.06, -0.08, 0.0]), 0.1),
    (lambda t, place: place, None),
    (lambda t, place: place + np.outer(t, [0.02, 0.0, 0.0]), None),  # too slow to say
    (lambda t, place: place + np.outer(np.maximum(t - 50.0, 0.0), [0.1, 0.0, 0.0]), None),  # stood at first
    (lambda t, place: place + np.outer(np.sin(0.3 * t), [0.5, 0.0, 0.0]), None),  # never steady
    (lambda t, place: place + np.outer(t, [0.0, 0.0, 0.5]), None),  # sinks, which no level offset looks like
])  # fmt: skip
def test_a_reference_that_moves_steadily_while_the_vehicle_stands_drifts(tmp_path, spoilt, speed):
    flown = judged(open_flight(written(tmp_path / "flight", turned_rad=0.0)), "truth").flown
    t_s = np.arange(0.0, 100.0, 0.02)
    flown = replace(flown, reference_t_s=t_s, reference_m=spoilt(t_s, at_rest(t_s)))
    assert drift_at_rest(flown, STANDS) == (pytest.approx(speed, rel=1e-6) if speed else None)
    assert drift_at_rest(flown, None) is None
    assert drift_at_rest(replace(flown, reference="gps"), STANDS) is None
    brief = Stream.of(Sensor.LANDED, np.array([0.0, 4.0]), np.array([[1.0], [0.0]]))
    assert drift_at_rest(flown, brief) is None


def level_flight(folder, t_s, place, range_m, drift_m_s=0.0, offset_rad_s=0.0):
    """A log of a vehicle that keeps nose north and height, whose reference drifts north, whose flow is offset there."""
    velocity = np.gradient(place, t_s, axis=0)
    still, one = np.zeros(len(t_s)), np.ones(len(t_s))
    force = np.gradient(velocity, t_s, axis=0)
    seen = velocity[:, :2] / range_m[:, None] + 0.01 * np.random.default_rng(3).standard_normal((len(t_s), 2))
    seen[:, 0] += offset_rad_s
    forces = "accel_x_m_s2,accel_y_m_s2,accel_z_m_s2"
    tables = {
        "imu.csv": (f"gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s,{forces}", [*3 * [still], *force[:, :2].T, -9.8 * one]),
        "attitude.csv": ("roll_rad,pitch_rad,yaw_rad", 3 * [still]),
        "flow.csv": ("flow_x_rad_s,flow_y_rad_s,gyro_x_rad_s,gyro_y_rad_s,quality",
                     [-seen[:, 1], seen[:, 0], still, still, 200.0 * one]),
        "range.csv": ("range_m,valid", [range_m, one]),
        "truth.csv": ("x_m,y_m,z_m", [place[:, 0] + drift_m_s * t_s, place[:, 1], -range_m]),
    }  # fmt: skip
    for name, (header, columns) in tables.items():
        rows = np.column_stack([t_s, *columns])
        np.savetxt(folder / name, rows, delimiter=",", header="t_s," + header, comments="", fmt="%.9g")
    return folder


def test_a_drift_that_only_the_rest_shows_is_no_offset_of_the_flow(tmp_path):
    """Nose north and height kept: an offset of the flow and a drift of the reference look alike in flight."""
    t_s = np.arange(0.0, 100.0, 0.02)
    level_flight(tmp_path, t_s, at_rest(t_s), np.where((t_s > 9.0) & (t_s < 91.0), 2.0, 0.12), drift_m_s=0.1)
    unknown = measured(open_flight(tmp_path), "truth")
    assert unknown.offset is not None
    assert unknown.offset.y.value == pytest.approx(-0.05, abs=0.005)  # as it looks where nobody knows when it stood
    (tmp_path / "landed.csv").write_text("t_s,landed\n0,1\n10,0\n90,1\n")
    known = measured(open_flight(tmp_path), "truth")
    assert known.offset is None
    assert "drifts by 0.10 m/s all the time" in known.flown.notes[-1]


def test_a_landed_state_that_is_wrong_takes_no_offset_of_the_flow_away(tmp_path):
    """Landed for six seconds of a straight leg: as steady as a reference that drifts, but not as slow as the offset."""
    t_s = np.arange(0.0, 100.0, 0.02)
    leg = np.clip(t_s, 40.0, 60.0) - 40.0
    angle = 0.4 * (t_s - leg)
    place = np.column_stack([3.0 * np.sin(angle) + 1.5 * leg, 3.0 * np.cos(angle), 0.0 * t_s])
    level_flight(tmp_path, t_s, place, np.clip(0.5 * t_s - 0.4, 0.12, 2.0), offset_rad_s=0.05)
    (tmp_path / "landed.csv").write_text("t_s,landed\n0,0\n45,1\n51,0\n")
    found = measured(open_flight(tmp_path), "truth")
    assert drift_at_rest(found.flown, open_flight(tmp_path).streams[Sensor.LANDED]) == pytest.approx(1.5, abs=0.01)
    assert found.offset is not None
    assert max(abs(found.offset.x.value), abs(found.offset.y.value)) == pytest.approx(0.05, abs=0.005)
