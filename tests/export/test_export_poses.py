"""TUM and EuRoC: frames by their axioms, files by the rules that evo reads them with, nothing lost without a
warning.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from export_records import awkward
from flownav.core.errors import InputError
from flownav.core.frames import quaternion_from_euler, rotation_from_quaternion
from flownav.core.record import POSITION_NED, QUATERNION, Record
from flownav.export import paths
from flownav.export.formats import export
from flownav.export.trajectory import Trajectory, in_enu, trajectories
from report_records import flight, replay

ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
FLU = np.diag([1.0, -1.0, -1.0])
angles = st.floats(-3.1, 3.1)


def matrix(quaternion):
    return np.array(rotation_from_quaternion(*quaternion)).reshape(3, 3)


def read_tum(path):
    """As evo does: lines of # are comments, eight columns of numbers by one space."""
    rows = [line.split(" ") for line in path.read_text().splitlines() if not line.startswith("#")]
    assert all(len(row) == 8 for row in rows)
    return np.array(rows, float)


def read_euroc(path):
    lines = path.read_text().splitlines()
    *names, mark = lines[0].split(",")
    assert mark.startswith("written by flownav; SHA-256")
    return names, np.array([line.split(",") for line in lines[1:]], float)


@given(angles, st.floats(-1.5, 1.5), angles, st.tuples(angles, angles, angles))
def test_enu_exchanges_earth_and_body_axes(roll, pitch, yaw, vector):
    quaternion = np.array([quaternion_from_euler(roll, pitch, yaw)])
    place = np.array([vector])
    path = Trajectory("estimate", np.zeros(1), place, quaternion, place, True, np.zeros(1, int), 0)
    turned = in_enu(path)
    assert np.allclose(matrix(turned.quaternion[0]), ENU @ matrix(quaternion[0]) @ FLU)
    assert np.allclose(turned.position_m[0], ENU @ place[0])
    assert np.allclose(turned.velocity_m_s[0], ENU @ place[0])
    assert np.linalg.det(matrix(turned.quaternion[0])) == pytest.approx(1.0)


def test_a_climb_heading_north_points_the_way_it_says_in_both_frames():
    level = np.array([[1.0, 0.0, 0.0, 0.0]])
    north_and_up = np.array([[10.0, 0.0, -3.0]])
    path = Trajectory("truth", np.zeros(1), north_and_up, level, north_and_up, True, np.zeros(1, int), 0)
    turned = in_enu(path)
    assert turned.position_m[0] == pytest.approx([0.0, 10.0, 3.0])
    assert matrix(turned.quaternion[0]) @ [1.0, 0.0, 0.0] == pytest.approx([0.0, 1.0, 0.0])  # forward is north
    assert matrix(turned.quaternion[0]) @ [0.0, 0.0, 1.0] == pytest.approx([0.0, 0.0, 1.0])  # up is up


def test_tum_holds_the_record_to_nine_decimals(tmp_path):
    record = flight("landing")
    written = export(record, "tum", tmp_path / "run.tum")
    assert [file.name for file in written.files] == ["run_estimate.tum", "run_truth.tum"]
    assert written.notes == []
    for file, name in zip(written.files, ("estimate", "truth"), strict=True):
        rows = read_tum(file)
        assert "earth NED, body FRD" in file.read_text().splitlines()[1]
        assert np.allclose(rows[:, :4], record.matrix(name, ("t_s", *POSITION_NED)), atol=1e-9, rtol=0)
        assert np.allclose(rows[:, 4:], record.matrix(name, (*QUATERNION[1:], "qw")), atol=1e-9, rtol=0)
        assert (np.diff(rows[:, 0]) >= 0).all()
        assert np.allclose(np.linalg.norm(rows[:, 4:], axis=1), 1.0)


def test_paths_differ_by_the_same_distances_in_either_frame(tmp_path):
    record = flight("takeoff")
    differences = []
    for frame in ("ned", "enu"):
        files = export(record, "tum", tmp_path / f"{frame}.tum", frame).files
        estimate, truth = map(read_tum, files)
        differences.append(np.linalg.norm(estimate[:, 1:4] - truth[:, 1:4], axis=1))
        assert f"earth {frame.upper()}" in files[0].read_text()
    own = record.matrix("estimate", POSITION_NED) - record.matrix("truth", POSITION_NED)
    assert np.allclose(differences, np.linalg.norm(own, axis=1), atol=1e-8)


