"""A reference that leaps, stands, drifts or is turned: named with its second, and the scale is that of the rest."""

from __future__ import annotations

import numpy as np
import pytest
from test_identification_flight import GAIN_X, GAIN_Y, written

from flownav.lab.identification.first_look import judged
from flownav.lab.identification.flight_identification import identify_flight
from flownav.lab.identification.quantities import CANDIDATES
from flownav.lab.identification.reference_truth import drift_throughout
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
    (stand, "truth.csv stands still"),
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
    notes = [note for note in found.notes if note.startswith(("the reference:", "truth.csv leaps"))]
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
