"""A campaign's folder holds its flights unaltered: bits that flipped, rows that were edited, files that were added
are found.
"""

from __future__ import annotations

import random
import shutil

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from flownav.campaigns.chain import BEFORE, DIGEST, DamagedError, digests_of, read_part, root_of
from flownav.campaigns.plan import planned
from flownav.campaigns.run import run_campaign
from flownav.campaigns.store import PART, Dataset, Store
from flownav.core.errors import InputError
from flownav.simulation.scenario import load_scenario
from requirements import StandIn

SCORE = "touchdown.contact.distance_m"


def plan_of(flights=2 * PART, seed=5):
    changes = {"filter.name": "paper", "flight.duration_s": 6.0}
    return planned(
        [load_scenario("landing")], {}, truth_models=["ensemble"], seed=seed, flights=flights, changes=changes
    )


def off(cell, seed, first, flights):
    """How far off flights touch: a number of each."""
    return np.random.default_rng([seed, first]).random(flights)


def flown(folder, plan):
    """The campaign flown into a folder; its data, the engine, and the reported damage."""
    engine, told = StandIn(off), []
    with Store(folder).opened(plan) as store:
        data = run_campaign(plan, engine, store, lambda progress: told.append(progress.damaged))
    return data, engine, told[-1]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A folder of two parts."""
    folder = tmp_path_factory.mktemp("whole") / "c"
    flown(folder, plan_of())
    return folder


@pytest.fixture
def folder(whole, tmp_path):
    return shutil.copytree(whole, tmp_path / "c")


def bytes_in(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.rglob("part-*"))}


def rewritten(path, change, *, chained):
    """A part written anew with its table changed; chained: with digests that fit."""
    table = pq.read_table(path)
    own = change(table.drop_columns([DIGEST]))
    digests = table.column(DIGEST).to_pylist()
    if chained:
        digests = digests_of(own, bytes.fromhex(table.schema.metadata[BEFORE].decode()))
    own = own.append_column(DIGEST, pa.array(digests, pa.binary(32)))
    pq.write_table(own.replace_schema_metadata(table.schema.metadata), path, write_page_checksum=True)


def with_score(value, rows=slice(None)):
    def change(table):
        scores = table.column(SCORE).to_numpy().copy()
        scores[rows] = value
        return table.set_column(table.column_names.index(SCORE), SCORE, pa.array(scores))

    return change


# -- bits ----------------------------------------------------------------------------------------------------------
def test_no_flipped_bit_is_read_as_another_number(folder):
    """300 single bits anywhere in a part: the same table is read, or none."""
    path = Dataset(folder).parts(0)[0]
    good, intact, rng = path.read_bytes(), read_part(path), random.Random(1)
    refused = 0
    for _ in range(300):
        place = rng.randrange(8 * len(good))
        bad = bytearray(good)
        bad[place // 8] ^= 1 << place % 8
        path.write_bytes(bad)
        try:
            found = read_part(path)
        except DamagedError:
            refused += 1
            continue
        assert found.table.equals(intact.table)
        assert found[1:] == intact[1:]
    assert refused > 250


def test_a_part_with_a_flipped_bit_is_named_and_flown_again(folder):
    before, path = bytes_in(folder), Dataset(folder).parts(0)[1]
    bad = bytearray(path.read_bytes())
    bad[len(bad) // 3] ^= 1
    path.write_bytes(bad)
    _, engine, told = flown(folder, plan_of())
    assert engine.flown == PART
    assert len(told) == 1
    assert f"{path}: is damaged (" in told[0]
    assert bytes_in(folder) == before


def test_who_only_reads_a_damaged_part_is_told(folder):
    path = Dataset(folder).parts(0)[0]
    bad = bytearray(path.read_bytes())
    bad[len(bad) // 3] ^= 1
    path.write_bytes(bad)
    with pytest.raises(InputError, match=r"part-00000.parquet: is damaged \(.*flies it again"):
        Dataset(folder).table(0)


def test_who_only_reads_a_part_whose_columns_name_changed_by_a_bit_is_told(folder):
    """Pages have checksums, the footer has none: every reading holds the digests, of one column as of all."""
    path = Dataset(folder).parts(0)[0]
    path.write_bytes(path.read_bytes().replace(b"x.rms_error", b"x.rmc_error"))
    for read in (Dataset(folder).rows, Dataset(folder).table, lambda cell: Dataset(folder).column(cell, "flight")):
        with pytest.raises(InputError, match=r"part-00000.parquet: is damaged \(row 1 is not what its digest says\)"):
            read(0)


def test_who_only_reads_edited_scores_is_told(folder):
    path = Dataset(folder).parts(0)[0]
    rewritten(path, with_score(0.0, slice(17, 18)), chained=False)
    with pytest.raises(InputError, match=r"is damaged \(row 18 is not what its digest says\)"):
        Dataset(folder).column(0, SCORE)


# -- edits ---------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("rows", "named"), [(slice(None), "row 1 "), (slice(17, 18), "row 18 ")])
def test_overwritten_scores_are_named_and_flown_again(folder, rows, named):
    before, path = bytes_in(folder), Dataset(folder).parts(0)[0]
    rewritten(path, with_score(0.0, rows), chained=False)
    data, engine, told = flown(folder, plan_of())
    assert named in told[0]
    assert engine.flown == PART
    assert bytes_in(folder) == before
    assert data.column(0, SCORE).min() > 0.0


@pytest.mark.parametrize("name", ["flight", "verdict", "input.vehicle.body.mass_kg", SCORE])
def test_every_kind_of_column_counts(folder, name):
    path = Dataset(folder).parts(0)[0]

    def change(table):
        column = table.column(name)
        values = ["crashed"] * PART if name == "verdict" else np.asarray(column.to_numpy()) + 1
        return table.set_column(table.column_names.index(name), name, pa.array(values))

    rewritten(path, change, chained=False)
    with pytest.raises(DamagedError, match="row 1 is not what its digest says"):
        read_part(path)


def test_columns_that_change_their_names_rows_that_change_places_or_go_are_noticed(folder):
    path = Dataset(folder).parts(0)[0]
    good = path.read_bytes()
    for change in (
        lambda table: table.rename_columns([{SCORE: "x", "x": SCORE}.get(name, name) for name in table.column_names]),
        lambda table: table.take([1, 0, *range(2, PART)]),
        lambda table: table.drop_columns([SCORE]),
        lambda table: table.set_column(2, "verdict", pa.array([None] * PART, pa.string())),
        lambda table: table.set_column(1, "flight", pa.array([[1]] * PART)),
        lambda table: table.set_column(1, "flight", pa.array([None] * PART, pa.int64())),
    ):
        path.write_bytes(good)
        rewritten(path, change, chained=False)
        with pytest.raises(DamagedError):
            read_part(path)
    path.write_bytes(good)
    table = pq.read_table(path)
    pq.write_table(table.drop_columns([DIGEST]), path)
    with pytest.raises(DamagedError, match="its rows have no digests"):
        read_part(path)
    pq.write_table(table.replace_schema_metadata({BEFORE: b"xyz"}), path)
    with pytest.raises(DamagedError, match="no digest"):
        read_part(path)


def test_an_edit_with_digests_that_fit_breaks_the_chain_of_what_follows(folder):
    """Only an author who makes all later digests anew, too, is not found by them; flights flown again reveal him."""
    first, second = Dataset(folder).parts(0)
    rewritten(first, with_score(0.0), chained=True)
    _, engine, told = flown(folder, plan_of())
    assert engine.flown == PART
    assert f"{second}: is damaged (it does not follow the part before it)" in told[0]


def test_a_part_of_another_campaign_is_flown_again(folder, tmp_path):
    before = bytes_in(folder)
    flown(tmp_path / "other", plan_of(seed=6))
    for here, there in zip(Dataset(folder).parts(0), Dataset(tmp_path / "other").parts(0), strict=True):
        shutil.copy(there, here)
    _, engine, _ = flown(folder, plan_of())
    assert engine.flown == 2 * PART
    assert bytes_in(folder) == before


def test_flights_that_the_plan_has_not_are_refused(folder):
    first, second = Dataset(folder).parts(0)
    strange = second.with_name("part-00002.parquet")
    shutil.copy(first, strange)
    with pytest.raises(InputError, match=r"part-00002.parquet: holds flights that this campaign has not; move it away"):
        flown(folder, plan_of())
    strange.unlink()
    shutil.copy(first, second)
    _, engine, told = flown(folder, plan_of())
    assert engine.flown == PART
    assert "does not follow" in told[0]


def test_a_part_with_more_flights_than_it_was_to_have_is_flown_again(tmp_path):
    flown(tmp_path / "a", plan_of(PART))
    flown(tmp_path / "b", plan_of(100))
    (there,), (here,) = Dataset(tmp_path / "a").parts(0), Dataset(tmp_path / "b").parts(0)
    shutil.copy(there, here)
    _, engine, told = flown(tmp_path / "b", plan_of(100))
    assert engine.flown == 100
    assert "it has 256 flights, not 100" in told[0]


def test_the_chain_begins_with_the_plan_and_does_not_know_how_many_flights_follow():
    plan = plan_of().as_json
    assert root_of(plan, 0) == root_of(plan | {"flights": 7}, 0)
    assert len({root_of(plan, 0), root_of(plan, 1), root_of(plan | {"seed": 6}, 0)}) == 3


def test_a_huge_file_and_one_that_says_so_are_not_read(folder):
    path = Dataset(folder).parts(0)[0]
    with path.open("r+b") as file:
        file.truncate(1 << 32)  # sparse: 4 GB of nothing
    with pytest.raises(DamagedError, match="it is too large"):
        read_part(path)
    pq.write_table(pa.table({"x": np.zeros(1 << 24)}), path, use_dictionary=False)
    with pytest.raises(DamagedError, match="its columns are too large"):
        read_part(path)
    words = pa.DictionaryArray.from_arrays(np.zeros(100, np.int32), ["x" * 10_000_000])
    pq.write_table(pa.table({"x": words}), path)
    with pytest.raises(DamagedError, match="no digests"):
        read_part(path)
