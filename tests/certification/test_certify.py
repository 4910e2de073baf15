"""Certificates of flights with known truths, and of real ones: verdicts, envelope, files, hashes, resuming."""

from __future__ import annotations

import hashlib
import json

import numpy as np
import pytest

from flownav.campaigns.certification.cells import plan_of
from flownav.campaigns.certification.certify import certify, with_ranking
from flownav.campaigns.certification.envelope import judged
from flownav.campaigns.certification.written import write_certificate
from flownav.campaigns.engines import Local
from flownav.campaigns.requirement import RequirementTable, load_requirement
from flownav.campaigns.store import Store
from requirements import ASKED, HEAD, WINDY, StandIn, rows_touching, write

TABLE = RequirementTable(measure="touchdown.horizontal_m", at_most=0.5, probability=0.95, confidence=0.9)


# -- one requirement ---------------------------------------------------------------------------------------
@pytest.mark.parametrize("truth", [0.93, 0.95, 0.97])
def test_verdicts_on_flights_of_known_probability_are_right_in_nine_of_ten(truth):
    rng, wrong = np.random.default_rng(int(100 * truth)), 0
    for _ in range(200):
        rows = rows_touching(np.where(rng.random(181) < truth, 0.1, 0.9))
        wrong += judged(TABLE, rows).verdict == ("fail" if truth >= 0.95 else "pass")
    assert wrong <= 20


def test_a_judgement_says_what_the_flights_show():
    distance = np.r_[np.linspace(0.0, 0.4, 103), 0.7, 0.8]
    found = judged(TABLE, rows_touching(distance))
    assert (found.verdict, found.failures, found.most, found.needs) == ("pass", 2, 2, (45, 77, 105))
    assert found.bound == pytest.approx(0.4)
    assert found.share.low >= 0.95 > judged(TABLE, rows_touching(np.r_[distance, 0.6])).share.low
    assert found.risk <= 0.1
    assert found.more() == ""
    few = judged(TABLE, rows_touching(distance[:20]))
    assert (few.verdict, few.most, few.risk, few.bound) == ("not shown", -1, 0.0, np.inf)
    assert few.as_json()["tolerance_bound"] is None
    assert few.more().endswith("A plan that allows 0 failures needs 45 flights.")
    middling = judged(TABLE, rows_touching(np.r_[np.zeros(97), np.ones(3)]))
    assert middling.verdict == "not shown"
    assert "A plan that allows 3 failures needs 132 flights" in middling.more()
    bad = judged(TABLE, rows_touching(np.r_[np.zeros(50), np.ones(50)]))
    assert (bad.verdict, bad.more()) == ("fail", "No number of flights shows it: its opposite is shown.")
    worse_than_asked = judged(TABLE, rows_touching(np.r_[np.zeros(94), np.ones(6)]))
    assert "no plan is likely to pass" in worse_than_asked.more()


def test_a_crash_meets_no_limit_whichever_side_it_is_on():
    crashed = np.arange(100) < 10
    rows = rows_touching(np.full(100, 0.2), crashed)
    assert judged(TABLE, rows).failures == 10
    lower = TABLE.model_copy(update={"at_most": None, "at_least": 0.1})
    found = judged(lower, rows)
    assert found.failures == 10
    assert found.as_json()["at_least"] == 0.1
    assert judged(lower, rows_touching(np.full(100, 0.2))).bound == pytest.approx(0.2)
    none = judged(RequirementTable(measure="crash", at_most=0, probability=0.95), rows)
    assert (none.failures, none.verdict, none.bound) == (10, "fail", None)


# -- certificates ------------------------------------------------------------------------------------------
def certified(tmp_path, text, engine, flights=None, rows=0, folder="out"):
    path = write(tmp_path, text)
    asked = load_requirement(path)
    plan = plan_of(asked, flights)
    with Store(tmp_path / folder).opened(plan) as store:
        certificate = certify(asked, plan, engine, store)
        if rows:
            certificate = with_ranking(certificate, engine, store.folder, rows)
        return certificate, write_certificate(certificate, store, path, 2 if isinstance(engine, Local) else 0)