def test_rows_that_are_no_pose_are_left_out_and_counted_and_time_runs_forward(tmp_path):
    record = awkward()
    written = export(record, "tum", tmp_path / "a.tum")
    rows = read_tum(tmp_path / "a_estimate.tum")
    assert len(rows) == 39
    assert np.isfinite(rows).all()
    assert (np.diff(rows[:, 0]) > 0).all()
    assert written.notes[0] == "estimate: 1 of 40 rows left out, not finite"


def test_truth_without_attitude_is_level_and_says_so(tmp_path):
    written = export(awkward(), "tum", tmp_path / "a.tum")
    assert np.array_equal(np.unique(read_tum(tmp_path / "a_truth.tum")[:, 4:], axis=0), [[0.0, 0.0, 0.0, 1.0]])
    assert written.notes[1:] == ["truth: no attitude recorded, level and facing north written; compare positions only"]
    export(awkward(), "euroc", tmp_path / "a.csv")
    names, rows = read_euroc(tmp_path / "a_truth.csv")
    assert names[-1] == "q_RS_z []"  # no attitude, so no velocity in the earth's axes
    assert rows.shape == (40, 8)


def test_some_attitudes_missing_lose_only_their_rows():
    record = flight("landing")
    qw = record.tables["estimate"]["qw"]
    row = np.arange(len(qw))
    record.tables["estimate"]["qw"] = np.where((row >= 10) & (row < 15), np.nan, qw)
    record.tables["truth"]["qw"] = np.full(len(qw), np.nan)
    estimate, truth = trajectories(record)
    assert estimate.oriented
    assert estimate.left_out == 5
    assert not truth.oriented
    assert truth.left_out == 0


def test_euroc_is_nanoseconds_and_earth_velocity(tmp_path):
    record = replay(duration_s=60.0)
    written = export(record, "euroc", tmp_path / "r.csv")
    assert [file.name for file in written.files] == ["r_estimate.csv", "r_autopilot.csv"]
    names, rows = read_euroc(tmp_path / "r_autopilot.csv")
    assert names[0] == "#timestamp [ns]"
    assert len(names) == rows.shape[1] == 11
    assert not any(name.startswith("b_") for name in names)
    assert all(line.split(",")[0].isdigit() for line in written.files[0].read_text().splitlines()[1:])
    assert np.allclose(rows[:, 0] * 1e-9, record.tables["autopilot"]["t_s"], atol=1e-9)
    speed = np.hypot(*record.matrix("autopilot", ("vel_u_m_s", "vel_v_m_s")).T)
    assert np.allclose(np.hypot(rows[:, 8], rows[:, 9]), speed, atol=1e-6)
    yaw = 2.0 * np.arctan2(record.tables["autopilot"]["qz"], record.tables["autopilot"]["qw"])
    u, v = record.matrix("autopilot", ("vel_u_m_s", "vel_v_m_s")).T
    assert np.allclose(rows[:, 8], u * np.cos(yaw) - v * np.sin(yaw), atol=1e-6)


def test_a_record_without_a_path_is_refused(tmp_path):
    record = Record()
    record.add("estimate", {"t_s": np.zeros(2), **{name: np.full(2, np.nan) for name in POSITION_NED}})
    for to in ("tum", "euroc", "mcap", "ulog"):
        with pytest.raises(InputError, match="holds no path"):
            export(record, to, tmp_path / "a.tum")
    assert list(tmp_path.iterdir()) == []


def test_all_files_appear_or_none(tmp_path, monkeypatch):
    def fails_on_truth(path, frame):
        if path.name == "truth":
            raise OSError(28, "No space left on device")
        return b"written"

    monkeypatch.setitem(paths.TEXTS, ".tum", (fails_on_truth, bytes))
    with pytest.raises(OSError, match="No space"):
        export(flight("landing"), "tum", tmp_path / "run.tum")
    assert list(tmp_path.iterdir()) == []
