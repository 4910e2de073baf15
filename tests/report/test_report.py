"""The report as a file: what it says, that it is safe and whole, and that it needs nothing from outside."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from flownav.cli.records import report as report_command
from flownav.core import files
from flownav.core.errors import InputError
from flownav.core.record import Record
from flownav.report.figures_innovation import innovations
from flownav.report.figures_states import position
from flownav.report.html import render, write_report
from flownav.report.tables import NONE, rejected_rows, sensor_rows
from report_records import flight, navigated, replay


class Page(HTMLParser):
    """A page as a browser sees it: text without scripts, scripts, attributes that load something."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.words: list[str] = []
        self.scripts: list[tuple[dict[str, str | None], str]] = []
        self.loads: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.styles = ""
        self._inside = ""
        self.feed(text)
        self.text = " ".join(" ".join(self.words).split())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        attributes = dict(attrs)
        self.tags.append((tag, attributes))
        self.loads += [str(attributes[name]) for name in ("src", "href", "data", "action") if name in attributes]
        self._inside = tag
        if tag == "script":
            self.scripts.append((attributes, ""))

    def handle_endtag(self, tag: str) -> None:
        self._inside = ""

    def handle_data(self, data: str) -> None:
        if self._inside == "script":
            attributes, text = self.scripts[-1]
            self.scripts[-1] = (attributes, text + data)
        elif self._inside == "style":
            self.styles += data
        else:
            self.words.append(data)

    def data(self) -> dict:
        """The data for the page's script, columns apart."""
        return json.loads(next(text for attributes, text in self.scripts if attributes.get("id") == "record-data"))

    def figures(self) -> set[str]:
        """The keys of every figure that the page draws."""
        return {str(attributes["data-figure"]) for _, attributes in self.tags if "data-figure" in attributes}

    def code(self) -> list[str]:
        """The scripts that run."""
        return [text for attributes, text in self.scripts if "type" not in attributes]


@pytest.fixture(scope="module")
def landing() -> Page:
    return Page(render(flight()))


@pytest.fixture(scope="module")
def outdoor() -> Page:
    return Page(render(replay(120.0)))


def test_the_headline_says_what_flew_and_how_well(landing: Page) -> None:
    for words in ("Landing", "the filter paper", "a GPS of the model white", "seed 1", "flight of 50.0"):
        assert words in landing.text
    assert "Largest error of one axis" in landing.text
    assert "paper 0.272 m" in landing.text
    assert re.search(r"No axis of the estimated position was ever off by more than 0\.\d+\sm", landing.text)
    assert "never further" not in landing.text
    assert "0.083 m from the pad's centre, sinking at 0.29 m/s" in landing.text
    assert re.search(r"Flow sensor engaged 1\d %", landing.text)  # from 2.2 m down to 0.02 m at 0.3 m/s, of 50 s


def test_a_replays_flow_is_valid_readings_not_an_engaged_sensor(outdoor: Page) -> None:
    assert re.search(r"Valid flow readings \d+ %", outdoor.text)
    assert "engaged" not in outdoor.text


def test_scores_are_shown_as_the_record_carries_them_beside_the_papers() -> None:
    record = flight()
    record.manifest["scores"]["states"]["v"] = {
        "mean_error": -7.1234, "std_error": 8.2345, "rms_error": 9.3456, "max_error": 6.4567
    }  # fmt: skip
    text = Page(render(record)).text
    assert "v , right (m/s) \N{MINUS SIGN}7.1234 0.0069 8.2345 0.0446 9.3456 6.4567" in text
    assert "beside the paper's Table 6" in text


def test_sensors_are_judged_in_words_and_the_drift_at_the_end_is_told() -> None:
    record = replay()
    record.manifest["scores"] |= {
        "end_drift_m": 0.417,
        "coverage": {"range": {"t0": 1.0, "t1": 31.25}, "imu": {"t0": 0.0, "t1": 60.0}},
        "consistency": {"range": {"nis_per_dof": 2.5, "samples": 1234, "white": False, "refused": 0.125}},
    }
    record.tables.pop("imu", None)
    at_4_hz = np.arange(121) * 0.25
    record.tables["range"] = {"t_s": at_4_hz[(at_4_hz <= 10) | (at_4_hz >= 12.25)], "range_m": np.ones(113)}
    said = "act: 1.6 times the scatter that the filter expects, 12 % of it refused in flight"
    assert sensor_rows(record) == [
        ("Rangefinder", "1.0 to 31.2", "3.7", "2.25", "1,234", "2.50", "12.5", said),
        ("IMU", "0.0 to 60.0", NONE, NONE, NONE, NONE, NONE, ""),
    ]
    page = render(record)
    assert "act: the sensor is trusted too much" in page
    assert "0.417" in page
    for told in ("--to ulog</code> for PlotJuggler", "--to foxglove</code> for Foxglove", "flownav view RECORD.fnr"):
        assert told in page
    assert sensor_rows(Record()) == []


