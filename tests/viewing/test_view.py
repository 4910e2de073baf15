"""A record as a file for Rerun, read back with Rerun's own reader: what is in it, where, and how it lies in space."""

from __future__ import annotations

import json
import sys

import numpy as np
import pytest
from typer.testing import CliRunner

from export_records import awkward
from flownav.cli import app
from flownav.core.errors import InputError
from flownav.core.frames import rotation_from_quaternion, to_body, to_earth
from flownav.core.record import POSITION_NED, QUATERNION, VELOCITY_BODY, Record
from flownav.export.viewing import has_display, write_rrd
from flownav.export.viewing.shapes import cameras, flow_arrows, vehicle_outline
from report_records import flight

rr = pytest.importorskip("rerun")

LENS = {"forward_m": 0.1, "right_m": 0.02, "down_m": 0.12}
HELICOPTER = {
    "main_rotor.radius_m": {"value": 0.89}, "main_rotor.hub_above_cg_m": {"value": 0.25},
    "tail_rotor.behind_cg_m": {"value": 1.065}, "tail_rotor.radius_m": {"value": 0.155},
    "skids.half_length_m": {"value": 0.2}, "skids.half_track_m": {"value": 0.14},
    "skids.cg_above_skid_m": {"value": 0.22},
}  # fmt: skip


def equipped() -> Record:
    """A landing with a pad, two cameras and a helicopter in its parameters."""
    record = flight("landing")
    record.manifest["pad_size_m"] = 2.0
    record.manifest["parameters"] = {
        "vehicle": HELICOPTER,
        "flow_sensor": {"optics": {"focal_length_px": 666.67, "image_side_px": 64.0}},
        "sensors": {"flow_camera": {"lens": LENS},
                    "pad_camera": {"half_view_deg": 60.0, "half_view_right_deg": 40.0, "lens": LENS}},
    }  # fmt: skip
    return record


class Read:
    """The chunks of a file by entity: columns by name, rows in order of time (static ones have none)."""

    def __init__(self, path):
        from rerun.chunk import RrdReader

        reader = RrdReader(str(path))
        assert [entry.application_id for entry in reader.recordings()] == ["flownav"]
        self.blueprints = reader.blueprints()
        self.parts = {}
        for chunk in reader.stream():
            self.parts.setdefault(chunk.entity_path, []).append(chunk.to_record_batch())

    def rows(self, entity, component):
        """Times [s] and values of one component, rows without it left out."""
        t_s, values = [], []
        for batch in self.parts[entity]:
            if component not in batch.schema.names:
                continue
            times = batch["t_s"].cast("int64").to_pylist() if "t_s" in batch.schema.names else [None] * batch.num_rows
            for time, value in zip(times, batch[component].to_pylist(), strict=True):
                if value is not None:
                    t_s.append(np.nan if time is None else 1e-9 * time)
                    values.append(value)
        order = np.argsort(t_s, kind="stable")
        return np.array(t_s)[order], [values[k] for k in order]

    def one(self, entity, component):
        """A component that stands still."""
        (value,) = self.rows(entity, component)[1]
        return np.array(value)


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    record = equipped()
    path = tmp_path_factory.mktemp("view") / "landing.rrd"
    assert write_rrd(record, path) == []
    return record, Read(path)


@pytest.mark.parametrize("name", ["estimate", "truth"])
def test_every_pose_is_the_records_at_its_time(shown, name):
    record, read = shown
    t_s, position = read.rows(f"/enu/ned/{name}", "Transform3D:translation")
    _, quaternion = read.rows(f"/enu/ned/{name}", "Transform3D:quaternion")
    assert np.allclose(t_s, record.tables[name]["t_s"], atol=1e-9)
    assert np.allclose(np.array(position)[:, 0], record.matrix(name, POSITION_NED), rtol=1e-6, atol=1e-6)
    xyzw = record.matrix(name, QUATERNION)[:, [1, 2, 3, 0]]
    assert np.allclose(np.array(quaternion)[:, 0], xyzw, atol=1e-6)


def test_the_line_of_a_path_leads_from_pose_to_pose(shown):
    record, read = shown
    t_s, strips = read.rows("/enu/ned/path/truth", "LineStrips3D:strips")
    position = record.matrix("truth", POSITION_NED)
    assert np.allclose(t_s, record.tables["truth"]["t_s"][1:])
    assert np.allclose(np.array(strips)[:, 0], np.stack([position[:-1], position[1:]], axis=1), atol=1e-5)


