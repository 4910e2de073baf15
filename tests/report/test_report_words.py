"""Names in a report: a log by its file's name, north only where it is known, an error by its cause."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import numpy as np
import pytest

from flownav.core.measurement import Sensor
from flownav.core.record import Record
from flownav.report import spectrum as spectra
from flownav.report.content import summary, tiles, title
from flownav.report.html import coded, flight_facts
from flownav.report.landing import key_places
from flownav.report.path_picture import path_picture
from flownav.report.series import first_fused_s, is_north_known
from flownav.scoring.headline import WITH_GPS
from flownav.scoring.phases import Phase
from report_records import replay

SVG = "{http://www.w3.org/2000/svg}"


@pytest.mark.parametrize(
    ("manifest", "said"),
    [
        ({"kind": "replay", "log": "/data/My_flight-03.ulg"}, "My_flight-03.ulg"),
        ({"kind": "fly", "scenario": "pad_return"}, "Pad return"),
        ({"kind": "live"}, "Live"),
        ({}, "Flight"),
    ],
)
def test_a_log_is_called_as_its_file_and_a_scenario_in_words(manifest, said):
    assert title(Record(manifest)) == said


def fused(*sensors):
    count = len(sensors)
    return {"t_s": np.arange(1.0, 1.0 + count), "sensor": np.array(sensors), "fused": np.ones(count, bool)}


def has_arrow(record):
    """Whether the map has the N of its north arrow."""
    path, _ = (view.find(f"{SVG}g") for view in ElementTree.fromstring(path_picture(record).svg))
    return "N" in [text.text for text in path.iter(f"{SVG}text")]


@pytest.mark.parametrize(
    ("sensors", "known"),
    [(("imu", "flow_rate", "range"), False), (("flow_rate", "mag"), True), (("gps_velocity",), True)],
)
def test_north_has_an_arrow_only_where_a_sensor_tells_it(sensors, known):
    record = replay()
    record.tables["innovation"] = fused(*sensors)
    assert is_north_known(record) == known
    assert has_arrow(record) == known
    assert flight_facts(record, [])["north"] == known
    record.manifest["kind"] = "fly"
    assert is_north_known(record)


@pytest.mark.parametrize(
    ("error_m", "said"),
    [((3.5, 3.0, 0.1, 0.1), "height, before the first range"), ((3.5, 3.0, 3.0, 0.1), "height"), ((0.1,) * 4, "north")],
)
def test_the_largest_error_is_named_as_of_before_the_first_range(error_m, said):
    t_s = np.arange(4.0) * 2.0
    place = {name: np.zeros(4) for name in ("pos_n_m", "pos_e_m", "pos_d_m")}
    tables = {
        "truth": {"t_s": t_s, **place},
        "flown": {"t_s": t_s, **place, "pos_d_m": np.array(error_m)},
        "innovation": fused("mag", "range"),
    }
    states = {"x": {"max_error": 0.2}, "y": {"max_error": 0.1}, "z": {"max_error": max(error_m)}}
    scores = {"max_position_error_m": max(0.2, *error_m), "states": states}
    record = Record({"kind": "fly", "scores": scores}, tables)
    assert first_fused_s(record, Sensor.RANGE) == 2.0
    assert first_fused_s(record, Sensor.PAD) is None
    tile = next(tile for tile in tiles(record) if tile.label == "Largest error of one axis")
    assert tile.note == f"of the autopilot's input: {said}"


@pytest.mark.parametrize(("sensors", "explained"), [(("flow_rate", "gps_position"), True), (("flow_rate",), False)])
def test_errors_against_a_truth_are_explained_where_gps_shares_them(sensors, explained):
    truth = {"horizontal_rms_m": 0.7, "horizontal_max_m": 1.3}
    scores = {"truth": truth, "end_drift_m": 1.6, "coverage": dict.fromkeys(sensors)}
    said = summary(Record({"kind": "replay", "duration_s": 100.0, "scores": scores}))
    assert (f"m apart. {WITH_GPS}." in said.replace("\N{NO-BREAK SPACE}", " ")) == explained
    untrue = Record({"kind": "replay", "duration_s": 100.0, "scores": scores | {"truth": None}})
    assert WITH_GPS not in summary(untrue)


def test_what_stands_between_backticks_is_code_and_the_rest_is_escaped():
    assert coded("`flownav fly <a>` & on") == "<code>flownav fly &lt;a&gt;</code> &amp; on"


def test_a_key_that_is_full_goes_on_in_a_line_below():
    names = ["ground", "climb", "ground", "hover"]
    assert key_places(names, 500.0) == [("ground", 0.0, 35.0), ("climb", 60.8, 35.0), ("hover", 111.3, 35.0)]
    assert [(name, y) for name, _, y in key_places(names, 120.0)] == [
        ("ground", 35.0),
        ("climb", 35.0),
        ("hover", 50.0),
    ]


@pytest.mark.parametrize(
    "names",
    [
        ["ground", "hover"],
        ["ground", "climb", "descent", "transit", "approach", "outbound leg", "touchdown", "landed", "hover"],
    ],
)
def test_phases_are_coloured_below_their_key(monkeypatch, names):
    phases = [Phase(name, float(k), k + 1.0) for k, name in enumerate(names)]
    monkeypatch.setattr("flownav.report.path_picture.phases_of", lambda record: phases)
    _, height = (view.find(f"{SVG}g") for view in ElementTree.fromstring(path_picture(replay()).svg))
    key = [float(one.get("y")) for one in height.iter(f"{SVG}text") if one.text in names]
    bands = [float(one.get("y")) for one in height.iter(f"{SVG}rect") if one.get("class") == "band"]
    assert len(set(key)) == (1 if len(names) == 2 else 2)
    assert min(bands) >= max(key) + 15.0


def test_the_last_frequency_is_not_cut_at_the_edge():
    frequency = np.linspace(0.0, 50.2, 252)
    found = {"frequency_hz": frequency.tolist()} | {key: (1.0 + frequency).tolist() for key, _, _ in spectra.ROWS}
    (panel,) = spectra.spectrum(Record({"vibration": found}))
    sides = {text: side for side, text in re.findall(r'text-anchor="(\w+)">(\d+(?: Hz)?)</text>', panel.drawing.svg)}
    assert sides["50 Hz"] == "end"
    assert sides["45"] == "middle"


def test_on_a_phone_the_spectrum_has_fewer_marks_and_keeps_its_largest_line():
    frequency = np.linspace(0.0, 400.0, 2001)
    values = np.where(np.arange(2001) == 1003, 100.0, 1.0).tolist()
    found = {"frequency_hz": frequency.tolist()} | {key: values for key, _, _ in spectra.ROWS}
    (panel,) = spectra.spectrum(Record({"vibration": found}))
    wide, narrow = ElementTree.fromstring(f"<div>{panel.drawing.svg}</div>").findall("svg")
    assert [one.get("class") for one in (wide, narrow)] == ["still on-wide", "still on-narrow"]
    assert float(narrow.get("viewBox").split()[2]) < 400.0
    marks = [
        [one.text for one in view.iter("text") if re.fullmatch(r"\d+0( Hz)?", one.text)] for view in (wide, narrow)
    ]
    assert len(set(marks[1])) <= 5 < len(set(marks[0]))
    for view, least in ((wide, 1000), (narrow, 380)):
        lines = [np.array([list(map(float, pair.split(","))) for pair in one.get("points").split()])
                 for one in view.iter("polyline")]  # fmt: skip
        for line in lines:
            assert least <= len(line) <= 2.0 * float(view.get("viewBox").split()[2])
            highest = line[np.argmin(line[:, 1])]
            share = (highest[0] - line[0, 0]) / (line[-1, 0] - line[0, 0])
            assert share == pytest.approx(1003 / 2000, abs=0.003)
