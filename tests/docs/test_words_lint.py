"""The lint of words: what it finds in sentences, names and pages, what it leaves, and what is allowed."""

from __future__ import annotations

from pathlib import Path

import pytest

import words
from words import BANNED, exceptions, findings, main

MODULE = '''"""What a vehicle is told."""

# so many readings
class Told:
    """Heard of late."""

    unsaid_s: float = 0.0


def message(count):
    """Return a sentence that names `told` in code."""
    key = "told"
    return key, f"{count} readings were handed over", "nothing was\\nsaid"
'''


def tree(folder: Path, **files: str) -> Path:
    """A repository of a few files; `__` in a name stands for a folder."""
    for name, text in files.items():
        stem, _, suffix = name.rpartition("_")
        path = folder / f"{stem.replace('__', '/')}.{suffix}"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return folder


def found_in(root: Path) -> list[tuple[str, int, str]]:
    """Findings without their suggestions."""
    return [(one.file, one.line, one.word) for one in findings(root)]


def test_sentences_and_names_of_the_package_are_searched(tmp_path):
    file = "src/flownav/a.py"
    assert found_in(tree(tmp_path, src__flownav__a_py=MODULE)) == [
        (file, 1, "What"), (file, 1, "told"), (file, 3, "so many"), (file, 4, "told"), (file, 5, "heard"),
        (file, 7, "unsaid"), (file, 13, "handed"), (file, 14, "said"),
    ]  # fmt: skip


def test_names_are_searched_in_the_package_alone_and_of_tests_docstrings_alone(tmp_path):
    root = tree(tmp_path, tools__a_py=MODULE, tests__test_a_py=MODULE)
    assert [word for file, _, word in found_in(root) if file == "tools/a.py"] == [
        "What", "told", "so many", "heard", "handed", "said",
    ]  # fmt: skip
    assert [word for file, _, word in found_in(root) if file == "tests/test_a.py"] == ["What", "told", "heard"]


@pytest.mark.parametrize("name", ["told", "_told_s", "NavigatorTold", "UNSAID_M", "x_heard", "seeing"])
def test_a_banned_word_is_found_in_any_spelling_of_a_name(tmp_path, name):
    assert [line for _, line, _ in found_in(tree(tmp_path, src__a_py=f"\n{name} = 1\n"))] == [2]


@pytest.mark.parametrize("name", ["toldest", "retold", "aforesaid", "threshold", "handle", "hand_over", "sightseeing"])
def test_a_name_that_only_contains_the_letters_stays(tmp_path, name):
    assert found_in(tree(tmp_path, src__a_py=f"{name} = 1\n")) == []


@pytest.mark.parametrize("word", BANNED)
def test_every_banned_word_is_found_in_a_page_in_any_case(tmp_path, word):
    root = tree(tmp_path, docs__how__page_md=f"# Title\n\n{word.capitalize()} here.\n")
    assert (1, "docs/how/page.md", 3) in [(1, file, line) for file, line, _ in found_in(root)]
    assert word in [one for _, _, one in found_in(root)]


def test_code_and_links_of_a_page_are_no_prose(tmp_path):
    page = "# Title\n\n`told` and [a page](said.md)\n\n```python\ntold = 1\n```\n\nIt was told.\n"
    assert found_in(tree(tmp_path, README_md=page)) == [("README.md", 9, "told")]


def test_of_the_changelog_only_what_is_not_released_is_searched(tmp_path):
    log = "# Changelog\n\n## 0.2.0 (unreleased)\n\n- It was said.\n\n## 0.1.0\n\n- It was told.\n"
    assert found_in(tree(tmp_path, CHANGELOG_md=log)) == [("CHANGELOG.md", 5, "said")]


def test_an_exception_is_for_its_word_its_file_and_its_text_alone(tmp_path):
    page = "He said no.\nHe said yes.\nHe told no.\n"
    allowed = "# a remark\n\nsaid | README.md | no\ntold | * | maybe\n"
    root = tree(tmp_path, README_md=page, docs__a_md=page, tools__words_allowed_txt=allowed)
    assert len(exceptions(root)) == 2
    assert found_in(root) == [
        ("README.md", 2, "said"), ("README.md", 3, "told"),
        ("docs/a.md", 1, "said"), ("docs/a.md", 2, "said"), ("docs/a.md", 3, "told"),
    ]  # fmt: skip


def test_it_prints_a_line_each_or_counts_and_says_whether_the_tree_is_clean(tmp_path, capsys):
    root = tree(tmp_path / "bad", README_md="He said so.\nHe said it, as told.\n")
    assert main([str(root)]) == 1
    assert capsys.readouterr().out.splitlines()[0] == "README.md:1: said -> stated, reported, named"
    assert main([str(root), "--count"]) == 1
    assert capsys.readouterr().out.split("\n") == ["     2 said", "     1 told", "     3 in 1 files", ""]
    assert main([str(tree(tmp_path / "good", README_md="He stated so.\n"))]) == 0
    assert capsys.readouterr().out == ""


def test_the_list_of_exceptions_fits_the_tree():
    """An exception that no line needs any more goes."""
    root = Path(words.__file__).parent.parent
    assert all(entry.file == "*" or (root / entry.file).is_file() for entry in exceptions(root))
    assert all(entry.word in {*BANNED, *words.BANNED_IN_NAMES, words.OPENING} for entry in exceptions(root))
