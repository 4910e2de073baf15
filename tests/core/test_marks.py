"""A file is flownav's by a mark at a fixed place and by its content: notes that speak of flownav are a user's."""

from __future__ import annotations

import json
import zipfile

import numpy as np
import pytest
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from export_records import awkward
from flownav.cli.output import place
from flownav.core.errors import InputError
from flownav.core.guard import write_page, write_text
from flownav.core.marks import DECLARATION, HASH, XML, is_ours, is_signed, marked, marked_json
from flownav.core.record import Record
from flownav.export.formats import export
from flownav.export.samples.kinds import README, SAMPLES, write_samples
from flownav.export.viewing import write_rrd
from flownav.lab.optics.frame_files import save_picture

NOTES = {
    "notes.toml": "# my notes on flownav\ngain = 1.0\n",
    "sensor.toml": "# written by flownav\ngain = 1.0\n",
    "quoted.toml": "# a file that says\n# written by flownav; SHA-256 of what follows: " + 64 * "0" + "\n",
    "false.toml": "# written by flownav; SHA-256 of what follows: " + 64 * "0" + "\ngain = 1.0\n",
    "settings.toml": "# Settings of flownav's navigator; use them with `flownav replay`\nflow_gain_x = 1.1\n",
    "flights.csv": "t_s,flownav_x_m,flownav_y_m\n0,1,2\n",
    "euroc.csv": "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m]\n1403636580838555648,4.688319,-1.786938\n",
    "path.tum": "# flownav estimate; NED; t_s x y z qx qy qz qw\n0 0 0 0 0 0 0 1\n",
    "track.kml": "<?xml version='1.0' encoding='utf-8'?>\n<kml><name>flownav: mine</name></kml>\n",
    "track.gpx": '<?xml version="1.0"?>\n<gpx creator="flownav"></gpx>\n',
    "table.md": "| case | flights | my own remarks |\n|---|---|---|\n",
    "layout.json": '{"flownav": 1, "configById": {}}',
    "digest.json": '{"flownav_sha256": "' + 64 * "0" + '", "x": 1}',
    "list.json": '["flownav"]',
    "broken.json": '{"flownav_sha256": ',
    "page.html": "<html><head><title>x</title></head><body><meta name=\"generator\" content=\"flownav\"></body></html>",
    "quoted.html": "<html><head><title>the mark <meta name=\"generator\" content=\"flownav\"></title></head></html>",
    "comment.html": '<!-- <head><meta name="generator" content="flownav"> --><html><head></head></html>',
    "plain.html": '<html><head><meta name="generator" content="flownav"><title>my flownav site</title></head></html>',
    "false.html": '<html><head><meta name="generator" content="flownav"><meta name="flownav-sha256" content="'
    + 64 * "0" + '"></head></html>',
    "short.html": '<html><head><meta name="generator" content="flownav"><meta name="flownav-sha256" content="',
    "early.html": '<html><meta name="generator" content="flownav"><head><title>x</title></head></html>',
    "plain.txt": "flownav flew well today\n",
}  # fmt: skip


@pytest.mark.parametrize("name", NOTES)
def test_what_a_user_wrote_about_flownav_is_not_replaced(tmp_path, name):
    (tmp_path / name).write_text(NOTES[name], encoding="utf-8")
    with pytest.raises(InputError, match="was not written by flownav"):
        place(tmp_path / name, force=True)
    assert (tmp_path / name).read_text(encoding="utf-8") == NOTES[name]


@pytest.mark.parametrize(
    "name", ["bytes.ulg", "logged.ulg", "other.png", "other.mcap", "other.rrd", "web.zip", "notes.zip", "data.zip"]
)
def test_nor_is_what_another_tool_made(tmp_path, name):
    path = tmp_path / name
    if name == "bytes.ulg":
        path.write_bytes(b"ULog\x01\x12\x35" + b"flownav_x" + bytes(100))
    elif name == "logged.ulg":  # a message in words
        path.write_bytes(b"ULog\x01\x12\x35" + b"I\x1achar[9] notes flownav_record")
    elif name == "other.png":
        text = PngInfo()
        text.add_text("Title", "the flownav report")
        Image.fromarray(np.zeros((4, 4), np.uint8)).save(path, pnginfo=text)
    elif name == "other.mcap":
        path.write_bytes(b"\x89MCAP0\r\n\x01\x15" + bytes(11) + b"\r\0\0\0flownav-like notes")
    elif name == "other.rrd":
        path.write_bytes(b"RRF2" + bytes(60) + b"\x1a\x0c\n\x0aflownav_is_mine")
    else:
        with zipfile.ZipFile(path, "w") as bundle:
            manifest = {"web.zip": '{"manifest_version": 3}', "data.zip": '{\n "schema": 1,\n "title": "my points"}'}
            bundle.writestr("manifest.json", manifest.get(name, '{"schema": 1}'))
            bundle.writestr("notes.txt" if name == "notes.zip" else "a.parquet", "flownav")
    assert not is_ours(path)
    with pytest.raises(InputError, match="was not written by flownav"):
        place(path, force=True)


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """Everything that an export writes under a name that a user gives."""
    folder, files = tmp_path_factory.mktemp("exported"), []
    record = awkward()
    for to, suffix in (
        ("foxglove", ".mcap"),
        ("tum", ".tum"),
        ("euroc", ".csv"),
        ("ulog", ".ulg"),
        ("kml", ".kml"),
        ("gpx", ".gpx"),
    ):
        origin = (47.0, 8.0, 400.0) if to in ("kml", "gpx") else None
        files += export(record, to, folder / f"x{suffix}", origin=origin).files
    write_rrd(record, folder / "x.rrd")
    save_picture(np.zeros((4, 4), np.uint8), folder / "x.png")
    write_page("<html><head></head><body>x</body></html>", folder / "x.html")
    Record({"kind": "fly"}).save(folder / "x.fnr")
    return files + [folder / name for name in ("x.rrd", "x.png", "x.html", "x.fnr")]


