"""MCAP as its own reader reads it: schemas kept, frames that compose, strict JSON, one order of time."""

from __future__ import annotations

import json
import sys

import numpy as np
import pytest
from mcap.reader import make_reader

from export_records import awkward
from flownav.core.errors import InputError
from flownav.core.frames import rotation_from_quaternion
from flownav.core.record import POSITION_NED, QUATERNION
from flownav.export.formats import export
from report_records import flight

KINDS = {"number": (int, float), "integer": int, "string": str, "boolean": bool, "object": dict}


def refuse(constant):
    raise AssertionError(f"{constant} is no JSON")


def messages(path):
    """(topic, schema, time, content) of every message in the file's own order, checksums proved."""
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        return [
            (channel.topic, json.loads(schema.data), message.log_time,
             json.loads(message.data, parse_constant=refuse))
            for schema, channel, message in reader.iter_messages(log_time_order=False)
        ]  # fmt: skip


def conforms(value, schema):
    assert isinstance(value, KINDS[schema["type"]])
    if schema["type"] == "object":
        assert set(schema.get("required", ())) <= set(value) <= set(schema["properties"])
        for name, part in value.items():
            conforms(part, schema["properties"][name])


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    path = tmp_path_factory.mktemp("mcap") / "a.mcap"
    return path, export(awkward(), "mcap", path)


def test_every_message_keeps_its_schema(exported):
    found = messages(exported[0])
    for _, schema, _, content in found:
        conforms(content, schema)
    assert {schema["title"] for _, schema, _, _ in found} >= {"foxglove.PoseInFrame", "foxglove.FrameTransform"}


def test_every_row_is_a_message_in_order_of_time(exported):
    record, found = awkward(), messages(exported[0])
    topics = [topic for topic, *_ in found]
    for name, table in record.tables.items():
        assert topics.count(f"/{name}") == len(table["t_s"])
    times = [time for _, _, time, _ in found]
    assert times == sorted(times)
    assert min(times) >= 0


def test_times_before_zero_are_moved_by_whole_seconds_and_noted(exported):
    note = "all times are 1 s later than in the record: the format has no negative time"
    assert note in exported[1].notes
    for topic, _, time, content in messages(exported[0]):
        if topic == "/range":
            assert time == round((content["t_s"] + 1.0) * 1e9)
        if topic == "/estimate/pose":
            assert content["timestamp"] == {"sec": time // 10**9, "nsec": time % 10**9}


def test_values_that_json_cannot_say_are_left_out_of_their_row(exported):
    rows = [content for topic, _, _, content in messages(exported[0]) if topic == "/range"]
    assert sum("range_m" not in row for row in rows) == 5
    events = [content for topic, _, _, content in messages(exported[0]) if topic == "/events"]
    assert [event.get("value") for event in events] == [None, 0.2, None]
    assert events[0]["detail"] == 'a "quoted", comma\nand a second line'


def test_poses_are_the_estimate_and_the_frames_put_up_upwards(tmp_path):
    record = flight("landing")
    export(record, "mcap", tmp_path / "l.mcap")
    found = messages(tmp_path / "l.mcap")
    poses = [content["pose"] for topic, _, _, content in found if topic == "/estimate/pose"]
    position = np.array([[pose["position"][axis] for axis in "xyz"] for pose in poses])
    orientation = np.array([[pose["orientation"][axis] for axis in "wxyz"] for pose in poses])
    assert np.allclose(position, record.matrix("estimate", POSITION_NED))
    assert np.allclose(orientation, record.matrix("estimate", QUATERNION))
    transforms = [content for topic, _, _, content in found if topic == "/tf"]
    tree = {(entry["parent_frame_id"], entry["child_frame_id"]) for entry in transforms}
    assert tree == {("enu", "ned"), ("ned", "estimate"), ("ned", "truth")}
    earth = next(entry["rotation"] for entry in transforms if entry["child_frame_id"] == "ned")
    turn = np.array(rotation_from_quaternion(*(earth[axis] for axis in "wxyz"))).reshape(3, 3)
    assert np.allclose(turn @ [1.0, 2.0, -3.0], [2.0, 1.0, 3.0])  # north 1, east 2, up 3


def test_the_manifest_is_attached(exported):
    with exported[0].open("rb") as stream:
        (attachment,) = make_reader(stream).iter_attachments()
    assert attachment.name == "manifest.json"
    assert json.loads(attachment.data) == {"schema": 1, **awkward().manifest}


def test_without_the_package_the_error_says_how_to_get_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "mcap.writer", None)
    with pytest.raises(InputError, match=r"pip install 'flownav\[mcap\]'"):
        export(awkward(), "mcap", tmp_path / "a.mcap")
    assert list(tmp_path.iterdir()) == []