def in_strong_wind(cell, seed, first, flights):
    """Touches 1 m off where the wind is above 6 m/s, else in the middle."""
    speed = np.array(cell.ensemble.values(seed, first, flights)["wind.speed_20ft_m_s"])
    return np.where(speed > 6.0, 1.0, 0.01 * speed)


@pytest.fixture(scope="module")
def windy(tmp_path_factory):
    return certified(tmp_path_factory.mktemp("windy"), HEAD + WINDY + ASKED, StandIn(in_strong_wind), 1200, 64)


def test_the_envelope_finds_the_conditions_that_pass(windy):
    certificate, facts = windy
    assert facts["verdict"] == "fail"
    fields = facts["envelope"]["bins"]
    assert facts["envelope"]["axes"] == ["wind.speed_20ft_m_s", "wind.from_direction_deg"]
    assert sum(field["flights"] for field in fields) == facts["flights"] == 1200
    assert sum(field["failures"] for field in fields) == facts["failures"]
    for field in fields:
        low, high = field["wind.speed_20ft_m_s"]
        if high <= 6.0:
            assert field["failures"] == 0
            assert field["verdict"] == ("pass" if field["flights"] >= 22 else "not shown")
        elif low >= 6.0:
            assert (field["failures"], field["verdict"]) == (field["flights"], "fail")
        assert field["low"] <= field["share"] <= field["high"]
    assert len(fields) == 40
    assert sum(field["verdict"] == "pass" for field in fields) > 20
    (cell,) = facts["envelope"]["cells"]
    assert (cell["cell"], cell["flights"], cell["verdict"]) == ("all flights", 1200, "fail")
    assert certificate.flown.inputs["wind.speed_20ft_m_s"].max() <= 8.0


def test_the_ranking_finds_the_input_that_decides(windy):
    _, facts = windy
    assert facts["ranking"][0]["input"] == "wind.speed_20ft_m_s"
    assert facts["ranking"][0]["total"] > 0.5
    assert facts["ranking_of"] == "values"
    assert all(row["total"] == 0.0 for row in facts["ranking"][1:])
    split = {row["known"]: row["total"] for row in facts["split"]}
    assert split["build"] == split["never"] == 0.0
    assert split["day"] == facts["ranking"][0]["total"]
    assert facts["ranking_measure"] == "touchdown.horizontal_m"


def test_the_worst_flights_come_first(windy):
    _, facts = windy
    assert len(facts["worst"]) == 10
    assert all(told["failed"] and told["figures"]["touchdown.horizontal_m"] == 1.0 for told in facts["worst"])
    assert all(told["inputs"]["wind.speed_20ft_m_s"] > 6.0 for told in facts["worst"])


def test_a_verdict_is_of_all_requirements_and_a_flight_fails_if_it_fails_one(tmp_path):
    text = HEAD + WINDY + ASKED + '[[requirement]]\nmeasure = "crash"\nat_most = 0\nprobability = 0.9\n'
    _, facts = certified(tmp_path, text, StandIn(in_strong_wind))
    first, second = facts["requirement"]["requirements"]
    assert (first["verdict"], second["verdict"], facts["verdict"]) == ("fail", "pass", "fail")
    assert facts["failures"] == first["failures"] > second["failures"] == 0
    assert facts["risk"] == max(first["risk"], second["risk"])
    page = (tmp_path / "out" / "certificate.html").read_text(encoding="utf-8")
    assert "Each requirement is judged by itself at its own confidence, and all must pass." in page


def test_cells_are_judged_by_themselves_and_inputs_ranked_in_the_worst(tmp_path):
    def higher_is_worse(cell, seed, first, flights):
        return np.full(flights, 1.0 if cell.setup.scenario.flight.path[0].height_m > 3.5 else 0.0) + in_strong_wind(
            cell, seed, first, flights
        )

    engine = StandIn(higher_is_worse)
    _, facts = certified(tmp_path, HEAD + WINDY + "height_m = [2, 4]\n" + ASKED, engine, 300, 16)
    cells = facts["envelope"]["cells"]
    assert [cell["cell"] for cell in cells] == ["from 2 m", "from 3 m", "from 4 m"]
    assert [cell["flights"] for cell in cells] == [100, 100, 100]
    assert (cells[2]["failures"], cells[2]["verdict"]) == (100, "fail")
    assert facts["ranking_cell"] == "from 4 m"
    assert {told["cell"] for told in facts["worst"]} == {"from 4 m"}
    assert all(200 <= told["flight"] < 300 for told in facts["worst"])


