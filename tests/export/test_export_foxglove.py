"""The layout for Foxglove: every topic and message path in it is in the MCAP file that lies beside it."""

from __future__ import annotations

import json
import re
from importlib.resources import files

import numpy as np
import pytest
from mcap.reader import make_reader

from flownav.core.record import POSITION_NED, Record
from flownav.export.formats import export
from flownav.export.mcap_file import LAYOUT, layout_for, topic_and_field
from flownav.export.trajectory import error_table, trajectories
from report_records import flight

PATH = re.compile(r"^(/\w+)((?:\{\w+==\"\w+\"\})*)\.(\w+)(?:\.@negative)?$")


def rows_by_topic(path):
    found: dict[str, list[dict]] = {}
    with path.open("rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages():
            found.setdefault(channel.topic, []).append(json.loads(message.data))
    return found


def leaves(node) -> list[str]:
    return [node] if isinstance(node, str) else [*leaves(node["first"]), *leaves(node["second"])]


def paths_of(layout) -> list[str]:
    return [path["value"] for panel in layout["configById"].values() for path in panel.get("paths", ())]


def whole() -> dict:
    return json.loads(files("flownav.export").joinpath(LAYOUT).read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    path = tmp_path_factory.mktemp("foxglove") / "landing.mcap"
    record = flight("landing")
    written = export(record, "foxglove", path)
    assert written.files == [path, path.with_name("landing_layout.json")]
    return record, rows_by_topic(path), json.loads(written.files[1].read_text())


def test_every_message_path_gives_a_number_in_the_file(exported):
    _, rows, layout = exported
    values = paths_of(layout)
    assert len(values) > 20
    for value in values:
        topic, filters, field = PATH.match(value).groups()
        assert topic_and_field(value) == (topic, field)
        wanted = dict(re.findall(r"\{(\w+)==\"(\w+)\"\}", filters))
        fitting = [row for row in rows[topic] if all(row.get(name) == want for name, want in wanted.items())]
        if wanted.get("sensor", "gps_position") in {row["sensor"] for row in rows["/innovation"]}:
            assert any(isinstance(row.get(field), int | float) for row in fitting), value


def test_every_topic_of_a_panel_is_in_the_file(exported):
    _, rows, layout = exported
    for panel in layout["configById"].values():
        assert set(panel.get("topics", ())) <= rows.keys()
        assert panel.get("topicPath", "/events") in rows
    space = layout["configById"]["3D!flownav"]
    assert set(space["topics"]) == {"/estimate/pose", "/truth/pose"}
    frames = {row["child_frame_id"] for row in rows["/tf"]} | {row["parent_frame_id"] for row in rows["/tf"]}
    assert {space["followTf"], space["layers"]["grid"]["frameId"]} <= frames


def test_the_panels_of_the_layout_are_those_that_are_configured(exported):
    assert sorted(leaves(exported[2]["layout"])) == sorted(exported[2]["configById"])
    assert sorted(leaves(whole()["layout"])) == sorted(whole()["configById"])


def test_every_curve_that_the_whole_layout_knows_is_of_the_records_vocabulary():
    """A misspelt column would never be drawn, and nothing else would say so."""
    from flownav.core.measurement import COLUMNS, Sensor
    from flownav.core.record import TABLES
    from flownav.export.trajectory import BOUND, ERROR

    known = {f"/{name}": {*columns, "t_s"} for name, columns in TABLES.items()} | {"/error": {*ERROR, *BOUND}}
    known |= {f"/{sensor.name.lower()}": {*COLUMNS[sensor], "quality"} for sensor in Sensor}
    sensors = {sensor.name.lower(): COLUMNS[sensor] for sensor in Sensor}
    for value in paths_of(whole()):
        topic, filters, field = PATH.match(value).groups()
        assert field in known[topic], value
        wanted = dict(re.findall(r"\{(\w+)==\"(\w+)\"\}", filters))
        if wanted:
            assert wanted["component"] in sensors[wanted["sensor"]], value


def test_what_a_record_lacks_is_left_out_with_its_panel():
    layout = layout_for({"/estimate": {"pos_n_m": {}}, "/estimate/pose": {}, "/tf": {}})
    assert set(layout["configById"]) == {"3D!flownav", "Plot!position_n"}
    assert leaves(layout["layout"]) == ["3D!flownav", "Plot!position_n"]
    assert paths_of(layout) == ["/estimate.pos_n_m"]


def test_the_errors_in_the_file_are_estimate_less_truth_between_three_sigma(exported):
    record, rows, _ = exported
    error = record.matrix("estimate", POSITION_NED) - record.matrix("truth", POSITION_NED)
    for k, axis in enumerate("ned"):
        assert np.allclose([row[f"error_{axis}_m"] for row in rows["/error"]], error[:, k])
        bound = [row[f"three_sigma_{axis}_m"] for row in rows["/error"]]
        assert np.allclose(bound, 3.0 * record.tables["estimate"][f"std_pos_{axis}_m"])


def test_without_a_truth_there_is_no_error():
    record = flight("landing")
    del record.tables["truth"]
    assert error_table(record, trajectories(record)) is None
    later = Record()
    for name, start in (("estimate", 0.0), ("truth", 9.0)):
        later.add(name, {"t_s": start + np.arange(3.0), **{column: np.zeros(3) for column in POSITION_NED}})
    assert error_table(later, trajectories(later)) is None