def test_ned_lies_in_a_right_handed_frame_with_up_upwards(shown):
    """Rerun's view is given right, forward, up of east, north, up; a metre of north, east, down comes out as that."""
    _, read = shown
    right, forward, up = 3, 5, 1  # rerun.components.ViewDir
    assert read.one("/enu", "ViewCoordinates:xyz").tolist() == [[right, forward, up]]
    x, y, z, w = read.one("/enu/ned", "Transform3D:quaternion")[0]
    turn = np.array(rotation_from_quaternion(w, x, y, z)).reshape(3, 3)
    assert np.allclose(turn @ [1.0, 2.0, 3.0], [2.0, 1.0, -3.0], atol=1e-6)
    assert np.linalg.det(turn) == pytest.approx(1.0)


def test_the_ellipsoid_is_three_standard_deviations_about_the_estimate(shown):
    record, read = shown
    _, half = read.rows("/enu/ned/estimate_3_sigma", "Ellipsoids3D:half_sizes")
    _, centres = read.rows("/enu/ned/estimate_3_sigma", "Ellipsoids3D:centers")
    stated = record.matrix("estimate", tuple(f"std_{name}" for name in POSITION_NED))
    assert np.allclose(np.array(half)[:, 0], 3.0 * stated, rtol=1e-6)
    assert np.allclose(np.array(centres)[:, 0], record.matrix("estimate", POSITION_NED), atol=1e-5)


def test_a_frustum_looks_down_from_its_lens_with_the_angle_of_view_of_its_sheet(shown):
    _, read = shown
    for name, half_forward, half_right in (
        ("flow_camera", np.arctan(32.0 / 666.67), np.arctan(32.0 / 666.67)),
        ("pad_camera", np.radians(60.0), np.radians(40.0)),
    ):
        entity = f"/enu/ned/truth/{name}"
        assert np.allclose(read.one(entity, "Transform3D:translation"), [[0.1, 0.02, 0.12]])
        right, backward, depth = read.one(entity, "Transform3D:mat3x3").reshape(3, 3)  # a matrix by columns
        assert right.tolist() == [0.0, 1.0, 0.0]
        assert backward.tolist() == [-1.0, 0.0, 0.0]
        assert depth.tolist() == [0.0, 0.0, 1.0]
        focal = read.one(entity, "Pinhole:image_from_camera").reshape(3, 3)[0, 0]
        width, height = read.one(entity, "Pinhole:resolution")[0]
        assert np.arctan(0.5 * width / focal) == pytest.approx(half_right, rel=1e-5)
        assert np.arctan(0.5 * height / focal) == pytest.approx(half_forward, rel=1e-5)


def test_the_pad_and_the_vehicle_have_the_records_sizes(shown):
    _, read = shown
    corners = read.one("/enu/ned/pad", "Mesh3D:vertex_positions")
    assert corners.min(axis=0).tolist() == [-1.0, -1.0, 0.0]
    assert corners.max(axis=0).tolist() == [1.0, 1.0, 0.0]
    outline = read.rows("/enu/ned/truth/vehicle", "LineStrips3D:strips")[1][0]
    points = np.array([point for line in outline for point in line])
    assert points[:, 0].min() == pytest.approx(-1.065 - 0.155, abs=1e-5)
    assert points[:, 1].max() == pytest.approx(0.89, abs=1e-5)
    assert points[:, 2].max() == pytest.approx(0.22, abs=1e-6)


def test_errors_lie_between_their_bounds_and_are_estimate_less_truth(shown):
    record, read = shown
    error = record.matrix("estimate", POSITION_NED) - record.matrix("truth", POSITION_NED)
    for k, axis in enumerate(("north_m", "east_m", "down_m")):
        _, values = read.rows(f"/plots/error/{axis}/estimate_less_truth", "Scalars:scalars")
        _, bounds = read.rows(f"/plots/error/{axis}/plus_3_sigma", "Scalars:scalars")
        assert np.allclose(np.ravel(values), error[:, k])
        assert np.allclose(np.ravel(bounds), 3.0 * record.tables["estimate"][f"std_{POSITION_NED[k]}"])