def test_flights_that_are_all_alike_leave_nothing_to_rank(tmp_path):
    _, facts = certified(tmp_path, HEAD + WINDY + ASKED, StandIn(lambda cell, seed, first, n: np.zeros(n)), rows=16)
    assert (facts["verdict"], facts["ranking_of"]) == ("pass", "nothing")
    page = (tmp_path / "out" / "certificate.html").read_text(encoding="utf-8")
    assert "have the same outcome: there is nothing to rank." in page


def test_what_the_folder_holds_is_not_flown_again(tmp_path):
    engine = StandIn(in_strong_wind)
    _, facts = certified(tmp_path, HEAD + WINDY + ASKED, engine, 60, 16)
    assert engine.flown == 60 + facts["ranking_flights"]
    again = StandIn(in_strong_wind)
    _, same = certified(tmp_path, HEAD + WINDY + ASKED, again, 60, 16)
    assert again.flown == 0
    assert same["ranking"] == facts["ranking"]
    assert same["files"]["out"] == facts["files"]["out"]
    part = next((tmp_path / "out" / "ranking").glob("*/sample-003.parquet"))
    part.write_bytes(b"half")
    certified(tmp_path, HEAD + WINDY + ASKED, again, 60, 16)
    assert again.flown == 16


# -- real flights ------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def landing(tmp_path_factory):
    folder = tmp_path_factory.mktemp("landing")
    return folder, *certified(folder, HEAD + WINDY + ASKED, Local(), 128, 16)


def test_a_certificate_has_what_the_issue_asks(landing):
    folder, _, facts = landing
    said = json.loads((folder / "out" / "certificate.json").read_text(encoding="utf-8"))
    assert set(said) >= {"verdict", "requirement", "flights", "failures", "risk", "envelope", "ranking", "worst"}
    assert said["verdict"] in ("pass", "fail", "not shown")
    assert set(said["ranking"][0]) == {"input", "first", "total", "first_interval", "total_interval"}
    assert said["flights"] == 128
    figures = [told["figures"]["touchdown.horizontal_m"] or np.inf for told in said["worst"]]
    assert figures == sorted(figures, reverse=True)
    assert facts["assumed"]["filter"] == "paper"
    dispersed = {row["input"]: row for row in said["assumed"]["variants"][0]["dispersed"]}
    assert dispersed["wind.speed_20ft_m_s"]["distribution"] == "uniform 0 to 8"
    assert "uncertainty" in dispersed["vehicle.body.mass_kg"]["source"]
    assert all(row["source"] and row["known"] in ("build", "day", "never") for row in dispersed.values())
    assert said["assumed"]["not_modelled"]


def test_its_hashes_are_those_of_its_files(landing):
    folder, _, facts = landing
    out = folder / "out"
    assert {name for name in facts["files"]["out"] if name.startswith("flights/")} == {
        "flights/cell-000/part-00000.parquet"
    }
    for name, digest in (facts["files"]["out"] | facts["files"]["page"]).items():
        assert hashlib.sha256((out / name).read_bytes()).hexdigest() == digest
    went_in = facts["files"]["in"]
    own = str(folder / "small.toml")
    assert went_in[own] == hashlib.sha256((folder / "small.toml").read_bytes()).hexdigest()
    assert {"flownav/data/landing.toml", "flownav/data/dispersion.toml", "flownav/data/maxi_joker_3.toml"} <= set(
        went_in
    )


def test_the_worst_flights_have_reports_to_open(landing):
    folder, _, facts = landing
    page = (folder / "out" / "certificate.html").read_text(encoding="utf-8")
    for told in facts["worst"][:2]:
        assert (folder / "out" / told["record"]).is_file()
        assert (folder / "out" / told["report"]).is_file()
        assert f'href="{told["report"]}"' in page
    assert "report" not in facts["worst"][2]
