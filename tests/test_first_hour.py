"""One flight has one set of figures in README, first tutorial, terminal and report."""

from __future__ import annotations

import re
from html.parser import HTMLParser

import numpy as np
import pytest

import flownav
from command import run
from flownav.scoring.headline import length, sentence
from places import DOCS, PROJECT

README = (PROJECT / "README.md").read_text(encoding="utf-8")
TUTORIAL = (DOCS / "tutorials" / "first-landing.py").read_text(encoding="utf-8")
STATES = {"x": "pos_n_m", "y": "pos_e_m", "z": "pos_d_m", "u": "vel_u_m_s", "v": "vel_v_m_s", "w": "vel_w_m_s"}


class Words(HTMLParser):
    """The words of a page."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.words: list[str] = []
        self.feed(page)

    def handle_data(self, data: str) -> None:
        self.words += data.split()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("first")


@pytest.fixture(scope="module")
def terminal(folder):
    done = run("fly", "--seed", 1, "--out", "sortie.fnr", cwd=folder)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def record(terminal, folder):
    return flownav.load(folder / "sortie.fnr")


def test_the_terminal_says_the_landing_first_in_a_screen_of_80_by_24_without_words_of_ours(terminal, record):
    lines = terminal.splitlines()
    assert len(lines) <= 20
    assert max(map(len, lines)) <= 80
    away = length(record.scores["touchdown"]["rest"]["distance_m"])
    assert lines[0].startswith(f"Landed {away} from the pad's centre in 4 m/s of wind.")
    assert not re.search(r"matched|ensemble|midg|flown on|hand-over|limited by|NIS|R95", terminal)


def test_terminal_table_is_that_of_the_record_which_readme_and_tutorial_name(terminal, record):
    table = "record.flown.to_pandas()"
    assert table in README
    assert table in TUTORIAL
    flown, truth, counted = record.flown.to_pandas(), record.truth.to_pandas(), record.judging["counted"] > 0.0
    for state, column in STATES.items():
        error = (flown[column] - truth[column])[counted]
        printed = re.search(rf"^{state} \[m(?:/s)?\] +(.*)$", terminal, re.M)[1].split()
        mine = (error.mean(), error.std(ddof=0), np.sqrt((error**2).mean()), error.abs().max())
        assert printed == [f"{figure:.4f}" for figure in mine]


def test_what_the_tutorial_prints_and_draws_is_the_terminals_row(terminal, tmp_path, monkeypatch, capsys):
    pytest.importorskip("matplotlib").use("Agg")
    monkeypatch.chdir(tmp_path)
    cells = re.split(r"^(# %%.*)$", TUTORIAL.split("# ## Change something")[0], flags=re.M)
    code = "\n".join(body for head, body in zip(cells[1::2], cells[2::2], strict=True) if head == "# %%")
    told: dict = {}
    exec(compile(code, "first-landing.py", "exec"), told)
    said = capsys.readouterr().out
    _, _, rms, largest = re.search(r"^x \[m\] +(.*)$", terminal, re.M)[1].split()
    assert f"north, in flight: {rms} m rms, {largest} m at most" in said
    inside = (told["off_m_s"].abs() <= told["band_m_s"]).mean()
    assert 0.92 <= inside <= 0.98
    ratio = told["off_m_s"].std() / (0.5 * told["band_m_s"]).median()
    assert 0.3 < ratio < 3.0  # neither swallows the other


def test_plots_have_the_frame_of_the_table_and_a_band_that_holds_its_curve(record):
    pytest.importorskip("plotly")
    lines = record.plot("errors").data
    curves = [np.asarray(line.y, float) for line in lines if line.name == "estimate"]
    for state, curve in zip("xyz", curves, strict=False):
        assert np.nanmax(abs(curve)) == pytest.approx(record.scores["states"][state]["max_error"], abs=1e-12)
    bands = [np.asarray(line.y, float) for line in lines if line.name == "2 sigma stated"]
    assert (len(curves), len(bands)) == (6, 3)
    for curve, band in zip(curves[3:], bands, strict=True):
        known = curve[np.isfinite(curve)]
        assert np.mean(abs(known) <= band[: len(known)]) >= 0.92
    path = {line.name: np.column_stack([line.y, line.x, line.z]) for line in record.plot("path").data}
    apart = path["estimate"] - path["truth"]
    assert np.nanmax(abs(apart[:, 0])) == pytest.approx(record.scores["states"]["x"]["max_error"], abs=1e-12)


def test_the_report_says_the_terminals_sentence_and_distance(record, terminal, folder):
    written = Words((folder / "sortie.html").read_text(encoding="utf-8"))
    page = " ".join(written.words).replace("\N{NO-BREAK SPACE}", " ")
    told = sentence(record.manifest, record.scores)
    assert " ".join(terminal.split()).startswith(told)
    assert told in page
    assert f"{record.scores['touchdown']['contact']['distance_m']:.3f}" in page


def test_the_python_of_the_readme_gives_what_it_names():
    block = re.search(r"```python\n(.*?)```", README, re.S)[1]
    told: dict = {}
    exec(compile(block, "README", "exec"), told)
    landing = told["record"].scores["touchdown"]
    assert landing["verdict"] == "landed"
    assert landing["contact"]["distance_m"] < 0.2


def test_a_sentence_for_each_end():
    calm = {"parameters": {"scenario": {"wind": {"speed_20ft_m_s": 0.0}}}}
    rest = {"contact": {"distance_m": 0.5}, "rest": {"distance_m": 1.234}, "broken": [], "go_arounds": 0}
    landed = rest | {"success": True, "verdict": "landed"}
    assert sentence(calm, {"touchdown": landed}) == "Landed 1.23 m from the pad's centre in calm air."
    crashed = landed | {"success": False, "broken": ["tilt"], "verdict": "crashed"}
    assert sentence({}, {"touchdown": crashed}) == "Crashed (tilt), 1.23 m from the pad's centre."
    aloft = {"contact": None, "rest": None, "success": False, "broken": [], "go_arounds": 2, "verdict": "went around"}
    said = sentence({}, {"touchdown": aloft | {"reason": "broke its landing off 2 times, 4.00 m over the ground"}})
    assert said == "Went around: broke its landing off 2 times, 4.00 m over the ground."
    many = {"success": {"rate": 1.0}, "rest": {"r95_m": 0.03, "r95_interval_m": [0.02, 0.04]}}
    counted = {"landed": 95, "flights": 96, "touchdown": many}
    assert sentence({}, counted) == "95 of 96 flights landed, 95 % of them all within 3.0 cm of the pad's centre."
    few = {"r95_m": 0.03, "r95_interval_m": [0.02, None], "distance_m": {"median": 0.012}}
    said = sentence({}, counted | {"touchdown": many | {"rest": few}})
    assert said == "95 of 96 flights landed, the median 1.2 cm from the pad's centre."
    assert sentence({}, {}) == ""
