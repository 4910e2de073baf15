"""A certificate's folder forged by somebody who makes every digest, hash and page fit: found without any sample."""

from __future__ import annotations

import json
import os
import shutil
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pytest

from certificates import STRICT, forge_all, found, rehashed, rewritten, run, with_column, wrong
from flownav.campaigns.certification.cells import plan_of
from flownav.campaigns.certification.remade import require_drawn
from flownav.campaigns.engines import Local, Part
from flownav.campaigns.plan import planned
from flownav.campaigns.requirement import load_requirement
from flownav.campaigns.run import run_campaign
from flownav.campaigns.store import PART, Store, table_of
from flownav.core.errors import InputError, VerdictError
from flownav.simulation.scenario import load_scenario
from requirements import HEAD, WINDY, StandIn, write

WIND = "input.wind.speed_20ft_m_s"


@pytest.fixture(scope="module")
def made_of_cells(tmp_path_factory):
    """A folder with a certificate of three cells."""
    place = tmp_path_factory.mktemp("cells")
    path = write(place, HEAD + WINDY + "height_m = [5, 8]\n" + STRICT)
    assert isinstance(run(path, "--out", place / "out", "--ranking", 0, "--records", 0).exception, VerdictError)
    return place


@pytest.fixture
def cells(made_of_cells, tmp_path):
    return shutil.copytree(made_of_cells / "out", tmp_path / "cells")


def plan_in(folder):
    facts = json.loads((folder / "certificate.json").read_text(encoding="utf-8"))
    return plan_of(load_requirement(next(iter(facts["files"]["in"]))))


def flight(plan, cell, number):
    """A flight of a number that the plan has not, as it is flown: its row."""
    ready = plan.ready(cell)
    ((_, rows),) = Local().fly(ready, plan.seed, [Part(0, number, 1)])
    return table_of(cell, plan.cells[cell].values, number, rows, ready.ensemble.values(plan.seed, number, 1))


def with_one_more(table, row):
    return pa.concat_tables([table, row.cast(table.schema)])


# -- rows ----------------------------------------------------------------------------------------------------------
def another_flight(folder):
    plan = plan_in(folder)
    rewritten(folder, lambda rows: with_one_more(rows.slice(0, plan.flights - 1), flight(plan, 0, plan.flights)))


def another_wind(folder):
    rewritten(folder, lambda rows: with_column(rows, WIND, np.r_[7.9, rows.column(WIND).to_numpy()[1:]]))


def another_cause(folder):
    rewritten(folder, lambda rows: with_column(rows, "limited_by", ["gps", *rows.column("limited_by").to_pylist()[1:]]))


def copies_of_one(folder):
    rewritten(folder, lambda rows: rows.take(np.zeros(rows.num_rows, int)))


@pytest.mark.parametrize(("forgery", "said"), [
    (another_flight, "row 52 is not what is drawn: flight"), (another_wind, f"row 1 is not what is drawn: {WIND}"),
    (another_cause, "row 1 is not what is drawn: limited_by is gps in the folder"),
    (copies_of_one, "row 2 is not what is drawn: flight"),
])  # fmt: skip
def test_a_row_that_is_not_the_plans_is_found_without_a_sample(made, folder, forgery, said):
    """Each was found only where the sample of 8 of 52 met it."""
    forgery(folder)
    forge_all(folder)
    told = wrong(folder, sample=1)
    assert set(told) == {"flights and inputs"}
    assert said in told["flights and inputs"]
    again = run(made / "small.toml", "--out", folder, "--ranking", 0, "--records", 0, "--again", 1)
    assert isinstance(again.exception, InputError)
    assert said in str(again.exception)


def test_flights_that_were_deleted_are_missed(folder):
    rewritten(folder, lambda rows: rows.slice(0, 40))
    rehashed(folder)
    assert "cell 0 has 40 flights, not 52" in wrong(folder)["flights and inputs"]


def test_a_cell_does_not_lend_a_flight_to_another(cells):
    """The last flight of the first cell is gone, and the second has one more than was planned: as many as before."""
    plan = plan_in(cells)
    rewritten(cells, lambda rows: rows.slice(0, plan.flights - 1))
    more = flight(plan, 1, plan.cells[2].first)
    rewritten(cells, lambda rows: with_one_more(rows, more), 1)
    forge_all(cells)
    told = wrong(cells, sample=1)
    assert set(told) == {"flights and inputs"}
    assert f"cell 0 has {plan.flights - 1} flights, not {plan.flights}" in told["flights and inputs"]


def test_cells_that_are_as_they_were_written_hold(cells):
    assert not wrong(cells)


def test_rows_of_every_part_are_held(tmp_path):
    changes = {"filter.name": "paper", "flight.duration_s": 6.0}
    plan = planned([load_scenario("landing")], {}, truth_models=["ensemble"], seed=5, flights=PART + 3, changes=changes)
    engine = StandIn(lambda cell, seed, first, flights: np.full(flights, 0.1))
    with Store(tmp_path / "c").opened(plan) as store:
        data = run_campaign(plan, engine, store)
    require_drawn(plan, data)
    with pytest.raises(InputError, match=r"part-00000.parquet: row 1 is not what is drawn: input"):
        require_drawn(replace(plan, seed=6), data)
    data.parts(0)[1].unlink()
    with pytest.raises(InputError, match="cell 0 has 256 flights, not 259; move the folder away"):
        require_drawn(plan, data)


