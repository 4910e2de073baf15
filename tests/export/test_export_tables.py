"""Folders of Parquet and CSV: the record again, whole or not at all."""

from __future__ import annotations

import csv
import json

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from export_records import awkward
from flownav.core.files import folder_written_whole
from flownav.core.record import Record
from flownav.export import trajectory
from flownav.export.formats import export


def read_csv(path):
    with path.open(newline="", encoding="utf-8") as stream:
        names, *rows = csv.reader(stream)
    return names, rows


def numbers(cells):
    return np.array([float(cell) if cell else np.nan for cell in cells])


def test_parquet_is_the_record(tmp_path):
    record = awkward()
    written = export(record, "parquet", tmp_path / "p")
    assert {file.name for file in written.files} == {file.name for file in (tmp_path / "p").iterdir()}
    for name, table in record.tables.items():
        read = pq.read_table(tmp_path / "p" / f"{name}.parquet")
        assert read.column_names == list(table)
        for column, values in table.items():
            back = read[column].to_numpy()
            if values.dtype.kind == "O":
                assert back.tolist() == values.tolist()
            else:
                assert back.dtype == values.dtype
                assert np.array_equal(back, values, equal_nan=values.dtype.kind == "f")


def test_csv_reads_back_to_the_same_values(tmp_path):
    record = awkward()
    export(record, "csv", tmp_path / "c")
    for name, table in record.tables.items():
        names, rows = read_csv(tmp_path / "c" / f"{name}.csv")
        assert names == list(table)
        assert len(rows) == len(table["t_s"])
        for k, values in enumerate(table.values()):
            cells = [row[k] for row in rows]
            if values.dtype.kind == "O":
                assert cells == values.tolist()
            else:
                assert np.array_equal(numbers(cells), values.astype(float), equal_nan=True)


def test_a_truth_value_is_one_or_zero_and_nan_is_empty(tmp_path):
    export(awkward(), "csv", tmp_path / "c")
    names, rows = read_csv(tmp_path / "c" / "innovation.csv")
    assert {row[names.index("fused")] for row in rows} == {"0", "1"}
    assert {row[names.index("test_ratio")] for row in rows} == {""}


@given(st.lists(st.tuples(st.floats(width=64), st.text(st.characters(codec="utf-8", exclude_characters="\0\r")))))
def test_any_number_and_any_text_come_back_from_csv(tmp_path_factory, rows):
    record = Record()
    values = np.array([value for value, _ in rows])
    record.add("t", {"t_s": values, "words": np.array([text for _, text in rows], object)})
    folder = tmp_path_factory.mktemp("any") / "c"
    export(record, "csv", folder)
    _, read = read_csv(folder / "t.csv")
    assert np.array_equal(numbers([row[0] for row in read]), values, equal_nan=True)
    assert [row[1] for row in read] == [text for _, text in rows]


@pytest.mark.parametrize("to", ["csv", "parquet"])
def test_the_manifest_lies_beside_the_tables(tmp_path, to):
    export(awkward(), to, tmp_path / "f")
    assert json.loads((tmp_path / "f" / "manifest.json").read_text()) == {"schema": 1, **awkward().manifest}


@pytest.mark.parametrize("to", ["csv", "parquet"])
def test_a_folder_that_holds_something_stays_as_it_is(tmp_path, to):
    folder = tmp_path / "mine"
    folder.mkdir()
    export(awkward(), to, folder)  # an empty one is taken
    (folder / "notes.txt").write_text("keep me")
    before = {file.name: file.read_bytes() for file in folder.iterdir()}
    with pytest.raises(FileExistsError, match="not empty"):
        export(awkward(), to, folder)
    assert {file.name: file.read_bytes() for file in folder.iterdir()} == before
    assert list(tmp_path.iterdir()) == [folder]


def test_a_folder_appears_whole_or_not_at_all(tmp_path, monkeypatch):
    monkeypatch.setattr(trajectory, "is_text", lambda column: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        export(awkward(), "parquet", tmp_path / "deep" / "f")
    assert list((tmp_path / "deep").iterdir()) == []


def test_a_written_folder_takes_its_name_at_the_end_only(tmp_path):
    with folder_written_whole(tmp_path / "f") as temporary:
        (temporary / "a").write_text("a")
        assert not (tmp_path / "f").exists()
    assert [file.name for file in (tmp_path / "f").iterdir()] == ["a"]
    assert list(tmp_path.iterdir()) == [tmp_path / "f"]


def test_a_text_that_is_not_there_is_null_or_an_empty_cell(tmp_path):
    record = Record()
    record.add("t", {"t_s": np.arange(2.0), "words": np.array(["None", None], object)})
    export(record, "parquet", tmp_path / "p")
    export(record, "csv", tmp_path / "c")
    assert pq.read_table(tmp_path / "p" / "t.parquet")["words"].to_pylist() == ["None", None]
    assert read_csv(tmp_path / "c" / "t.csv")[1] == [["0.0", "None"], ["1.0", ""]]
