"""Flights of a certificate flown again: forged ones are found, those that decide always."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from certificates import forged, run, wrong
from flownav.campaigns.certification.again import deciding, drawn, fly_again
from flownav.campaigns.certification.cells import plan_of
from flownav.campaigns.certification.envelope import judged
from flownav.campaigns.engines import Local, Part
from flownav.campaigns.measures import ROW_COLUMNS
from flownav.campaigns.plan import Plan
from flownav.campaigns.requirement import RequirementTable, load_requirement
from flownav.campaigns.store import Dataset
from flownav.core.errors import InputError, VerdictError
from requirements import HEAD, rows_touching, write


# -- certified again ---------------------------------------------------------------------------------------------
def test_overwritten_scores_do_not_turn_a_fail_into_a_pass(made, folder):
    forged(folder, chained=False)
    done = run(made / "small.toml", "--out", folder, "--ranking", 0, "--records", 0)
    assert isinstance(done.exception, VerdictError)
    assert (
        "part-00000.parquet: is damaged (row 1 is not what its digest says); its flights are flown again" in done.stderr
    )
    assert not wrong(folder)


def test_nor_do_those_with_digests_that_fit(made, folder):
    before = (folder / "certificate.json").read_bytes()
    forged(folder)
    done = run(made / "small.toml", "--out", folder, "--ranking", 0, "--records", 0)
    assert isinstance(done.exception, InputError)
    said = str(done.exception)
    assert re.search(r"out: flight 0 of cell 0 is not what is flown: .* landed in the folder and crashed", said)
    assert said.endswith("flown again; move the folder away, and fly it anew")
    assert (folder / "certificate.json").read_bytes() == before


def test_every_flight_of_a_small_folder_is_flown_again(made, folder):
    """One altered flight of 52 is found whichever it is, as 64 are drawn."""
    forged(folder, rows=slice(31, 32))
    done = run(made / "small.toml", "--out", folder, "--ranking", 0, "--records", 0)
    assert isinstance(done.exception, InputError)


def test_a_drawn_sample_is_another_each_time_and_never_more_than_there_is():
    samples = {tuple(drawn(1000, 8)) for _ in range(8)}
    assert len(samples) > 6
    assert drawn(5, 64).tolist() == [0, 1, 2, 3, 4]
    assert all(len(set(sample)) == 8 and sorted(sample) == list(sample) for sample in samples)


# -- the margin --------------------------------------------------------------------------------------------------
class Asked:
    def __init__(self, *tables):
        self.requirement = tables


TABLE = RequirementTable(measure="touchdown.horizontal_m", at_most=0.5, probability=0.95, confidence=0.9)


def places(table, distance, crashed=None):
    rows = rows_touching(np.asarray(distance, float), crashed)
    return deciding(Asked(table), [judged(table, rows)], rows).tolist()


def test_of_a_pass_the_worst_flights_decide_and_of_a_fail_the_least_bad_failures():
    passed = np.linspace(0.0, 0.4, 105)
    assert places(TABLE, passed) == [102, 103, 104]  # two failures are allowed: the third worst decides
    failed = np.r_[np.zeros(95), np.linspace(0.6, 1.5, 10)]
    assert places(TABLE, failed) == [95, 96, 97]
    lower = TABLE.model_copy(update={"at_most": None, "at_least": 0.5})
    assert places(lower, 1.0 - passed) == [102, 103, 104]


def test_as_long_as_those_stand_the_verdict_stands():
    rng = np.random.default_rng(3)
    for _ in range(50):
        distance = rng.gamma(2.0, 0.11, 105)
        own = places(TABLE, distance)
        verdict = judged(TABLE, rows_touching(distance)).verdict == "pass"
        best, worst = np.full(105, 0.0), np.full(105, np.inf)
        best[own], worst[own] = distance[own], distance[own]
        if verdict:
            assert (np.delete(distance, own) <= distance[own].min()).all()
        else:
            assert judged(TABLE, rows_touching(best)).verdict != "pass"


def test_too_few_flights_have_no_margin_and_many_only_their_nearest():
    assert places(TABLE, np.zeros(10)) == []
    many = np.linspace(0.0, 0.499, 4000)
    assert places(TABLE, many) == list(range(4000 - 64, 4000))
    both = deciding(Asked(TABLE, TABLE), [judged(TABLE, rows_touching(many))] * 2, rows_touching(many))
    assert len(both) == 64
    no_crash = RequirementTable(measure="crash", at_most=0, probability=0.95)
    assert places(no_crash, np.zeros(105), np.arange(105) < 2) == [0, 1, 2]


def test_cells_with_faults_are_flown_again_as_they_were(tmp_path):
    text = HEAD.replace('name = "paper"', 'name = "landing"').replace(
        "[set.filter]", "[set.flight]\nduration_s = 9.0\n[set.filter]"
    )
    faulty = (
        text
        + '[conditions]\nfault = ["none", "gps_loss"]\nfault_begins_s = 3\n'
        + '[[requirement]]\nmeasure = "estimate.axis_m"\nat_most = 9\nprobability = 0.5\n'
    )
    plan: Plan = plan_of(load_requirement(write(tmp_path, faulty)), 40)
    ready = plan.ready(1)
    ((_, rows),) = Local().fly(ready, plan.seed, [Part(0, 20, 20)])
    again = list(Local().fly(ready, plan.seed, [Part(k, number, 1) for k, number in enumerate((37, 22, 30))]))
    assert np.concatenate([one for _, one in again]).tobytes() == rows[[17, 2, 10]].tobytes()
    assert rows[:, ROW_COLUMNS.index("max_position_error_m")].all()


def test_an_engine_that_flies_otherwise_is_told_of(folder):
    """Each number of a row counts, not only the scores that the verdict comes of."""
    facts = json.loads((folder / "certificate.json").read_text(encoding="utf-8"))
    plan = plan_of(load_requirement(next(iter(facts["files"]["in"]))))

    class Off(Local):
        def fly(self, *given):
            for part, rows in super().fly(*given):
                rows[:, 0] += 1e-12
                yield part, rows

    with pytest.raises(InputError, match="flight 3 of cell 0 is not what is flown"):
        fly_again(plan, Dataset(folder), 0, [3], Off())
    fly_again(plan, Dataset(folder), 0, [3], Local())
