"""Records: whole or not at all, and clear about what is wrong with a file."""

from __future__ import annotations

import json
import zipfile

import numpy as np
import pytest

from flownav.core.errors import InputError
from flownav.core.record import SCHEMA_VERSION, Record


def test_a_table_needs_time_and_equal_lengths():
    with pytest.raises(ValueError, match="no t_s column"):
        Record().add("truth", {"pos_n_m": [1.0]})
    with pytest.raises(ValueError, match="different lengths"):
        Record().add("truth", {"t_s": [0.0, 1.0], "pos_n_m": [1.0]})


def test_missing_file_says_what_writes_one(tmp_path):
    with pytest.raises(InputError, match="no such record"):
        Record.load(tmp_path / "none.fnr")


@pytest.mark.parametrize("content", [b"", b"not a zip", b"PK\x03\x04 truncated"])
def test_a_file_that_is_no_record_is_refused(tmp_path, content):
    path = tmp_path / "bad.fnr"
    path.write_bytes(content)
    with pytest.raises(InputError, match="not a flownav record"):
        Record.load(path)


def test_a_newer_schema_is_refused(tmp_path):
    path = tmp_path / "new.fnr"
    with zipfile.ZipFile(path, "w") as bundle:
        bundle.writestr("manifest.json", json.dumps({"schema": SCHEMA_VERSION + 1}))
    with pytest.raises(InputError, match="newer than this flownav"):
        Record.load(path)


def test_a_failed_write_leaves_the_old_record_and_no_part_file(tmp_path):
    path = tmp_path / "flight.fnr"
    Record({"kind": "fly"}).save(path)
    before = path.read_bytes()
    broken = Record()
    broken.tables["truth"] = {"t_s": np.array([object()])}
    with pytest.raises(Exception):  # noqa: B017, PT011  (whatever the writer raises)
        broken.save(path)
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["flight.fnr"]