def test_what_flownav_wrote_is_replaced(exported):
    assert len(exported) > 10
    for path in exported:
        assert place(path, force=True) == path, path


@pytest.mark.parametrize("suffix", [".tum", ".csv", ".kml", ".gpx", ".json"])
def test_what_was_edited_by_hand_is_its_editors(exported, tmp_path, suffix):
    for path in (each for each in exported if each.suffix == suffix):
        edited = tmp_path / path.name
        edited.write_bytes(path.read_bytes().replace(b"0", b"1"))
        assert not is_ours(edited)
        edited.write_bytes(path.read_bytes() + b"\n")
        assert is_ours(edited) == (suffix == ".json")


@pytest.mark.parametrize("text", ["x", "é \udcff", "y" * 10_000, '<meta name="generator" content="flownav">'])
def test_a_page_that_was_edited_by_hand_is_its_editors(tmp_path, text):
    path = tmp_path / "x.html"
    page = f"<!doctype html><html><head><title>{text}</title></head><body>{text}</body></html>"
    for _ in range(2):  # again over itself
        write_page(page, path)
        assert is_ours(path)
    written = path.read_bytes()
    for old, new in ((b"</body>", b"<p>my notes</p></body>"), (b"<title>", b"<title>my "), (b"doctype", b"DOCTYPE")):
        path.write_bytes(written.replace(old, new, 1))
        assert not is_ours(path)
        with pytest.raises(InputError, match="was not written by flownav"):
            place(path, force=True)
    assert written.replace(written[written.index(b"<meta") : written.index(b"<title>")], b"", 1) == page.encode(
        errors="backslashreplace"
    )


def test_a_mark_is_at_a_fixed_place_and_holds_the_rest(tmp_path):
    path = tmp_path / "x.toml"
    for comment, text in ((HASH, "gain = 1\n"), (XML, f"{DECLARATION}<kml/>\n"), (XML, "| case |\n"), (HASH, "")):
        write_text(text, path, comment)
        assert is_ours(path)
        assert marked(text, comment) == path.read_bytes()
        path.write_bytes(b"\n" + path.read_bytes())
        assert not is_ours(path)
        path.unlink()
    write_text("\udcff is no text\n", path)
    assert is_ours(path)
    path.write_bytes(marked_json({"a": [1, 2.5]}))
    assert is_ours(path)
    assert list(json.loads(path.read_text())) == ["flownav_sha256", "a"]


def test_a_live_record_is_known_wherever_its_manifest_says_so(tmp_path):
    Record({"parameters": {f"n{k}": k for k in range(2000)}, "kind": "live"}).save(tmp_path / "x.fnr")
    assert not is_ours(tmp_path / "x.fnr")


def test_a_record_that_was_put_together_again_is_not_flownavs(tmp_path):
    path = tmp_path / "x.fnr"
    Record({"kind": "fly"}, {"events": {"t_s": np.arange(2.0)}}).save(path)
    assert is_ours(path)
    with zipfile.ZipFile(path) as bundle:
        parts = {name: bundle.read(name) for name in bundle.namelist()}
    for named, order in ((True, sorted(parts)), (False, ["manifest.json", "events.parquet"])):
        with zipfile.ZipFile(path, "w") as bundle:
            for name in order:  # others in front, or the day of today
                bundle.writestr(zipfile.ZipInfo(name) if named else name, parts[name])
        assert not is_ours(path)
        with pytest.raises(InputError, match="was not written by flownav"):
            place(path, force=True)


def test_another_file_signs_for_one_as_it_is(tmp_path):
    (tmp_path / "rig.csv").write_text("t_s\n0\n")
    write_text('rig_csv_sha256 = "' + 64 * "0" + '"\n', tmp_path / "rig.toml")
    assert not is_signed(tmp_path / "rig.csv", tmp_path / "rig.toml")
    assert not is_signed(tmp_path / "absent", tmp_path / "rig.toml")


def test_a_users_file_in_the_folder_of_samples_is_not_replaced(tmp_path):
    sample = [one for one in SAMPLES if one.name == "flight.bin"]
    (written,) = write_samples(sample, tmp_path, 1)
    (tmp_path / "flight.bin").write_bytes(b"my own flight")
    with pytest.raises(InputError, match=r"flight.bin: is there already and was not written by flownav"):
        write_samples(sample, tmp_path, 1, force=True)
    assert written.path.read_bytes() == b"my own flight"
    assert write_samples(sample, tmp_path, 1)[0].path.name == "flight-1.bin"
    assert "flight-1.bin" in (tmp_path / README).read_text()
    assert not is_ours(tmp_path)
