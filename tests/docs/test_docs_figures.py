"""Figures of pages and README: named once, filled in, marked when their code is newer, and never run by the build."""

from __future__ import annotations

import json
import subprocess

import pytest

from docs_tools import figures, figures_book, figures_history, figures_pages, figures_table
from flownav.cli.schemas import schema_of
from places import DOCS, PROJECT

README = (PROJECT / "README.md").read_text(encoding="utf-8")
BOOK, Book, Figure, Run = figures_book.read(), figures_book.Book, figures_book.Figure, figures_book.Run
RUN = Run("flownav fly", "abc12345", "2026-01-02", "2 cores, x86_64", ("src/code",))
SMALL = Book(
    {"fly": RUN},
    {"fly.r95_m": Figure(0.0204, "m", 3, "fly", (0.018, 0.0226)), "fly.flights": Figure(767, "", 0, "fly")},
)


def fresh(_run) -> bool:
    return False


def old(_run) -> bool:
    return True


# -- what stands in the book --------------------------------------------------------------------------------------
def test_every_named_figure_is_in_the_book_and_every_figure_is_of_a_producer():
    assert figures_pages.named_in(DOCS, README) <= set(BOOK.figures)
    assert set(BOOK.runs) == set(figures_table.PRODUCERS)
    of_producers = {f"{name}.{key}" for name, each in figures_table.PRODUCERS.items() for key in each.figures}
    assert set(BOOK.figures) == of_producers


@pytest.mark.parametrize("name", sorted(BOOK.figures))
def test_a_figure_is_as_its_producer_says(name):
    figure = BOOK.figures[name]
    producer, read = (
        figures_table.PRODUCERS[figure.run],
        figures_table.PRODUCERS[figure.run].figures[name.split(".")[1]],
    )
    assert (figure.unit, figure.decimals) == (read.unit, read.decimals)
    assert BOOK.runs[figure.run].command == producer.command
    assert BOOK.runs[figure.run].depends == producer.depends
    assert figure.unit == {"m": "m", "s": "m/s"}.get(name.rsplit("_", 1)[-1], "")
    if figure.interval is not None:
        assert figure.interval[0] <= figure.value <= figure.interval[1]


@pytest.mark.parametrize("name", sorted(figures_table.PRODUCERS))
def test_what_a_producer_depends_on_and_writes_exists(name):
    producer = figures_table.PRODUCERS[name]
    assert all((PROJECT / path).exists() for path in producer.depends)
    assert producer.page is None or (DOCS / producer.page).is_file()
    assert bool(producer.figures) != bool(producer.page)
    if producer.command.startswith("make "):
        assert f"\n{producer.command.split()[1]}: " in (PROJECT / "Makefile").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", sorted(name for name, each in figures_table.PRODUCERS.items() if each.figures))
def test_the_paths_of_figures_are_in_the_published_schema(name):
    producer = figures_table.PRODUCERS[name]
    schema = schema_of(producer.command.split()[1])
    for read in producer.figures.values():
        for path in (read.path, *read.interval):
            node = schema
            for step, key, _, number in figures_table.STEP.findall(path):
                node = node["items"] if key or number else _inside(node, step, path)


def _inside(node, key, path):
    assert key in node.get("properties", {}) or "additionalProperties" in node, f"{path}: no {key}"
    return node["properties"][key] if key in node.get("properties", {}) else node["additionalProperties"]


# -- pages --------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("asked", "shown"), [
    ("{{ figure fly.r95_m }}", "0.020 m"),
    ("{{figure fly.r95_m interval}}", "0.020 m (0.018-0.023)"),
    ("{{ figure fly.r95_m bare }}", "0.020"),
    ("{{ figure fly.r95_m size }}", "0.02 m"),
    ("{{ figure fly.flights }}", "767"),
    ("{{ figure fly.flights interval }}", "767"),
])  # fmt: skip
def test_a_name_becomes_its_value(asked, shown):
    assert figures_pages.filled(f"# A\n\nIt is {asked} off.\n", SMALL, fresh, "x.md") == f"# A\n\nIt is {shown} off.\n"


def test_what_is_older_than_its_code_is_marked_and_the_mark_explained():
    page = figures_pages.filled("# A\n\n{{ figure fly.r95_m }}, {{ figure fly.flights }}\n", SMALL, old, "x.md")
    assert page == f"# A\n\n0.020 m†, 767†\n\n{figures_pages.LEGEND}\n"


def test_only_the_figures_of_a_run_that_is_old_are_marked():
    book = Book(
        {"a": RUN, "b": Run("b", "0", "", None, ())}, {"a.x": Figure(1, "s", 1, "a"), "b.x": Figure(2, "", 0, "b")}
    )
    page = figures_pages.filled("# A\n{{ figure a.x }} {{ figure b.x }}", book, lambda run: run is RUN, "x.md")
    assert "1.0 s† 2\n" in page