@pytest.mark.parametrize("value", [{}, [], "many", None, 10**400, -(10**400), float("inf")])
def test_scores_of_a_manifest_that_are_no_numbers_are_dashes(value):
    """A record from elsewhere: a page is written all the same."""
    whole, count = {"rejected": {"gate": value}, "read": value}, {"gate": 3, "other": value}
    record = Record(
        {
            "scores": {
                "rejected": {"gps": count, "range": value},
                "readings": {"gps": whole},
                "coverage": {"gps": {"t0": value, "t1": 2.0}},
                "consistency": {"gps": {"nis_per_dof": value, "samples": value, "refused": 0.5}},
            }
        }
    )
    rows = rejected_rows(record)
    assert ("gps", "gate") in [row[:2] for row in rows]
    (row,) = sensor_rows(record)
    assert row[1] == f"{NONE} to 2.0"


def test_without_a_paper_table_the_scores_stand_alone() -> None:
    record = flight()
    record.manifest["paper"] = None
    text = Page(render(record)).text
    assert "Error of the estimate against the truth." in text
    assert "Table 6" not in text


def test_figures_that_are_no_numbers_show_as_a_dash() -> None:
    record = flight()
    record.manifest["scores"]["states"]["x"] = {"mean_error": None, "std_error": float("nan")}
    dash = "\N{EN DASH}"
    assert f"x , north (m) {dash} 0.0133 {dash} 0.0750 {dash} {dash}" in Page(render(record)).text


@pytest.mark.parametrize(
    ("against", "said"), [("gps", "against GPS, their mean"), ("truth", "against the recorded truth.")]
)
def test_the_autopilots_own_errors_stand_beside_ours(against: str, said: str) -> None:
    record = replay(60.0)
    errors = {"horizontal_rms_m": 0.41, "horizontal_max_m": 1.25}
    record.manifest["scores"]["autopilot"] = {"name": "PX4 EKF2", "against": against, **errors}
    if against == "truth":
        record.manifest["scores"]["truth"] = errors
    text = Page(render(record)).text.replace("\N{NO-BREAK SPACE}", " ")
    assert f"The autopilot's own estimate (PX4 EKF2) is off by 0.41 m rms, 1.25 m at most, horizontally, {said}" in text
    record.manifest["scores"]["autopilot"] = {"name": "PX4 EKF2", "against": None}
    assert "The autopilot's own estimate (" not in Page(render(record)).text


def test_odometry_is_not_called_truth() -> None:
    record = flight()
    record.manifest["truth_name"] = "visual odometry"
    record.manifest["scores"] = {
        "truth": {"horizontal_rms_m": 0.41, "horizontal_max_m": 1.25},
        "end_drift_m": 0.3,
        "max_position_error_m": 0.2,
    }
    text = Page(render(record)).text.replace("\N{NO-BREAK SPACE}", " ")
    assert "Against the recorded visual odometry (an estimate itself) its position is off by 0.41 m" in text
    assert "No truth: errors are shown against the visual odometry, which has errors of its own." in text
    assert "horizontal, visual odometry laid on at take-off" in text
    assert "the recorded truth" not in text
    names = [trace.name for trace in position(record).figure.data]
    assert "visual odometry" in names
    assert "truth" not in names
    record.manifest["truth_name"] = "the simulator"
    assert "truth" in [trace.name for trace in position(record).figure.data]


def test_flow_that_was_fused_without_a_range_is_not_called_absent() -> None:
    record = replay(60.0)
    t_s = record.tables["estimate"]["t_s"][::5]
    zero = np.zeros(len(t_s))
    names = ("flow_x_rad_s", "flow_y_rad_s", "gyro_x_rad_s", "gyro_y_rad_s")
    record.tables.pop("flow_velocity", None)
    record.tables.pop("range", None)
    record.add("flow_rate", {"t_s": t_s, **dict.fromkeys(names, zero), "quality": zero + 200.0})
    text = Page(render(record)).text
    assert "No valid optical flow" not in text
    assert "No range at the time of the flow: its readings are fused" in text
    assert "Valid flow readings no valid readings" not in text


