"""Pictures of the documentation: each is drawn by a function, lies in its place, and is shown by its page."""

from __future__ import annotations

import matplotlib.pyplot as plt
import pytest
from drawing import Picture, save

from docs_tools import pictures, readme_picture
from places import DOCS, PROJECT

MADE_OTHERWISE = {"certificate", "landing", "rerun"}  # photographs of pages and of a viewer


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

    first = save(Picture("line", "", "A line.", line), tmp_path).read_bytes()
    assert first.startswith(b"\x89PNG")
    assert save(Picture("line", "", "A line.", line), tmp_path).read_bytes() == first
    assert b"Software" not in first


def test_the_readmes_picture_is_of_the_command_that_it_names():
    command = readme_picture.command()
    assert command[0] == "fly"
    assert f"`flownav {' '.join(command)}`" in (PROJECT / "README.md").read_text(encoding="utf-8")


def test_gallery_shows_every_picture():
    page = pictures.gallery()
    assert page.count("![") == len(pictures.PICTURES)