def test_every_innovation_is_a_point_of_its_components_curve(shown):
    record, read = shown
    table = record.tables["innovation"]
    for sensor, component in sorted(set(zip(table["sensor"], table["component"], strict=True))):
        mine = (table["sensor"] == sensor) & (table["component"] == component)
        t_s, values = read.rows(f"/plots/innovation/{sensor}/{component}", "Scalars:scalars")
        assert np.allclose(t_s, table["t_s"][mine], atol=1e-9)
        assert np.allclose(np.ravel(values), table["innovation"][mine])


def test_events_are_told_in_words_at_their_times(shown):
    record, read = shown
    t_s, texts = read.rows("/events", "TextLog:text")
    assert np.allclose(t_s, np.sort(record.tables["events"]["t_s"]))
    assert any("touchdown" in text[0] for text in texts)


def test_a_blueprint_is_in_the_file(shown):
    assert len(shown[1].blueprints) == 1


def test_a_row_of_flow_without_data_takes_the_arrow_away(shown):
    record, read = shown
    t_s, arrows = read.rows("/enu/ned/truth/flow", "Arrows3D:vectors")
    table = record.tables["flow_velocity"]
    seen = table["quality"] > 0
    assert sum(map(len, arrows)) == np.count_nonzero(seen)
    last = np.flatnonzero(seen)[-1]
    gone = [len(arrow) for time, arrow in zip(t_s, arrows, strict=True) if abs(time - table["t_s"][last + 1]) < 1e-9]
    assert gone == [0]
    assert np.allclose(arrows[0][0][:2], record.matrix("flow_velocity", VELOCITY_BODY[:2])[seen][0], atol=1e-6)


def test_the_arrow_of_a_flow_rate_is_the_velocity_over_the_ground():
    """Level flight at known velocity and turning rates, 2 m up: sign and scale from PX4's convention."""
    t_s = np.arange(5) * 0.1
    forward, right, height, rates = 1.5, -0.7, 2.0, np.array([0.2, -0.1])
    flow = np.array([rates[0] - right / height, rates[1] + forward / height])
    record = Record()
    columns = zip(("flow_x_rad_s", "flow_y_rad_s", "gyro_x_rad_s", "gyro_y_rad_s"), (*flow, *rates), strict=True)
    record.add("flow_rate", {"t_s": t_s, **{name: np.full(5, value) for name, value in columns},
                             "quality": np.array([200.0, 0.0, 200.0, 200.0, 200.0])})  # fmt: skip
    record.add("range", {"t_s": t_s[:1] - 0.15, "range_m": np.array([height])})
    arrows = flow_arrows(record)
    assert np.isnan(arrows.velocity_m_s[1]).all()  # quality 0
    assert np.isnan(arrows.velocity_m_s[4]).all()  # the range is older than half a second
    assert np.allclose(arrows.velocity_m_s[[0, 2, 3]], [forward, right, 0.0])


def test_positions_in_the_earth_are_those_of_a_body_vector_turned_by_the_pose():
    """The frames of shapes are body FRD: a lens that is below the body of a level vehicle is below it in NED."""
    level = rotation_from_quaternion(1.0, 0.0, 0.0, 0.0)
    camera = cameras(equipped())[0]
    assert to_earth(level, *camera.lens_m)[2] > 0.0
    assert np.allclose(to_body(level, *to_earth(level, *camera.lens_m)), camera.lens_m)


def test_a_multirotor_has_an_arm_and_a_propeller_for_each_rotor():
    record = Record({"parameters": {"vehicle": {
        "frame.rotor_count": {"value": 6}, "frame.arm_m": {"value": 0.275}, "propeller.radius_m": {"value": 0.12},
    }}})  # fmt: skip
    lines = vehicle_outline(record)
    arms = [line for line in lines if len(line) == 2]
    assert len(arms) == 6
    assert len(lines) == 12
    assert all(np.hypot(*arm[1][:2]) == pytest.approx(0.275) for arm in arms)
    assert np.degrees(np.arctan2(arms[0][1][1], arms[0][1][0])) == pytest.approx(30.0)


@pytest.mark.parametrize("parameters", [None, [], {"vehicle": "x", "sensors": 3, "flow_sensor": []},
                                        {"vehicle": {"main_rotor.radius_m": {"value": float("nan")}}},
                                        {"vehicle": {"main_rotor.radius_m": 1e9}}])  # fmt: skip