@pytest.mark.parametrize(("text", "says"), [
    ("{{ figure fly.nothing }}", r"^how-to/x\.md: no figure fly\.nothing in docs/figures\.json; .*$"),
    ("{{ figure fly.r95_m loudly }}", r"^how-to/x\.md: figure fly\.r95_m: no form loudly; choose from interval, .*$"),
])  # fmt: skip
def test_an_unknown_name_is_one_line_with_its_page(text, says):
    with pytest.raises(ValueError, match=says):
        figures_pages.filled(text, SMALL, fresh, "how-to/x.md")


def test_a_page_that_a_command_wrote_says_so_below_its_title():
    book = Book({"table": Run("make table", "abc12345", "2026-01-02", None, ("src",), "a/b.md")})
    page = figures_pages.filled("# A\n\nWords.\n", book, fresh, "a/b.md")
    assert page == "# A\n\n*Printed by `make table` on the code of commit abc12345 (2026-01-02).*\n\nWords.\n"
    assert figures_pages.filled("# A\n\nWords.\n", book, old, "a/b.md").endswith(
        f"*†\n\nWords.\n\n{figures_pages.LEGEND}\n"
    )
    assert figures_pages.filled("# A\n\nWords.\n", book, old, "a/c.md") == "# A\n\nWords.\n"


def test_every_page_of_the_documentation_is_filled_in(tmp_path):
    for path in DOCS.rglob("*.md"):
        (tmp_path / path.relative_to(DOCS)).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path.relative_to(DOCS)).write_text(path.read_text(encoding="utf-8"), encoding="utf-8")
    figures_pages.fill_folder(tmp_path, BOOK, old)
    assert not [path for path in tmp_path.rglob("*.md") if "{{ figure" in path.read_text(encoding="utf-8")]
    assert "†" in (tmp_path / "explanation" / "measured.md").read_text(encoding="utf-8")


def test_the_readme_is_its_render():
    assert figures_pages.readme(README, BOOK) == README, "make figures ONLY=readme, or edit docs/figures.json"
    assert README.count("<!-- figure ") == README.count("<!-- end -->") == len(figures_pages.IN_README.findall(README))


def test_the_readme_takes_a_new_value_and_keeps_its_marks():
    text = "It is <!-- figure fly.r95_m size -->9 m<!-- end --> and <!-- figure fly.flights -->1<!-- end -->."
    assert figures_pages.readme(text, SMALL) == (
        "It is <!-- figure fly.r95_m size -->0.02 m<!-- end --> and <!-- figure fly.flights -->767<!-- end -->."
    )
    with pytest.raises(ValueError, match=r"^README\.md: no figure fly\.gone"):
        figures_pages.readme("<!-- figure fly.gone -->1<!-- end -->", SMALL)


# -- git ----------------------------------------------------------------------------------------------------------
@pytest.fixture
def clone(tmp_path):
    """A repository and a function that commits a file of src/ with a text, whose commit it returns."""

    def git(*arguments):
        made = ["git", "-c", "user.name=a", "-c", "user.email=a@b", *arguments]
        return subprocess.run(made, cwd=tmp_path, check=True, capture_output=True, text=True).stdout.strip()

    def commit(name, text):
        (tmp_path / "src").mkdir(exist_ok=True)
        (tmp_path / "src" / name).write_text(text)
        git("add", "-A")
        git("commit", "-q", "-m", "a change")
        return git("rev-parse", "HEAD")

    git("init", "-q")
    return tmp_path, commit


def test_code_that_changed_after_a_commit_is_newer_and_other_code_is_not(clone):
    folder, commit = clone
    first, second, third = commit("code.py", "x = 1\n"), commit("code.py", "x = 2\n"), commit("other.py", "y = 1\n")

    def newer(since, path):
        figures_history.changed_since.cache_clear()
        return figures_history.changed_since(since, (path,), folder)

    assert newer(first, "src/code.py") == "src/code.py"
    assert newer(second, "src/code.py") == ""
    assert newer(second, "src") == "src/other.py"
    assert newer(third, "src") == ""


@pytest.mark.parametrize(("name", "before", "after", "newer"), [
    ("a.py", '"""Words."""\n\n\ndef f():\n    """Words."""\n    return 1\n',
     '"""Others."""\n\n\ndef f():\n    return 1  # one\n', False),
    ("a.py", 'def f():\n    """Words."""\n    return 1\n', 'def f():\n    """Words."""\n    return 2\n', True),
    ("a.py", 'x = "words"\n', 'x = "others"\n', True),
    ("a.toml", "# words\n", "# others\n", True),
], ids=["words", "code", "a text that is used", "data"])  # fmt: skip
def test_words_about_the_code_do_not_make_figures_old(clone, name, before, after, newer):
    folder, commit = clone
    since = commit(name, before)
    commit(name, after)
    assert figures_history.changed_since(since, ("src",), folder) == (f"src/{name}" if newer else "")


