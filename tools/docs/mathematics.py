"""Equations of the pages, `$...$` and `$$...$$`, as MathML: browsers typeset it themselves, without scripts or network.

A Markdown extension. `pymdownx.arithmatex` finds the equations; what it leaves in the page is turned into MathML here.
"""

from __future__ import annotations

import html
import re

from latex2mathml.converter import convert
from markdown import Markdown
from markdown.extensions import Extension
from markdown.postprocessors import Postprocessor

FOUND = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)
UNKNOWN = re.compile(r">\s*(\\[A-Za-z]+)")  # a command that is left as it is


def typeset(page: str) -> str:
    """The HTML of a page with every equation that arithmatex marked as MathML."""
    return FOUND.sub(_marked, page)


def _marked(found: re.Match[str]) -> str:
    """The MathML of a match that arithmatex marked, in the same element, so that a style can let a long equation
    scroll.
    """
    return f'<{found[1]} class="arithmatex">{_mathml(found[3], "block" if found[2] == "[" else "inline")}</{found[1]}>'


def _mathml(latex: str, display: str) -> str:
    """One equation as MathML in which its LaTeX is kept for who copies it. Raises ValueError where it is no LaTeX."""
    source = html.unescape(latex).strip()
    try:
        written: str = convert(source, display=display)
    except Exception as error:
        raise ValueError(f"this is no LaTeX that latex2mathml reads ({type(error).__name__}): {source}") from error
    if unknown := UNKNOWN.search(written):
        raise ValueError(f"latex2mathml does not know {unknown[1]}: {source}")
    return written


class _Typeset(Postprocessor):
    def run(self, text: str) -> str:
        """Last of all, when arithmatex has put its spans back."""
        return typeset(text)


class MathematicsExtension(Extension):
    """`- mathematics` in mkdocs.yml, below `pymdownx.arithmatex` with `generic: true`."""

    def extendMarkdown(self, md: Markdown) -> None:
        """Enter the step that comes after all others."""
        md.postprocessors.register(_Typeset(md), "mathematics", -10)


def makeExtension(**settings: object) -> MathematicsExtension:
    """The extension, for Python-Markdown."""
    return MathematicsExtension(**settings)
