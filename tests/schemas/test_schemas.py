"""The published schemas: no key of a file is taken back, and what commands print is what their schemas say."""

from __future__ import annotations

import json
import math
import tomllib
from functools import cache
from pathlib import Path

import jsonschema
import pytest
import typer.main
from typer.testing import CliRunner

from draft_schema import COMMANDS as COMMANDS_FILE
from draft_schema import dense, draft
from flownav.cli import app
from flownav.cli.schemas import MODELS, _in_full, names, schema_of, title_of
from flownav.core.errors import InputError
from flownav.core.parameter_files import shipped
from flownav.core.record import Record
from replay_logs import log_of_flight
from schemas import Key, broken, keys_of, read, written

COMMANDS = set(typer.main.get_command(app).commands)  # type: ignore[attr-defined]
FILES = {
    "file-scenario": ("takeoff", "landing", "gusty", "pad_return", "approach", "samples/flight"),
    "file-helicopter": ("maxi_joker_3",),
    "file-multirotor": ("quad_450", "hexa_550"),
    "file-sensor": ("px4flow_paper", "samples/flow_sensor"),
    "file-requirement": ("requirements/approach", "requirements/landing"),
}


@cache
def validator(name: str) -> jsonschema.Draft202012Validator:
    """Of a schema, which is looked through once."""
    found = schema_of(name)
    jsonschema.Draft202012Validator.check_schema(found)
    return jsonschema.Draft202012Validator(found)


def require_fit(entries: object, name: str) -> None:
    """ValidationError where these are not as the schema says."""
    validator(name).validate(entries)


@pytest.mark.parametrize("name", names())
def test_a_schema_is_one_and_carries_its_number(name):
    found = validator(name).schema
    assert found["$id"] == f"urn:flownav:schema:{name}:1"


@pytest.mark.parametrize("name", names())
def test_the_list_has_the_title_of_the_schema(name):
    assert title_of(name) == schema_of(name)["title"]


def test_a_name_that_is_none_is_one_line():
    with pytest.raises(InputError, match=r"^file-nothing: no such schema; choose from accuracy, .*, view$"):
        schema_of("file-nothing")


# -- those of files: what was published is kept -----------------------------------------------------------------
PUBLISHED = read()
KEY = Key(["number"], 0.0, 10.0, False)


@pytest.mark.parametrize("name", MODELS)
def test_no_published_key_is_taken_back_and_new_ones_are_noted(name):
    now = keys_of(schema_of(name))
    assert not list(broken(PUBLISHED[name], now))
    assert PUBLISHED[name] == now, "make schemas"


def test_published_keys_know_ranges_lists_and_what_must_be_there():
    assert PUBLISHED["file-scenario"]["flight.duration_s"] == Key(["number", "provenance"], 0.1, 3600.0, False)
    assert PUBLISHED["file-requirement"]["requirement[].at_most"].types == ["null", "number", "provenance"]
    assert PUBLISHED["file-multirotor"]["kind"] == Key(["=multirotor"], -math.inf, math.inf, True)


@pytest.mark.parametrize(("now", "says"), [
    ({}, ["a.b: is gone"]),
    ({"a.b": KEY._replace(types=["integer"])}, ["a.b: may no longer be number"]),
    ({"a.b": KEY._replace(low=0.1)}, ["a.b: takes 0.1 to 10, and took 0 to 10"]),
    ({"a.b": KEY._replace(high=9.0)}, ["a.b: takes 0 to 9, and took 0 to 10"]),
    ({"a.b": KEY._replace(required=True)}, ["a.b: must be there now"]),
    ({"a.b": KEY, "c": KEY._replace(required=True)}, ["c: is new and must be there"]),
    ({"a.b": Key(["number", "string"], -1.0, 11.0, False), "c": KEY, "d.e": KEY._replace(required=True)}, []),
], ids=["gone", "type", "low", "high", "required", "new and required", "wider"])  # fmt: skip
def test_what_breaks_a_published_schema_is_a_line(now, says):
    assert list(broken({"a.b": KEY}, now)) == says


def test_published_keys_are_written_as_they_are_read(tmp_path):
    noted = {"x": {"a": KEY, "b": Key(["=tail rotor stuck", "null"], -math.inf, math.inf, True)}}
    path = tmp_path / "keys.json"
    path.write_text(written(noted), encoding="utf-8")
    assert read(path) == noted


# -- those of commands: short, and in full ----------------------------------------------------------------------
def test_a_short_schema_in_full():
    shared = {"pair": {"type": "array?", "items": "number"}}
    short = {"type": "object", "properties": {"a": "string|number?", "b": "#pair"}, "additionalProperties": False}
    assert _in_full(short, shared) == {
        "type": "object",
        "properties": {
            "a": {"type": ["null", "number", "string"]},
            "b": {"type": ["array", "null"], "items": {"type": "number"}},
        },
        "additionalProperties": False,
    }


