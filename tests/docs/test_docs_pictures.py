"""Pictures of the documentation: each is drawn by a function, lies in its place, and is shown by its page."""

from __future__ import annotations

import ast
import re

import matplotlib.pyplot as plt
import pytest

import flownav
from docs_tools import pictures, readme_picture
from places import DOCS, PROJECT

APP = (DOCS / "tutorials" / "without-typing.md").read_text(encoding="utf-8")  # tools/docs/app_pictures.py takes them
MADE_OTHERWISE = {"certificate", "rerun", *re.findall(r"pictures/(app-[\w-]+)\.png", APP)}  # photographs


@pytest.mark.parametrize("picture", pictures.PICTURES, ids=lambda picture: picture.name)
def test_every_picture_is_shown_by_its_page_and_says_what_it_shows(picture):
    assert (DOCS / "pictures" / f"{picture.name}.png").is_file()
    page = (DOCS / f"{picture.page}.md").read_text(encoding="utf-8")
    assert f"](../pictures/{picture.name}.png)" in page
    assert picture.shows.endswith(".")
    assert f"tools/docs/{picture.draw.__module__}.py" in pictures.gallery()


def test_every_file_among_the_pictures_is_drawn_by_something():
    lying = {path.stem for path in (DOCS / "pictures").glob("*.png")}
    assert lying == {picture.name for picture in pictures.PICTURES} | MADE_OTHERWISE


def test_pictures_are_small():
    assert max(path.stat().st_size for path in (DOCS / "pictures").glob("*.png")) < 400_000


def test_a_picture_is_drawn_the_same_each_time(tmp_path):
    def line():
        figure, axis = plt.subplots()
        axis.plot([1, 2])
        return figure

    first = pictures.save(pictures.Picture("line", "", "A line.", line), tmp_path).read_bytes()
    assert first.startswith(b"\x89PNG")
    assert pictures.save(pictures.Picture("line", "", "A line.", line), tmp_path).read_bytes() == first
    assert b"Software" not in first


def test_the_readmes_picture_is_of_the_command_that_it_names():
    command = readme_picture.command()
    assert command[0] == "fly"
    assert f"`flownav {' '.join(command)}`" in (PROJECT / "README.md").read_text(encoding="utf-8")
    for name, shape in (("landing", "wide"), ("landing-narrow", "high")):
        picture = (DOCS / "pictures" / f"{name}.svg").read_text(encoding="utf-8")
        assert f"of {command[command.index('--flights') + 1]} flights" in picture
        wide, high = map(float, re.findall(r'viewBox="[-\d.]+ [-\d.]+ ([\d.]+) ([\d.]+)"', picture)[0])
        assert (wide > high) == (shape == "wide")
        assert shape == "wide" or wide < 420  # its words are as large on a phone as they are drawn
    for page in (PROJECT / "README.md", DOCS / "index.md"):
        words = page.read_text(encoding="utf-8")
        assert re.search(r'<source media="\(max-width: 600px\)" srcset="[\w/]*pictures/landing-narrow.svg">', words)
        assert re.search(r'<img alt="[^"]+" src="[\w/]*pictures/landing.svg">', words)


def test_the_front_page_is_a_sentence_an_install_ten_lines_of_python_and_the_picture():
    page = (DOCS / "index.md").read_text(encoding="utf-8")
    code = re.findall(r"```python\n(.*?)```", page, re.S)[0]
    assert len(code.strip().splitlines()) == 10
    assert max(map(len, code.splitlines())) <= 82  # more is cut off on a screen of 1600 px
    names = [node for node in ast.walk(ast.parse(code)) if isinstance(node, ast.Attribute)]
    asked = {name.attr for name in names if isinstance(name.value, ast.Name) and name.value.id == "flownav"}
    assert asked <= set(flownav.__all__)
    places = [page.index(part) for part in ("pip install", "```python", "pictures/landing.svg", "## ")]
    assert places == sorted(places)


def test_gallery_shows_every_picture():
    page = pictures.gallery()
    assert page.count("![") == len(pictures.PICTURES) + 1
    thumbnails = re.findall(r"^- \[!\[[^\]]+\]\(\.\./pictures/([\w-]+\.\w+)\)\]\(\.\./([\w/-]+)\.md\)$", page, re.M)
    assert thumbnails[0] == ("landing.svg", "tutorials/first-landing")
    assert thumbnails[1:] == [(f"{picture.name}.png", picture.page) for picture in pictures.PICTURES]
    style = (DOCS / "assets" / "flownav.css").read_text(encoding="utf-8")
    assert '<div class="flownav-gallery" markdown>' in page
    assert re.search(r"\.flownav-gallery > ul \{\s+display: grid", style)
