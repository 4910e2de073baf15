"""The tutorial on the page: its pictures are those that a walk through the pages takes, and the walk works."""

from __future__ import annotations

import re

import pytest

from docs_tools import app_pictures
from places import DOCS

TUTORIAL = (DOCS / "tutorials" / "without-typing.md").read_text(encoding="utf-8")


def test_every_picture_of_the_tutorial_is_there():
    shown = re.findall(r"\]\(\.\./pictures/(app-[\w-]+)\.png\)", TUTORIAL)
    assert sorted(shown) == sorted(path.stem for path in (DOCS / "pictures").glob("app-*.png"))


@pytest.mark.slow
@pytest.mark.browser
def test_the_tutorial_is_walked_through_and_photographed(tmp_path):
    pytest.importorskip("playwright.sync_api", reason="install `playwright` (dependency group `test`)")
    taken = app_pictures.take_all(tmp_path, 390, dark=True)
    assert set(re.findall(r"\]\(\.\./pictures/(app-[\w-]+)\.png\)", TUTORIAL)) <= set(taken)