def test_the_file_of_commands_is_dense_and_shares_only_what_several_use():
    text = COMMANDS_FILE.read_text(encoding="utf-8")
    found = json.loads(text)
    assert dense(found) + "\n" == text
    assert all(text.count(f'"#{name}"') > 1 for name in found["shared"])


def test_a_draft_fits_what_it_was_drafted_from():
    printed = [{"schema": 1, "a": 1.5, "flights": 3, "told": {"x": 1.0}}, {"schema": 1, "a": 2, "b": [{"c": "d"}]}]
    schema = _in_full(draft("x", "An example.", printed), {})
    for each in printed:
        jsonschema.validate(each, schema)
    assert schema["required"] == ["schema", "a"]
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(printed[0] | {"flights": 2.5}, schema)


@pytest.mark.parametrize(("name", "file"), [(name, file) for name, files in FILES.items() for file in files])
def test_files_that_ship_fit_and_a_misspelt_key_does_not(name, file):
    entries = tomllib.loads(shipped(f"{file}.toml").read_text(encoding="utf-8"))
    require_fit(entries, name)
    with pytest.raises(jsonschema.ValidationError):
        require_fit(entries | {"misspelt_key": 1}, name)


def test_settings_fit():
    require_fit({"flow_gain_x": 1.1}, "file-settings")
    with pytest.raises(jsonschema.ValidationError):
        require_fit({"flow_gain_x": "1.1"}, "file-settings")


def test_schemas_of_commands_are_of_commands():
    of_commands = {name for name in names() if not name.startswith(("file-", "record-", "certificate"))}
    assert of_commands <= COMMANDS


# -- what commands print ----------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    place = tmp_path_factory.mktemp("printed")
    log_of_flight(20.0).write(place / "log")
    printed(place, "replay", "log", "--out", "r.fnr", "--no-report")
    return place


def printed(folder: Path, *arguments: str):
    """The JSON object of a command that runs in a folder."""
    import os

    before = Path.cwd()
    os.chdir(folder)
    try:
        done = CliRunner().invoke(app, [*arguments, "--json"])
    finally:
        os.chdir(before)
    return json.loads(done.stdout)


@pytest.mark.parametrize("arguments", [
    ("sample", "--list"),
    ("info", "log"),
    ("replay", "log", "--no-report", "--gps-outage", "5:10"),
    ("replay", "log", "--no-report", "--outage-table", "5:15:5"),
    ("compare", "r.fnr", "r.fnr"),
    ("vehicle",),
    ("vehicle", "quad-450"),
    ("report", "r.fnr"),
    ("export", "r.fnr", "--to", "csv"),
    ("rig", "--duration", "5"),
    ("pad", "--print", "pad.png"),
    ("certify", "approach", "--plan"),
    ("schema",),
], ids=" ".join)  # fmt: skip
def test_what_a_command_prints_fits_its_schema(folder, arguments):
    found = printed(folder, *arguments)
    require_fit(found, arguments[0])
    with pytest.raises(jsonschema.ValidationError):
        require_fit(found | {"schema": 2}, arguments[0])


def test_a_records_manifest_fits(folder):
    manifest = json.loads(json.dumps(Record.load(folder / "r.fnr").manifest))
    require_fit(manifest, "record-manifest")


def test_every_command_that_prints_an_object_has_a_schema():
    asked = {name for name, command in typer.main.get_command(app).commands.items()
             if any("--json" in parameter.opts for parameter in command.params)}  # fmt: skip
    assert asked <= set(names())


def test_a_flight_fits(folder):
    for more in ((), ("--flights", "2"), ("--filter", "paper")):
        found = printed(folder, "fly", "landing", "--no-report", *more)
        require_fit(found, "fly")


def test_a_certificate_and_what_certify_prints_fit(folder):
    found = printed(
        folder, "certify", "approach", "--flights", "16", "--ranking", "0", "--records", "0", "--out", "cert"
    )
    require_fit(found, "certify")
    written = json.loads((folder / "cert" / "certificate.json").read_text(encoding="utf-8"))
    require_fit(written, "certificate")
    assert written["schema"] == 1
    require_fit(printed(folder, "certify", "--verify", "cert", "--again", "4"), "certify")


def test_the_command_prints_and_lists_them():
    run = CliRunner()
    assert json.loads(run.invoke(app, ["schema", "file-sensor"]).stdout) == schema_of("file-sensor")
    assert all(name in run.invoke(app, ["schema"]).stdout for name in names())