# -- facts ---------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("change", "what", "said"), [
    (lambda facts: facts.update(note="approved"), "certificate.json", "note is not as certify writes it"),
    (lambda facts: facts.update(schema=99), "certificate.json", "schema is not as certify writes it"),
    (lambda facts: facts.update(flights=52.0), "certificate.json", "flights is not as certify writes it"),
    (lambda facts: facts["flown_again"].update(sample=10**6), "certificate.json", "flown_again is not as"),
    (lambda facts: facts["flown_again"].update(margin=52), "certificate.json", "flown_again is not as"),
    (lambda facts: facts["made_by"].update(approved_by="me"), "certificate.json", "made_by is not as"),
    (lambda facts: facts["worst"][0].update(note="a gust"), "certificate.json", "worst is not as"),
    (lambda facts: facts["worst"][0].update(report="https://example.org"), "certificate.json", "worst is not as"),
    (lambda facts: facts["files"]["in"].popitem(), "files that the flights are made from", "has no hash"),
    (lambda facts: facts["files"]["in"].update({"/etc/hosts": "0"}), "files that the flights are made from",
     "hosts: the flights are not made from it"),
])  # fmt: skip
def test_a_fact_that_certify_does_not_write_is_named(folder, change, what, said):
    """On the page, too, each of these held."""
    forge_all(folder, change)
    told = wrong(folder)
    assert set(told) == {what}
    assert said in told[what]


def test_a_key_that_stands_twice_is_no_certificate(folder):
    """Who reads it from the top reads "pass", who reads the last of the two reads "fail"."""
    path = folder / "certificate.json"
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("{\n", '{\n "verdict": "pass",\n', 1), encoding="utf-8")
    assert wrong(folder) == {"certificate.json": "it is not written as certify writes it"}


def test_a_fact_does_not_command_the_terminal(folder):
    """It cleared the screen and wrote that all holds."""
    facts = json.loads((folder / "certificate.json").read_text(encoding="utf-8"))
    facts["verdict"] = facts["requirement"]["name"] = "pass\x1b[2J\x1b[1;1HHOLDS  small, certified as: pass"
    facts["files"]["out"]["\x1b[2Jx"] = "0"
    (folder / "certificate.json").write_text(json.dumps(facts), encoding="utf-8")
    done = run("--verify", folder)
    assert isinstance(done.exception, VerdictError)
    assert "\x1b" not in done.stdout
    assert done.stdout.startswith("DOES NOT HOLD  pass\\x1b[2J")


def test_what_no_folder_can_show_is_said(folder):
    """Command, time, libraries and the size of the first sample are as stated; they are named as not checked."""
    forge_all(folder, lambda facts: facts["made_by"].update(command="flownav certify approach", numpy="9.9"))
    (folder / "approved.txt").write_text("yes", encoding="utf-8")
    told = found(folder)
    assert not wrong(folder)
    assert told["command, time, libraries, and how many flights were drawn when it was written"][0] == "not checked"
    assert told["files without a hash"] == ("not checked", "approved.txt: no part of the certificate")
    assert told["scores of the other flights"][0] == "not checked"
    assert "scores of the other flights" not in found(folder, sample=52)


# -- files ---------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("kind", "said"), [
    ("device", "records/x: is a link to elsewhere"), ("link", "records/x: is a link to elsewhere"),
    ("fifo", "records/x: a FIFO (a named pipe) is not read"),
])  # fmt: skip
def test_what_would_be_read_for_ever_or_lies_elsewhere_is_named(folder, tmp_path, kind, said):
    path = folder / "records" / "x"
    if kind == "fifo":
        os.mkfifo(path)
    else:
        path.symlink_to("/dev/zero" if kind == "device" else tmp_path / "x")
    (tmp_path / "x").write_text("", encoding="utf-8")
    facts = json.loads((folder / "certificate.json").read_text(encoding="utf-8"))
    facts["files"]["out"]["records/x"] = "0"
    (folder / "certificate.json").write_text(json.dumps(facts), encoding="utf-8")
    assert said in wrong(folder)["files"]


@pytest.mark.parametrize(("change", "said"), [
    (lambda rows: rows.slice(0, 51), "cell 0 has 51 flights, not 52"),
    (lambda rows: pa.concat_tables([rows, rows]), "cell 0 has 104 flights, not 52"),
    (lambda rows: pa.concat_tables([rows.slice(0, 51), rows.slice(0, 1)]), "row 52 of cell 0 is flight 0, not 51"),
])  # fmt: skip
def test_flights_of_another_version_are_counted(folder, change, said):
    """Fewer or more of them were an error of Arrow or NumPy in certificate.json; one that came twice was not seen."""
    rewritten(folder, change)
    rehashed(folder, lambda facts: facts["made_by"].update(code_sha256="0" * 64))
    told = wrong(folder)
    assert set(told) == {"flights"}
    assert said in told["flights"]


def test_without_a_part_flights_of_another_version_are_missed(folder):
    (folder / "flights" / "cell-000" / "part-00000.parquet").unlink()
    rehashed(folder, lambda facts: facts["made_by"].update(code_sha256="0" * 64))
    told = wrong(folder)
    assert set(told) == {"files", "flights"}
    assert "cell 0 has 0 flights, not 52" in told["flights"]