def test_a_record_that_says_nothing_sound_of_its_vehicle_is_shown_without_one(tmp_path, parameters):
    record = flight("landing")
    record.manifest["parameters"] = parameters
    assert vehicle_outline(record) == []
    assert cameras(record) == []
    write_rrd(record, tmp_path / "a.rrd")
    assert "/enu/ned/truth/vehicle" not in Read(tmp_path / "a.rrd").parts


@pytest.mark.skipif(sys.platform == "win32", reason="limits of a file's size are of Unix")
@pytest.mark.parametrize("missing", [1, 50, 20_000, 300_000])
def test_a_file_that_the_disk_does_not_hold_is_not_written_and_said(tmp_path, missing, capfd):
    """Where Rerun itself writes the file, one that is cut raises nothing, and some never end."""
    import resource

    write_rrd(awkward(), tmp_path / "whole.rrd")
    size = (tmp_path / "whole.rrd").stat().st_size
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    limit = size - 1_500 - missing  # the sizes of two differ by up to 200 bytes
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        with pytest.raises(OSError, match="too large"):
            write_rrd(awkward(), tmp_path / "x.rrd")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert [path.name for path in tmp_path.iterdir()] == ["whole.rrd"]


def test_an_awkward_record_is_shown_with_notes(tmp_path):
    """Times out of order and before zero, rows that are not finite, truth without an attitude."""
    notes = write_rrd(awkward(), tmp_path / "a.rrd")
    assert notes[0] == "estimate: 1 of 40 rows left out, not finite"
    t_s, _ = Read(tmp_path / "a.rrd").rows("/enu/ned/estimate", "Transform3D:translation")
    assert len(t_s) == 39
    assert t_s[0] == pytest.approx(-0.22)


@pytest.fixture
def saved(tmp_path):
    flight("landing").save(tmp_path / "run.fnr")
    return tmp_path / "run.fnr"


def run(*arguments):
    return CliRunner().invoke(app, ["view", *map(str, arguments)])


def test_the_command_writes_a_file_and_writes_it_again_when_forced(saved, tmp_path):
    for more in ([], ["--force"]):
        done = run(saved, "--out", tmp_path / "other", "--json", *more)
        assert done.exit_code == 0, done.output
        facts = json.loads(done.stdout)
        assert facts.pop("schema") == 1
        assert facts == {
            "record": str(saved), "file": str(tmp_path / "other.rrd"), "window": False, "notes": [],
        }  # fmt: skip
    assert run(saved, "--out", tmp_path / "b.rrd").stdout.splitlines() == [f"Written: {tmp_path / 'b.rrd'}"]


def test_without_a_display_the_file_lies_beside_the_record_and_one_line_says_so(saved, monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    (line,) = run(saved).stdout.splitlines()
    path = saved.with_suffix(".rrd")
    assert line == f"No display here, so no window: written {path}; `rerun {path}` opens it where there is one"
    assert path.is_file()


def test_with_a_display_a_window_is_asked_for(saved, monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setenv("DISPLAY", ":0")
    assert has_display()
    asked = []
    monkeypatch.setattr(rr.RecordingStream, "spawn", lambda self, **options: asked.append(options))
    assert run(saved).stdout.splitlines() == [f"Opened in Rerun: {saved}"]
    assert asked[0]["default_blueprint"] is not None
    assert [path.name for path in saved.parent.iterdir()] == ["run.fnr"]


def test_a_viewer_that_does_not_start_is_one_line(saved, monkeypatch):
    monkeypatch.setattr(sys, "platform", "darwin")

    def fails(self, **options):
        raise RuntimeError("no viewer\nsecond line")

    monkeypatch.setattr(rr.RecordingStream, "spawn", fails)
    error = run(saved).exception
    assert isinstance(error, InputError)
    assert str(error) == "Rerun's viewer does not start (no viewer); `flownav view --out FILE.rrd` writes a file"


def test_without_the_package_the_error_says_how_to_get_it(saved, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)
    error = run(saved, "--out", tmp_path / "a.rrd").exception
    assert isinstance(error, InputError)
    assert str(error) == "flownav view needs Rerun's package rerun-sdk: pip install 'flownav[view]'"
    assert [path.name for path in tmp_path.iterdir()] == ["run.fnr"]


def test_a_record_without_a_path_is_refused(tmp_path):
    record = Record()
    record.add("range", {"t_s": np.arange(3.0), "range_m": np.ones(3)})
    with pytest.raises(InputError, match="the record holds no path"):
        write_rrd(record, tmp_path / "a.rrd")
    assert list(tmp_path.iterdir()) == []
