"""Equations in pages become MathML."""

from __future__ import annotations

import markdown
import pytest

from docs_tools import mathematics
from places import DOCS


def _page(text):
    extensions = ["pymdownx.arithmatex", mathematics.MathematicsExtension()]
    return markdown.markdown(text, extensions=extensions, extension_configs={"pymdownx.arithmatex": {"generic": True}})


def test_an_equation_in_a_line_and_one_by_itself():
    page = _page("speed $v_{x}$\n\n$$\n\\frac{a}{b}\n$$\n")
    assert page.count("<math") == 2
    assert "<msub>" in page
    assert "<mfrac>" in page
    assert 'display="block"' in page


def test_code_and_prices_are_no_equations():
    assert "<math" not in _page("`$HOME` costs $5 or $6")


def test_signs_of_html_in_an_equation():
    assert "<mo>&#x0003C;</mo>" in _page("$a < b$")


@pytest.mark.parametrize(
    ("equation", "said"), [("x^{2}^{3}", "no LaTeX"), ("\\left( x", "no LaTeX"), ("\\bfr{x}", r"does not know \\bfr")]
)
def test_what_is_no_latex_names_itself(equation, said):
    with pytest.raises(ValueError, match=said):
        _page(f"${equation}$")


@pytest.mark.parametrize("page", sorted(DOCS.rglob("*.md")), ids=lambda page: page.stem)
def test_every_equation_of_every_page_is_typeset(page):
    assert 'arithmatex">\\' not in _page(page.read_text(encoding="utf-8"))
