"""Columns go to Arrow and come back as they were, and pandas is loaded for none of them."""

from __future__ import annotations

import io
import subprocess
import sys

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from flownav.core import arrow_columns as arrow

COLUMNS = {
    "float": np.array([1.5, np.nan, -np.inf, 4.0]),
    "single": np.array([1.5, np.nan, 3.0, 4.0], np.float32),
    "whole": np.array([1, -2, 3, 2**62]),
    "byte": np.array([1, 2, 255, 0], np.uint8),
    "truth": np.array([True, False, False, True]),
    "text": np.array(["flow", "", "Höhe", None], object),
}


@pytest.mark.parametrize("name", COLUMNS)
def test_a_column_comes_back_as_it_was(name):
    told = COLUMNS[name]
    table = arrow.table_of({name: told})
    assert table.column(name).to_pylist()[2] == told.tolist()[2]  # what Arrow itself reads there
    assert table.schema.field(name).type == pa.table({name: told}).schema.field(name).type
    for one in (table.column(name), table.column(name).chunk(0), table.column(name).chunk(0).slice(1, 2)):
        found = arrow.as_numpy(one)
        expected = told[1:3] if len(one) == 2 else told
        assert found.dtype == told.dtype
        assert np.array_equal(found, expected, equal_nan=told.dtype.kind == "f")
    assert np.array_equal(arrow.as_numpy(table.slice(0, 0).column(name)), told[:0])


def test_chunks_follow_each_other_and_what_is_missing_is_no_number():
    found = arrow.as_numpy(pa.chunked_array([pa.array([1.0, None]), pa.array([], pa.float64()), pa.array([3.0])]))
    assert np.array_equal(found, [1.0, np.nan, 3.0], equal_nan=True)
    with pytest.raises(ValueError, match="2 cells without a number"):
        arrow.as_numpy(pa.array([1, None, None]))


def test_words_are_kept_once_and_known_again():
    told = ["pad", "flow", "pad", "pad"]
    column = arrow.words(told)
    assert column.dictionary.to_pylist() == ["pad", "flow"]
    assert arrow.as_numpy(column).tolist() == told
    missing = pa.array(["a", None, "b"]).dictionary_encode()
    assert arrow.places(missing).tolist() == [0, -1, 1]
    assert arrow.as_numpy(missing).tolist() == ["a", None, "b"]


def test_a_file_of_a_table_has_the_bytes_that_it_has_of_arrows_own():
    files = [io.BytesIO(), io.BytesIO()]
    for file, table in zip(files, (arrow.table_of(COLUMNS), pa.table(COLUMNS)), strict=True):
        pq.write_table(table, file, compression="zstd")
    assert files[0].getvalue() == files[1].getvalue()


def test_pandas_is_not_loaded():
    code = """
import io, sys
import numpy as np
import pyarrow as pa
from flownav.core import arrow_columns as arrow
table = arrow.table_of({"a": np.zeros(3), "b": np.array([True, False, True]), "c": np.array(["x", None, "y"], object)})
for name in table.column_names:
    arrow.as_numpy(table.column(name))
arrow.as_numpy(arrow.words(["x", "y"]))
assert "pandas" not in sys.modules
pa.array(np.zeros(3))
print("pandas" in sys.modules)"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "True", "Arrow does not load pandas any more: `arrow_columns` has lost its purpose"