def test_a_file_that_is_new_or_gone_makes_figures_old(clone):
    folder, commit = clone
    since = commit("a.py", "x = 1\n")
    commit("b.py", "")
    assert figures_history.changed_since(since, ("src/b.py",), folder) == "src/b.py"


def test_without_git_and_of_an_unknown_commit_nothing_is_marked(clone, tmp_path_factory):
    folder, commit = clone
    first = commit("a.py", "x = 1\n")
    assert figures_history.changed_since("f" * 40, ("src",), folder) is None
    bare = tmp_path_factory.mktemp("sdist")
    assert figures_history.changed_since(first, ("src",), bare) is None
    assert figures_history.last_change(("src",), bare) is None


def test_the_commit_of_the_code_is_the_last_that_changed_it(clone):
    folder, commit = clone
    first = commit("code.py", "x = 1\n")
    second = commit("other.py", "x = 1\n")
    assert first.startswith(figures_history.last_change(("src/code.py",), folder))
    assert second.startswith(figures_history.last_change(("src",), folder))


def test_commits_that_a_clone_does_not_have_are_named(clone, tmp_path_factory):
    folder, commit = clone
    runs = [Run("a", commit("a.py", "x = 1\n"), "", None, ()), Run("b", "f" * 8, "", None, ())]
    assert figures_history.unknown(runs, folder) == ["f" * 8]
    assert figures_history.unknown(runs, tmp_path_factory.mktemp("sdist")) == []


def test_what_is_not_committed_is_named(clone):
    folder, commit = clone
    commit("code.py", "x = 1\n"), commit("other.py", "y = 1\n")
    assert figures_history.uncommitted(("src",), folder) == []
    (folder / "src" / "code.py").write_text("x = 3\n")
    assert figures_history.uncommitted(("src",), folder) == ["src/code.py"]
    assert figures_history.uncommitted(("src/other.py",), folder) == []


# -- the run ------------------------------------------------------------------------------------------------------
PRINTED = {
    "cases": [
        {"case": "landing", "ensemble": {"p95_m": 9.0}},
        {"case": "approach", "ensemble": {"p95_m": 0.2504, "interval_m": [0.125, 0.5]}},
    ]
}
PRODUCER = figures_table.Producer("flownav accuracy", ("src",), {
    "p95_m": figures_table.Read("cases[case=approach].ensemble.p95_m", "m", 2, ("cases[1].ensemble.interval_m",)),
    "other_m": figures_table.Read("cases[0].ensemble.p95_m", "m", 1),
})  # fmt: skip


def test_a_run_notes_values_intervals_command_commit_and_machine():
    typed, book = [], Book()
    figures.measure("acc", PRODUCER, book, "abc", lambda line: typed.append(line) or json.dumps(PRINTED))
    assert typed == ["flownav accuracy --json"]
    assert book.figures == {
        "acc.p95_m": Figure(0.25, "m", 2, "acc", (0.125, 0.5)), "acc.other_m": Figure(9.0, "m", 1, "acc")
    }  # fmt: skip
    run = book.runs["acc"]
    assert (run.command, run.commit, run.depends, run.page) == ("flownav accuracy", "abc", ("src",), None)
    assert run.machine.split(", ")[0].endswith(" cores")


def test_the_two_ends_of_an_interval_may_lie_apart():
    assert figures_table.interval_at({"low": 1.0, "high": 2.0}, ("low", "high")) == (1.0, 2.0)
    assert figures_table.interval_at({"low": None, "high": 2.0}, ("low", "high")) is None
    assert figures_table.interval_at({}, ()) is None


def test_a_table_is_run_as_it_is_and_noted_with_its_page():
    typed, book = [], Book()
    table = figures_table.Producer("make league", ("src",), page="explanation/league.md")
    figures.measure("league", table, book, "abc", lambda line: typed.append(line) or "# no JSON")
    assert typed == ["make league"]
    assert (book.runs["league"].page, book.figures) == ("explanation/league.md", {})


def test_a_figure_that_is_not_printed_leaves_the_book_as_it_was():
    book = Book()
    with pytest.raises(LookupError, match="no case is approach"):
        figures.measure("acc", PRODUCER, book, "abc", lambda line: json.dumps({"cases": PRINTED["cases"][:1]}))
    assert book == Book()


