"""KML and GPX read back, by gpxpy and as XML: every point where the record has it to a centimetre, at its time."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from datetime import UTC, datetime

import gpxpy
import numpy as np
import pymap3d
import pytest
from typer.testing import CliRunner

from command import printed
from export_records import awkward
from flownav.cli import app
from flownav.core.errors import InputError
from flownav.core.record import POSITION_NED, Record
from flownav.export.formats import export
from flownav.export.paths import GX, KML, origin_from
from report_records import flight

ORIGIN = (47.397742, 8.545594, 488.1)


def located(clock_start_s: float | None = None) -> Record:
    record = flight("landing")
    record.manifest["parameters"] = {"origin_lat_lon_deg_alt_m": list(ORIGIN)}
    if clock_start_s is not None:
        record.manifest["clock_start_s"] = clock_start_s
    return record


def assert_within_a_centimetre(place, position):
    """place (n, 3): latitude, longitude, altitude; position (n, 3) NED about ORIGIN."""
    back = np.column_stack(pymap3d.geodetic2ned(*np.asarray(place, float).T, *ORIGIN))
    assert np.abs(back - position).max() < 0.01


def test_gpx_holds_every_position_at_its_time(tmp_path):
    record = located(1.76e9)
    written = export(record, "gpx", tmp_path / "a.gpx")
    assert written.notes == []
    gpx = gpxpy.parse((tmp_path / "a.gpx").read_text())
    assert gpx.creator == "flownav"
    tracks = {track.name: track.segments[0].points for track in gpx.tracks}
    assert list(tracks) == ["estimate", "truth", "GPS"]
    for name, table in (("estimate", "estimate"), ("truth", "truth"), ("GPS", "gps_position")):
        points = tracks[name]
        assert_within_a_centimetre(
            [(point.latitude, point.longitude, point.elevation) for point in points], record.matrix(table, POSITION_NED)
        )
        seconds = [(point.time - datetime(1970, 1, 1, tzinfo=UTC)).total_seconds() - 1.76e9 for point in points]
        assert np.allclose(seconds, record.tables[table]["t_s"], atol=1e-3)


def test_kml_holds_every_position_at_its_time(tmp_path):
    record = located()
    written = export(record, "kml", tmp_path / "a.kml")
    assert written.notes == ["times count from 1970-01-01: the record does not say on which day it flew"]
    root = ElementTree.parse(tmp_path / "a.kml").getroot()
    marks = {mark.find(f"{{{KML}}}name").text: mark for mark in root.iter(f"{{{KML}}}Placemark")}
    assert list(marks) == ["estimate", "truth", "GPS"]
    styles = {f"#{style.get('id')}" for style in root.iter(f"{{{KML}}}Style")}
    for name, mark in marks.items():
        assert mark.find(f"{{{KML}}}styleUrl").text in styles
        track = mark.find(f"{{{GX}}}Track")
        assert track.find(f"{{{KML}}}altitudeMode").text == "absolute"
        place = [tuple(map(float, each.text.split())) for each in track.findall(f"{{{GX}}}coord")]
        table = "gps_position" if name == "GPS" else name
        swapped = [(latitude, longitude, altitude) for longitude, latitude, altitude in place]
        assert_within_a_centimetre(swapped, record.matrix(table, POSITION_NED))
        when = [each.text for each in track.findall(f"{{{KML}}}when")]
        assert len(when) == len(place)
        assert when[0] == "1970-01-01T00:00:00.000Z"
        assert when[1] == "1970-01-01T00:00:00.020Z"


@pytest.mark.parametrize("to", ["kml", "gpx"])
def test_a_record_that_knows_no_origin_asks_for_one(tmp_path, to):
    flight("landing").save(tmp_path / "run.fnr")
    run = CliRunner()
    error = run.invoke(app, ["export", str(tmp_path / "run.fnr"), "--to", to]).exception
    assert isinstance(error, InputError)
    assert "give --origin LAT,LON,ALT" in printed(error)
    assert [path.name for path in tmp_path.iterdir()] == ["run.fnr"]
    options = ["--to", to, "--origin", ",".join(map(str, ORIGIN))]
    for _ in range(2):  # its own file is replaced
        done = run.invoke(app, ["export", str(tmp_path / "run.fnr"), *options])
        assert done.exit_code == 0, done.output
    assert (tmp_path / f"run.{to}").is_file()


@pytest.mark.parametrize(("text", "why"), [
    ("47.4,8.5", "LAT,LON,ALT is needed"), ("a,b,c", "LAT,LON,ALT is needed"), ("91,8.5,400", "latitude to 90"),
    ("47,181,400", "longitude to 180"), ("nan,8,4", "latitude to 90"), ("47,8,1e9", "altitude in metres"),
])  # fmt: skip
def test_an_origin_that_cannot_be_is_refused(text, why):
    with pytest.raises(InputError, match=why):
        origin_from(text)


def test_an_origin_is_for_what_lies_on_the_earth(tmp_path):
    with pytest.raises(InputError, match="origin is for kml and gpx"):
        export(awkward(), "csv", tmp_path / "a", origin=ORIGIN)


def test_rows_that_are_not_finite_are_left_out_and_said(tmp_path):
    written = export(awkward(), "gpx", tmp_path / "a.gpx", origin=ORIGIN)
    assert written.notes[0] == "estimate: 1 of 40 rows left out, not finite"
    gpx = gpxpy.parse((tmp_path / "a.gpx").read_text())
    assert [len(track.segments[0].points) for track in gpx.tracks] == [39, 40]
