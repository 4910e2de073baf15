"""`flownav export` as a user meets it: where files go, JSON alone, one-line errors, the sources left alone."""

from __future__ import annotations

import json
import os

import pytest
from typer.testing import CliRunner

from command import printed
from export_records import awkward
from flownav.cli import app
from flownav.core.errors import InputError
from flownav.export.formats import FORMATS

NAMES = {
    "mcap": ["run.mcap"],
    "foxglove": ["run.mcap", "run_layout.json"],
    "kml": ["run.kml"],
    "gpx": ["run.gpx"],
    "tum": ["run_estimate.tum", "run_truth.tum"],
    "euroc": ["run_estimate.csv", "run_truth.csv"],
    "parquet": ["run_parquet"],
    "csv": ["run_csv"],
    "ulog": ["run.ulg"],
}


@pytest.fixture
def record(tmp_path):
    located = awkward()
    located.tables["estimate"]["t_s"].sort()  # a file out of order is refused
    located.manifest["parameters"] = {"origin_lat_lon_deg_alt_m": [47.4, 8.5, 488.0]}
    located.save(tmp_path / "run.fnr")
    return tmp_path / "run.fnr"


def run(*arguments):
    return CliRunner().invoke(app, ["export", *map(str, arguments)])


def refused(*arguments):
    """The one line of a refusal, which leaves stdout empty."""
    done = run(*arguments)
    assert isinstance(done.exception, InputError), done.output
    assert done.stdout == ""
    assert "\n" not in str(done.exception)
    return printed(done.exception)


@pytest.mark.parametrize("to", FORMATS)
def test_every_format_lies_beside_the_record(record, to):
    done = run(record, "--to", to, "--json")
    assert done.exit_code == 0, done.output
    facts = json.loads(done.stdout)
    assert (facts["record"], facts["format"]) == (str(record), to)
    assert sorted(path.name for path in record.parent.iterdir()) == sorted(["run.fnr", *NAMES[to]])
    assert all(os.path.isfile(file) for file in facts["files"])
    assert isinstance(facts["notes"], list)


def test_people_read_where_it_lies_and_what_to_know(record, tmp_path):
    done = run(record, "--to", "tum", "--out", tmp_path / "other" / "flight.tum")
    assert done.stdout.splitlines() == [
        f"Written: {tmp_path / 'other' / 'flight_estimate.tum'}",
        f"Written: {tmp_path / 'other' / 'flight_truth.tum'}",
        "Note: estimate: 1 of 40 rows left out, not finite",
        "Note: truth: no attitude recorded, level and facing north written; compare positions only",
    ]


@pytest.mark.parametrize(("out", "lies"), [("there", "there/run.ulg"), ("new", "new.ulg"), ("v1.2", "v1.2.ulg")])
def test_out_may_be_a_folder_or_lack_its_suffix(record, tmp_path, out, lies):
    (tmp_path / "there").mkdir()
    done = run(record, "--to", "ulog", "--out", tmp_path / out, "--json")
    assert json.loads(done.stdout)["files"] == [str(tmp_path / lies)]
    assert (tmp_path / lies).is_file()


def test_options_that_do_not_fit_are_refused(record, tmp_path):
    assert refused(record, "--to", "rosbag") == (
        "--to rosbag: choose from mcap, foxglove, tum, euroc, parquet, csv, ulog, kml, gpx"
    )
    assert refused(record, "--to", "tum", "--frame", "utm") == "--frame utm: choose from ned, enu"
    assert "--frame is for tum and euroc" in refused(record, "--to", "mcap", "--frame", "enu")
    assert refused(record, "--to", "mcap", "--merge", record) == "--merge is for --to ulog"
    assert "was not replayed from this file" in refused(record, "--to", "ulog", "--merge", record)
    assert "no such record" in refused(tmp_path / "gone.fnr", "--to", "csv")
    assert [path.name for path in tmp_path.iterdir()] == ["run.fnr"]


def test_sources_are_never_replaced(tmp_path):
    awkward().save(tmp_path / "run.ulg")  # a record under an unlucky name
    before = (tmp_path / "run.ulg").read_bytes()
    assert "would replace what it is made from" in refused(tmp_path / "run.ulg", "--to", "ulog")
    log = tmp_path / "original.ulg"
    log.write_bytes(b"x")
    merge = ("--to", "ulog", "--merge", log, "--out", log)
    assert "would replace what it is made from" in refused(tmp_path / "run.ulg", *merge)
    assert (tmp_path / "run.ulg").read_bytes() == before
    assert log.read_bytes() == b"x"


def test_a_place_that_cannot_be_written_is_one_line(record, tmp_path):
    (tmp_path / "file").write_text("")
    for to in FORMATS:
        assert "cannot be written" in refused(record, "--to", to, "--out", tmp_path / "file" / "under")
    run(record, "--to", "csv")
    again = run(record, "--to", "csv")
    assert "run_csv is there already; writing" in again.output
    assert (tmp_path / "run_csv-1" / "estimate.csv").is_file()