def test_a_record_without_gps_and_truth_does_not_speak_of_errors_against_gps() -> None:
    record = replay(60.0)
    del record.tables["gps_position"]
    assert "No truth: no error can be shown." in Page(render(record)).text


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (lambda: replay(60.0), "No truth: errors are shown against GPS"),
        (lambda: replay(60.0, flow=False), "No valid optical flow"),
        (lambda: replay(60.0, autopilot=False), "No estimate of an autopilot's own"),
        (lambda: Record({"kind": "replay"}), "No estimate: nothing was fused."),
        (Record, "The record carries no scores."),
    ],
)
def test_what_a_record_lacks_is_said_in_words(made, words: str) -> None:
    assert words in Page(render(made())).text


def test_an_empty_record_makes_a_page_whose_every_panel_gives_its_reason() -> None:
    page = Page(render(Record()))
    assert page.figures() == set()
    assert page.data()["views"] is None
    panels = [attributes for tag, attributes in page.tags if tag == "figure"]
    assert len(panels) >= 8
    assert all("empty" in str(attributes["class"]) for attributes in panels)
    for words in ("holds no positions", "holds no innovations", "holds no events", "states no parameters"):
        assert words in page.text


@pytest.mark.parametrize(
    "table", ["truth", "estimate", "command", "gps_position", "flow_velocity", "innovation", "events"]
)
def test_a_flight_reports_without_any_one_of_its_tables(table: str) -> None:
    record = flight()
    del record.tables[table]
    assert Page(render(record)).figures()


def test_a_record_reports_the_same_after_a_round_trip_through_its_file(tmp_path: Path) -> None:
    record = flight()
    record.save(tmp_path / "landing.fnr")
    assert render(Record.load(tmp_path / "landing.fnr")) == render(record)


def test_a_replay_is_told_by_its_outages(outdoor: Page) -> None:
    assert "With GPS withheld from 36 to 60 s, the worst of 2 outages," in outdoor.text
    assert "36 to 60 s transit 0.87 1.63 this record" in outdoor.text
    assert re.search(r"1 to 3 s [a-z, ]+ 0.41 0.72 a replay of its own", outdoor.text)
    assert "median 0.64" in outdoor.text
    assert "Flow no data 406 812" in outdoor.text
    assert (
        "GPS position outage \N{EN DASH} 300 \N{EN DASH}" in outdoor.text
    )  # a record from before readings were counted
    assert "gps-distance" in outdoor.figures()
    assert "position-error" not in outdoor.figures()


def test_only_outages_of_this_record_are_shaded(outdoor: Page) -> None:
    assert outdoor.data()["facts"]["outages"] == [[36.0, 60.0]]
    assert outdoor.data()["views"]["outages"] == [[36.0, 60.0]]


def test_events_are_counted_and_a_long_list_is_cut_and_says_so() -> None:
    record = flight()
    count = 1234
    record.add("events", {"t_s": np.linspace(0, 50, count), "source": np.full(count, "flow"),
                          "kind": np.full(count, "rejected"), "detail": np.full(count, "gate"),
                          "value": np.full(count, 1.5)})  # fmt: skip
    page = Page(render(record))
    assert "1234 events, by source and kind." in page.text
    assert "flow rejected 1234 0.00 50.00 hover, approach, touchdown, landed" in page.text
    assert "The first 300 events, one by one" in page.text
    assert page.text.count("gate 1.5") == 300


def test_parameters_provenance_and_the_command_are_listed(landing: Page) -> None:
    for words in ("rotor.radius_m 0.9", "step_s 0.002", "maxi_joker_3.toml 9f86d081", "flownav fly landing --seed 1"):
        assert words in landing.text


ATTACK = "</script><script>alert(1)</script><img src=x onerror=alert(2)>"


def test_text_from_the_record_is_never_markup() -> None:
    record = flight()
    plain = Page(render(record))
    record.manifest |= {"scenario": ATTACK, "filter": ATTACK, "gps": ATTACK, "command": ATTACK, "description": ATTACK}
    record.manifest["parameters"] = {ATTACK: {ATTACK: ATTACK}}
    record.manifest["provenance"] = {ATTACK: ATTACK}
    record.manifest["paper"]["title"] = ATTACK
    record.manifest["scores"]["rejected"] = {ATTACK: {ATTACK: 3}}
    for column in ("source", "kind", "detail"):
        record.tables["events"][column] = np.full(len(record.tables["events"]["t_s"]), ATTACK)
    table = record.tables["innovation"]
    table["sensor"] = np.full(len(table["t_s"]), ATTACK)
    table["component"] = np.full(len(table["t_s"]), ATTACK)
    page = Page(render(record))
    assert page.code() == plain.code()
    assert not [tag for tag, _ in page.tags if tag == "img"]
    assert not [name for _, attributes in page.tags for name in attributes if name.startswith("on")]
    assert page.text.count("alert(1)") > 10  # it is all there, as words
    rows = page.data()["charts"][f"innovation-{ATTACK.lower()}"]["rows"]
    assert ATTACK in [row["title"].replace("_", " ") for row in rows]  # the page's script writes it as text alone
    panel = next(panel for panel in innovations(record) if ATTACK.lower() in panel.key)
    assert not any("<" in axis.title.text for axis in panel.figure.select_yaxes())  # Plotly reads some tags itself


