"""`flownav paper`: the JSON and the page, published figures as printed, fits as near as promised, verdicts computed."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from browsing import Visit
from flownav.cli import paper as paper_command
from flownav.core.errors import InputError, VerdictError
from flownav.lab.rig.experiment import RigSettings, run_experiment
from flownav.paper import findings, laboratory, published
from flownav.paper.flights import Flights
from flownav.paper.laboratory import Configuration
from flownav.paper.page import panels
from flownav.paper.published import HEIGHTS_M, ErrorRow
from flownav.paper.reproduction import reproduce
from flownav.sensors.datasheet import Dynamics

FLIGHTS = 48
FIGURES = {"fit-height", "gain-delay", "orders-swing", "orders-chirp", "error-height", "figure-2-frames",
           "figure-2-flow", "figure-3-frames", "figure-3-flow", "figure-8", "figure-10", "figure-11", "figure-12",
           "figure-13", "figure-15", "figure-28", "figure-31"}  # fmt: skip
FIGURES |= {f"{name}-{what}" for name in ("takeoff", "landing")
            for what in ("position", "velocity", "zoom", "position-error", "velocity-error")}  # fmt: skip


class Outcome(NamedTuple):
    """The result of the command."""

    facts: dict[str, Any]
    page: Path
    output: str
    exception: BaseException | None


def run(*arguments: object, page: Path, as_json: bool = True) -> Outcome:
    app = typer.Typer()
    app.command()(paper_command.command)
    more = ["--json"] if as_json else []
    result = CliRunner().invoke(app, [*map(str, arguments), "--out", str(page), *more])
    if isinstance(result.exception, InputError) or not isinstance(result.exception, VerdictError | None):
        raise result.exception
    return Outcome(json.loads(result.stdout) if as_json else {}, page, result.stdout, result.exception)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    return run("--flights", FLIGHTS, page=tmp_path_factory.mktemp("paper") / "paper.html")


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """Quick runs, a given number at each height, beside one other configuration; with other instruments as quick."""
    instrumented = laboratory.otherwise_instrumented

    def quick(of: tuple[Configuration, ...], **other: int) -> tuple[Configuration, ...]:
        return tuple(replace(one, settings=replace(one.settings, duration_s=5.0, **other)) for one in of)

    def shortened(runs: int) -> None:
        fixed, other = (
            Configuration(name, "short", RigSettings(runs=k)) for name, k in (("fixed", runs), ("other", 1))
        )
        monkeypatch.setattr(laboratory, "configurations", lambda seed: quick((fixed, other), seed=seed))
        monkeypatch.setattr(laboratory, "otherwise_instrumented", lambda seed: quick(instrumented(seed)))

    return shortened


@pytest.fixture(scope="module")
def flown() -> Callable[[int], Flights]:
    """Sixteen flights of a table."""
    return cache(lambda table: reproduce((table,), 1, 16).flights[0])


# -- the whole reproduction -------------------------------------------------------------------------------------
def test_the_json_has_every_table_with_every_key(whole: Outcome) -> None:
    facts = whole.facts
    assert {"table1", "table2", "table3", "table5", "table6"} <= set(facts)
    places = [(height, model) for height in HEIGHTS_M for model in range(1, 8)]
    for table in ("table1", "table2"):
        assert [(row["height_m"], row["model"]) for row in facts[table]] == places
    assert [row["height_m"] for row in facts["table3"]] == list(HEIGHTS_M)
    assert all({"fit_published", "fit_reproduced", "gain", "delay_s"} <= set(row) for row in facts["table1"])
    errors = {f"{what}_error_{whose}" for what in ("mean", "std") for whose in ("published", "reproduced")}
    for row in facts["table2"] + facts["table3"]:
        assert errors <= set(row)
        assert all(np.isfinite(row[key]) for key in errors)
    for table in ("table5", "table6"):
        assert facts[table]["flights"] == FLIGHTS
        assert list(facts[table]["states"]) == list("xyzuvw")
        for entry in facts[table]["states"].values():
            assert errors <= set(entry)
            assert entry["std_error_reproduced"]["p05"] < entry["std_error_reproduced"]["p95"]
            assert 0.0 <= entry["std_error_percentile"] <= 100.0


def test_the_rigs_errors_of_gyro_and_sonar_are_flown_too(whole: Outcome) -> None:
    for table in ("table5", "table6"):
        as_is, leaking = whole.facts[table], whole.facts[table]["with_errors_of_the_rig"]
        assert leaking["rotation_leak"] == pytest.approx(0.128, abs=0.001)
        assert leaking["sonar_lag_s"] == pytest.approx(0.1)
        for state in "uv":
            ours, theirs = (rows[state]["std_error" + end]["median"] for rows, end in
                            ((as_is["states"], "_reproduced"), (leaking["states"], "")))  # fmt: skip
            assert theirs != ours
            assert 0.8 * ours < theirs < 3.0 * ours
    assert "of the rotation left in the velocity" in whole.page.read_text(encoding="utf-8").replace("\u00a0", " ")


def test_every_published_figure_is_the_papers(whole: Outcome, paper_folder: Path) -> None:
    def table(name: str) -> list[dict[str, str]]:
        with (paper_folder / name).open(encoding="utf-8") as file:
            return list(csv.DictReader(file))

    facts = whole.facts
    for row, printed in zip(facts["table1"], table("table1_identified_models.csv"), strict=True):
        assert (row["height_m"], row["model"]) == (float(printed["height_m"]), int(printed["model"]))
        a, b, c = (float(printed[key]) for key in "abc")
        assert row["fit_published"] == float(printed["fit_percent"])
        assert row["gain"] == pytest.approx(a / c, rel=1e-12)
        assert row["delay_s"] == pytest.approx(b / c, rel=1e-12)
    for name, number in (("table2_validation.csv", "table2"), ("table3_selected_model.csv", "table3")):
        for row, printed in zip(facts[number], table(name), strict=True):
            assert row["mean_error_published"] == float(printed["mean_error_m_s"])
            assert row["std_error_published"] == float(printed["std_error_m_s"])
    for name, number in (("table5_takeoff.csv", "table5"), ("table6_landing.csv", "table6")):
        *states, largest = table(name)
        for printed in states:
            entry = facts[number]["states"][printed["state"][0]]
            assert entry["mean_error_published"] == float(printed["mean_error"])
            assert entry["std_error_published"] == float(printed["std_error"])
        assert facts[number]["max_position_error_published_m"] == float(largest["mean_error"])


def test_one_configuration_fits_as_the_paper_at_every_height(whole: Outcome) -> None:
    assert whole.exception is None
    for height, target in zip(HEIGHTS_M, (87.0, 78.0, 72.0, 57.0), strict=True):
        fits = [row["fit_reproduced"] for row in whole.facts["table1"] if row["height_m"] == height]
        assert np.mean(fits) == pytest.approx(target, abs=6.0)
        assert len(set(fits)) == 7


def test_at_least_two_other_configurations_stand_beside_it(whole: Outcome) -> None:
    fixed, *others = whole.facts["configurations"]
    assert fixed["name"] == "fixed"
    assert len(others) >= 2
    assert all(set(other["fit_by_height"]) == {"0.6", "0.8", "1", "1.5"} for other in others)


def test_what_gyro_and_sonar_do_to_gain_and_delay_stands_beside_them(whole: Outcome) -> None:
    rows = {row["name"]: row["by_height"] for row in whole.facts["instruments"]}
    exact, late = rows["exact gyro scale"], rows["flow 20 ms older"]
    first = {f"{row['height_m']:g}": row for row in whole.facts["table1"] if row["model"] == 1}
    for height, length in (("0.6", 1.5), ("0.8", 1.3), ("1", 1.1)):
        leak = (1.0 - 0.872) * float(height) / length  # rotation that the gyro leaves, over the velocity
        assert first[height]["gain_reproduced"] - exact[height]["gain"] == pytest.approx(leak, abs=0.02)
    assert late["1.5"]["delay_s"] - first["1.5"]["delay_reproduced_s"] > 0.01
    for name in ("sonar at once", "sonar 150 ms late"):
        assert all(rows[name][h]["gain"] == pytest.approx(first[h]["gain_reproduced"], abs=0.01) for h in first)
    page = whole.page.read_text(encoding="utf-8")
    assert "what the gyro does not take off of the turning reads as velocity" in page
    assert "growing with height; the paper" in page


def test_orders_beyond_the_second_fit_no_worse(whole: Outcome) -> None:
    for test in whole.facts["orders"]:
        fits = test["fit_by_order"]
        assert set(fits) == {"0", "1", "2", "3", "4"}
        assert min(fits["3"], fits["4"]) > fits["2"] - 0.1
    said = {finding["topic"]: finding["agrees"] for finding in whole.facts["findings"]}
    assert not said["Order of the model (swing)"]
    assert not said["Order of the model (chirp)"]


def test_the_page_tells_every_inconsistency_and_every_landing(whole: Outcome) -> None:
    from markupsafe import escape

    page = whole.page.read_text(encoding="utf-8")
    rows = published.inconsistencies()
    assert [row.number for row in rows] == list(range(1, 29))
    for row in rows:
        assert row.where
        assert row.reading
        for text in (row.where, row.printed, row.reading):
            assert str(escape(text)) in page
    systems = published.landing_systems()
    assert [system.figure_cm for system in systems] == [47.0, 54.0, 30.0, 27.0]
    for system in systems:
        assert system.measures
        assert str(escape(system.measures)) in page
    for finding in whole.facts["findings"]:
        assert str(escape(finding["topic"])) in page
    assert 'http-equiv="Content-Security-Policy"' in page


@pytest.mark.browser
@pytest.mark.parametrize(("width", "scheme"), [(1360, "light"), (390, "dark")])
def test_the_page_draws_every_figure_without_a_complaint(whole: Outcome, browser: Any, width: int, scheme: str) -> None:
    visit = Visit(browser, whole.page, width, color_scheme=scheme)
    figures = visit.figures()
    assert set(figures) == FIGURES
    for figure in figures.values():
        assert figure["drawn"] == "figure", figure
        assert figure["traces"] > 0, figure
        assert figure["width"] > 200, figure
        assert figure["right"] <= width, figure
    marks = "[...document.querySelectorAll('[data-figure]')].every((p) => p.querySelector('.trace, .hm image'))"
    assert visit.page.evaluate(marks)
    assert visit.errors == []
    assert [request for request in visit.requests if not request.startswith(("file:", "data:", "blob:"))] == []
    assert visit.page.evaluate("document.documentElement.scrollWidth") <= width
    visit.context.close()


# -- one table, seeds, the terminal, exit status ------------------------------------------------------------------
def test_one_table_of_flights_alone(tmp_path: Path) -> None:
    made = run("--table", 5, "--flights", 16, page=tmp_path / "five.html")
    assert [key for key in made.facts if key.startswith("table")] == ["table5"]
    page = made.page.read_text(encoding="utf-8")
    assert "Table 5" in page
    assert 'id="table1"' not in page
    assert 'id="landing"' not in page


def test_one_table_of_the_rig_alone_and_the_same_for_its_seed(tmp_path: Path, short: Callable[[int], None]) -> None:
    short(2)  # of which the second is the selected model's
    first, again, other = (run("--table", 3, "--seed", seed, page=tmp_path / f"{k}.html")
                           for k, seed in enumerate((1, 1, 2)))  # fmt: skip
    assert [key for key in first.facts if key.startswith("table")] == ["table3"]
    assert first.facts["table3"] == again.facts["table3"]
    assert first.facts["table3"] != other.facts["table3"]
    assert 'id="table2"' not in first.page.read_text(encoding="utf-8")


def test_a_fit_too_far_from_the_paper_is_a_bad_verdict_and_the_page_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, short: Callable[[int], None]
) -> None:
    short(7)
    monkeypatch.setattr(findings, "FIT_TOLERANCE", 0.001)
    made = run("--table", 1, page=tmp_path / "bad.html", as_json=False)
    assert isinstance(made.exception, VerdictError)
    assert "Fit at 0.6 m" in str(made.exception)
    assert "\n" not in str(made.exception)
    assert "Table 1" in made.output
    assert "differs" in made.output
    assert str(made.page) in made.output
    assert made.page.is_file()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--table", 4), "--table 4: choose from 1, 2, 3, 5, 6"),
        (("--table", 0), "--table 0: choose from 1, 2, 3, 5, 6"),
        (("--flights", 0), "--flights 0: must be from 1"),
        (("--seed", -1), "--seed -1: must be from 0"),
    ],
)
def test_a_bad_option_is_one_line_and_writes_nothing(tmp_path: Path, arguments: tuple[object, ...], words: str) -> None:
    with pytest.raises(InputError, match=words) as refused:
        run(*arguments, page=tmp_path / "page.html")
    assert "\n" not in str(refused.value)
    assert not list(tmp_path.iterdir())


def test_a_page_that_cannot_be_written_is_refused_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    for page in (tmp_path, tmp_path / "file" / "page.html"):
        with pytest.raises(InputError, match="cannot be written"):
            run("--table", 5, "--flights", 1_000_000, page=page)


# -- what it computes ------------------------------------------------------------------------------------------------
def test_a_model_is_driven_as_its_transfer_function_says() -> None:
    log = run_experiment(RigSettings(duration_s=20.0))
    model = Dynamics(a_1_s2=196.9, b_1_s=14.8, c_1_s2=191.9)
    omega = 4.0
    swung = replace(log, reference_velocity_m_s=np.sin(omega * log.time_s))
    settled = log.time_s > 5.0
    s = 1j * omega
    response = 196.9 / (s**2 + 14.8 * s + 191.9)
    expected = np.imag(response * np.exp(s * log.time_s))
    np.testing.assert_allclose(laboratory.reading(model, swung)[settled], expected[settled], atol=5e-4)


def test_the_error_is_sensor_less_model() -> None:
    log = run_experiment(RigSettings(duration_s=5.0))
    model = Dynamics(a_1_s2=196.9, b_1_s=14.8, c_1_s2=191.9)
    shifted = replace(log, flow_velocity_m_s=laboratory.reading(model, log) + 0.25)
    mean, std = laboratory.error_of(model, [shifted, shifted])
    assert mean == pytest.approx(0.25)
    assert std == pytest.approx(0.0, abs=1e-12)


def test_verdicts_on_errors_follow_the_numbers() -> None:
    printed = published.table_2()
    assert all(finding.agrees for finding in findings.of_table_2(printed))
    doubled = [row._replace(std_error=2.0 * row.std_error) if row.height_m == 1.0 else row for row in printed]
    (said,) = findings.of_table_2(doubled)
    assert not said.agrees
    assert "1.0 m (2.00)" in said.here
    assert "0.6 m" not in said.here
    means = [ErrorRow(h, 0, 0.0, float(np.mean([r.std_error for r in printed if r.height_m == h]))) for h in HEIGHTS_M]
    _, serves = findings.of_table_3(means, printed)
    assert serves.agrees
    _, fails = findings.of_table_3([row._replace(std_error=3.0 * row.std_error) for row in means], printed)
    assert not fails.agrees
    assert "3.00 times" in fails.here


def test_verdicts_on_flights_follow_the_numbers(flown: Callable[[int], Flights]) -> None:
    landings = flown(6)
    assert findings.of_flights(landings)[0].agrees
    far = replace(landings, scores=landings.scores | {"max_position_error_m": {"median": 0.6, "p05": 0.5, "p95": 0.7}})
    said = findings.of_flights(far)
    assert not said[0].agrees
    assert findings.broken(said) == [said[0]]
    near = {"median": 0.27, "p05": 0.2, "p95": 0.3}
    honest = landings.honest | {"max_position_error_m": near}
    assert findings.of_flights(replace(landings, honest=honest))[2].agrees
    assert not findings.of_flights(landings)[2].agrees


def test_an_agreement_that_was_put_in_is_called_circular(flown: Callable[[int], Flights]) -> None:
    takeoffs = flown(5)
    largest, states, honest = findings.of_flights(takeoffs)
    assert largest.agrees
    assert largest.verdict == "agrees, circular"
    assert "back-solved from the x of Table 5: 0.0653 m" in largest.here
    assert largest.as_json()["circular"] == largest.circular
    assert states.verdict == honest.verdict == "differs"
    noisier = replace(takeoffs, white_noise_m=0.6)  # the noise that the words name follows what was flown
    assert "0.6 m are back-solved" in findings.circular(noisier)


def test_the_caption_of_figure_28_says_where_the_transient_comes_from(flown: Callable[[int], Flights]) -> None:
    takeoffs = flown(5)
    assert takeoffs.lift_off is not None
    of = takeoffs.lift_off
    assert (of.unshaken_m_s < of.shaken_m_s).mean() > 0.9
    assert 0.3 < of.unshaken_m_s.min() < of.shaken_m_s.max() < 0.8
    facts = of.as_json()
    assert facts["flights"] == 16
    (figure,) = (panel for panel in panels(takeoffs) if panel.key == "figure-28")
    assert f"{facts['unshaken_m_s']['median']:.3f} m/s in the same flights" in figure.caption
    assert f"{100.0 * facts['frozen_inflow_share']['median']:.0f} % of the transient" in figure.caption
    assert flown(6).lift_off is None


def test_the_selected_model_is_the_one_whose_frequency_the_text_gives() -> None:
    assert published.selected_model().natural_frequency_rad_s == pytest.approx(13.8528, abs=5e-5)


def test_what_stands_in_quotation_marks_stands_in_the_paper(paper_folder: Path) -> None:
    text = " ".join((paper_folder / "paper.txt").read_text(encoding="utf-8").split()).lower()
    quoted = [part for row in published.inconsistencies() for part in row.printed.split('"')[1::2]]
    assert len(quoted) > 15
    for words in [*quoted, *(system.printed for system in published.landing_systems())]:
        assert words.lower() in text, words