@pytest.fixture
def bench(tmp_path, monkeypatch):
    """`figures.main` with two producers of its own, whose command prints {"x": 0.5} or fails, and a README."""
    made = {name: figures_table.Producer(name, ("src",), {"x_m": figures_table.Read("x", "m", 1)}) for name in "ab"}
    monkeypatch.setattr(figures, "PRODUCERS", made)
    monkeypatch.setattr(figures, "README", tmp_path / "README.md")
    monkeypatch.setattr(figures_history, "last_change", lambda paths: "abc12345")
    monkeypatch.setattr(figures_history, "uncommitted", lambda paths: [])
    book = tmp_path / "figures.json"
    monkeypatch.setattr(figures_book, "read", lambda read=figures_book.read: read(book))
    monkeypatch.setattr(figures_book, "write", lambda each, write=figures_book.write: write(each, book))
    monkeypatch.setattr(figures, "run", lambda line: json.dumps({"x": 0.5} if line == "b --json" else {}))
    (tmp_path / "README.md").write_text("<!-- figure b.x_m -->9 m<!-- end -->")
    return tmp_path


def test_what_has_run_is_kept_where_another_fails(bench, capsys):
    assert figures.main(["a", "b"]) == 1
    noted = json.loads((bench / "figures.json").read_text())
    assert list(noted["figures"]) == ["b.x_m"]
    assert noted["runs"]["b"]["commit"] == "abc12345"
    assert (bench / "README.md").read_text() == "<!-- figure b.x_m -->0.5 m<!-- end -->"
    assert "figures: a: 'x'" in capsys.readouterr().err
    assert figures.main(["b"]) == 0


def test_code_that_is_not_committed_and_no_git_are_one_line(bench, monkeypatch):
    monkeypatch.setattr(figures_history, "uncommitted", lambda paths: ["src/a.py"])
    with pytest.raises(ValueError, match=r"^b: commit src/a\.py first, "):
        figures.main(["b"])
    monkeypatch.setattr(figures_history, "last_change", lambda paths: None)
    with pytest.raises(ValueError, match=r"^figures are noted with the commit of their code: "):
        figures.main(["b"])


def test_commands_run_with_this_python_and_the_logs_at_hand(monkeypatch):
    monkeypatch.setenv("FLOWNAV_DATA", "/logs")
    assert figures.run("python -c \"print('../shared/data/x')\"") == "/logs/x\n"
    with pytest.raises(RuntimeError, match=r"^`python -c 'raise SystemExit\(1\)'` ended with status 1$"):
        figures.run("python -c 'raise SystemExit(1)'")


@pytest.mark.parametrize(("status", "fine"), [(0, True), (1, True), (2, False), (-9, False)])
def test_a_verdict_of_flownav_is_no_failure_and_bad_input_is(monkeypatch, status, fine):
    monkeypatch.setattr(figures.subprocess, "run", lambda *a, **k: subprocess.CompletedProcess(a, status, "{}"))
    if fine:
        assert figures.run("flownav accuracy --json") == "{}"
    else:
        with pytest.raises(RuntimeError, match=f"^`flownav accuracy --json` ended with status {status}$"):
            figures.run("flownav accuracy --json")


@pytest.mark.parametrize("key", figures_table.PRODUCERS["accuracy"].figures)
def test_figures_of_accuracy_are_of_the_case_and_of_the_flights_that_their_names_say(key):
    read = figures_table.PRODUCERS["accuracy"].figures[key]
    if key == "flights":
        return
    case = next(each for each in ("takeoff", "landing", "pad_return", "approach", "windy") if key.startswith(each))
    matched = "dispersed" not in key if "p95" in key else "matched" in key
    where = f"cases[case={'approach_8_m_s' if case == 'windy' else case}].{'matched' if matched else 'ensemble'}."
    assert all(path.startswith(where) for path in (read.path, *read.interval))


def test_what_only_names_is_run():
    assert figures.chosen("", README) == list(figures_table.PRODUCERS)
    assert figures.chosen("league,indoor", README) == ["league", "indoor"]
    assert "certify" in figures.chosen("readme", README)
    assert "league" not in figures.chosen("readme", README)
    with pytest.raises(ValueError, match=r"^no figures leage; choose from readme, .*league"):
        figures.chosen("leage", README)


def test_a_book_is_read_as_it_was_written(tmp_path):
    figures_book.write(SMALL, tmp_path / "figures.json")
    assert figures_book.read(tmp_path / "figures.json") == SMALL
    assert figures_book.read(tmp_path / "none.json") == Book()
    figures_book.write(BOOK, tmp_path / "figures.json")
    assert (tmp_path / "figures.json").read_text() == figures_book.BOOK.read_text()
