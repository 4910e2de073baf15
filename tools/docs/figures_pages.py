"""Figures in pages: names become values, and values that are older than their code are marked.

In pages of docs/, `{{ figure NAME }}` becomes a value with its unit; `{{ figure NAME interval }}` has its interval too,
`{{ figure NAME bare }}` has no unit, and `{{ figure NAME size }}` has two digits, for prose. The README has name and
value, since it is read as it lies: `<!-- figure NAME -->0.03 m<!-- end -->`.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from figures_book import FORMS, Book, Run

NAMED = re.compile(r"\{\{ *figure +([^ }]+) *([a-z]*) *\}\}")
IN_README = re.compile(r"<!-- figure ([^ ]+) ?([a-z]*) -->(.*?)<!-- end -->", re.DOTALL)
MARK = "†"
LEGEND = f"{MARK} Measured before the code that it depends on last changed."
Stale = Callable[[Run], bool]


def filled(text: str, book: Book, stale: Stale, page: str) -> str:
    """A page with the values of the figures that it names, and its tables' origin below its title.

    ValueError, in one line with the page, where a name is unknown.
    """
    marked = False

    def value(found: re.Match[str]) -> str:
        nonlocal marked
        shown, run = _shown(found[1], found[2], book, page)
        old = stale(run)
        marked |= old
        return shown + MARK * old

    shown = NAMED.sub(value, text)
    printed = origin(book, stale, page)
    if printed:
        title, _, rest = shown.partition("\n")
        shown = f"{title}\n\n{printed}\n{rest}"
    return f"{shown.rstrip()}\n\n{LEGEND}\n" if marked or MARK in printed else shown


def origin(book: Book, stale: Stale, page: str) -> str:
    """A sentence on each command that wrote the page's tables; empty for other pages."""
    printed = [run for _, run in sorted(book.runs.items()) if run.page == page]
    return " ".join(
        f"*Printed by `{run.command}` on the code of commit {run.commit} ({run.date}).*{MARK * stale(run)}"
        for run in printed
    )


def readme(text: str, book: Book) -> str:
    """The README with the present values between its marks. ValueError where a name is unknown."""

    def value(found: re.Match[str]) -> str:
        form = f" {found[2]}" * bool(found[2])
        return f"<!-- figure {found[1]}{form} -->{_shown(found[1], found[2], book, 'README.md')[0]}<!-- end -->"

    return IN_README.sub(value, text)


def named_in(folder: Path, readme_text: str) -> set[str]:
    """The names of all figures in a folder's pages and in the README."""
    pages = [path.read_text(encoding="utf-8") for path in sorted(folder.rglob("*.md"))]
    found = {each[1] for page in pages for each in NAMED.finditer(page)}
    return found | {each[1] for each in IN_README.finditer(readme_text)}


def fill_folder(folder: Path, book: Book, stale: Stale) -> None:
    """Fill every page of a folder in. ValueError where a name is unknown."""
    for path in sorted(folder.rglob("*.md")):
        text = path.read_text(encoding="utf-8")
        page = path.relative_to(folder).as_posix()
        path.write_text(filled(text, book, stale, page), encoding="utf-8")


def _shown(name: str, form: str, book: Book, page: str) -> tuple[str, Run]:
    if name not in book.figures:
        raise ValueError(f"{page}: no figure {name} in docs/figures.json; `make figures` prints those of a table there")
    if form not in FORMS:
        raise ValueError(f"{page}: figure {name}: no form {form}; choose from {', '.join(FORMS[1:])}")
    figure = book.figures[name]
    return figure.text(form), book.runs[figure.run]