def test_the_page_loads_nothing(landing: Page, outdoor: Page) -> None:
    for page in (landing, outdoor):
        assert [load for load in page.loads if not load.startswith("#")] == []
        assert not [tag for tag, _ in page.tags if tag in ("link", "img", "iframe", "object", "embed", "base")]
        assert "url(" not in page.styles
        assert "@import" not in page.styles
        assert len(page.code()) == 7
        for own_code in page.code()[1:]:  # the first script is uPlot, which the policy below confines
            assert "://" not in own_code
            for way in ("innerHTML", "eval(", "Function(", "fetch(", "XMLHttpRequest", "import(", "document.write"):
                assert way not in own_code
        assert "://" not in json.dumps(page.data())


def test_the_policy_confines_the_page_to_its_own_scripts(landing: Page) -> None:
    policy = next(str(a["content"]) for tag, a in landing.tags if a.get("http-equiv") == "Content-Security-Policy")
    rules = dict(rule.split(" ", 1) for rule in policy.split("; "))
    assert rules["default-src"] == "'none'"
    digests = [base64.b64encode(hashlib.sha256(code.encode()).digest()).decode() for code in landing.code()]
    assert rules["script-src"] == " ".join(f"'sha256-{digest}'" for digest in digests)


def test_the_page_names_its_language_headings_and_figures_for_screen_readers(landing: Page) -> None:
    tags = landing.tags
    assert ("html", {"lang": "en"}) in tags
    assert sum(tag == "h1" for tag, _ in tags) == 1
    plots = [attributes for _, attributes in tags if "data-figure" in attributes]
    assert {"path-3d", "ground-track", *landing.data()["charts"]} == landing.figures()
    assert all(attributes["role"] == "group" and len(str(attributes["aria-label"])) > 20 for attributes in plots)
    buttons = [attributes for tag, attributes in tags if tag == "button" and "data-csv" in attributes]
    assert {button["data-csv"] for button in buttons} == set(landing.data()["charts"])
    assert all(str(button["aria-label"]).startswith("Save the data of") for button in buttons)
    assert all("scope" in attributes for tag, attributes in tags if tag == "th")
    names = [str(attributes["id"]) for _, attributes in tags if "id" in attributes]
    assert len(names) == len(set(names))


@pytest.mark.parametrize("make", [flight, navigated, replay], ids=["landing", "navigated", "849 s"])
def test_the_page_stays_small_enough_to_send(make) -> None:
    assert len(render(make()).encode()) <= 2.2e6


def test_the_report_appears_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = tmp_path / "made" / "landing.html"
    write_report(Record(), page)
    before = page.read_text(encoding="utf-8")

    def fail(*_: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(files.os, "replace", fail)
    with pytest.raises(OSError, match="disk full"):
        write_report(flight(), page)
    assert page.read_text(encoding="utf-8") == before
    assert [file.name for file in page.parent.iterdir()] == ["landing.html"]


def cli() -> typer.Typer:
    app = typer.Typer()
    app.command()(report_command)
    return app


def test_the_command_writes_beside_the_record_and_prints_json(tmp_path: Path) -> None:
    record = tmp_path / "landing.fnr"
    Record({"kind": "fly"}).save(record)
    result = CliRunner().invoke(cli(), [str(record), "--json"])
    page = tmp_path / "landing.html"
    assert json.loads(result.stdout) == {"schema": 1, "record": str(record), "report": str(page)}
    assert page.is_file()


def test_the_command_writes_where_it_is_told(tmp_path: Path) -> None:
    record = tmp_path / "landing.fnr"
    Record().save(record)
    result = CliRunner().invoke(cli(), [str(record), "--out", str(tmp_path / "a" / "b.html")])
    assert result.exit_code == 0
    assert (tmp_path / "a" / "b.html").is_file()
    assert str(tmp_path / "a" / "b.html") in result.stdout


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["absent.fnr"], "no such record"),
        (["here.fnr", "--out", "here.fnr"], "would replace its own record"),
        (["here.fnr", "--out", "here.fnr/page.html"], "cannot be written"),
    ],
)
def test_the_command_says_what_is_wrong(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Record().save(Path("here.fnr"))
    result = CliRunner().invoke(cli(), arguments)
    assert isinstance(result.exception, InputError)
    assert words in str(result.exception)
    assert "\n" not in str(result.exception)
    assert [file.name for file in tmp_path.iterdir()] == ["here.fnr"]
