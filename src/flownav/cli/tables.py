"""Tables for people, each described once: a column is its title, its key in the row, and how its figure is written."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from flownav.cli.output import emit

if TYPE_CHECKING:
    from rich.table import Table

Row = Mapping[str, Any]


class Column(NamedTuple):
    """A column of a table whose rows are facts, as the JSON object has them.

    key: of the fact, or what makes the cell of a row. form: how a number is written; scale: times what it is.
    """

    title: str
    key: str | Callable[[Any], str]
    form: str = ""
    scale: float = 1.0

    def cell(self, row: Any) -> str:
        """The text of a row's cell."""
        return self.key(row) if callable(self.key) else figure(row[self.key], self.form, self.scale)


def figure(value: Any, form: str = ".2f", scale: float = 1.0) -> str:
    """A figure as tables have it: a dash where there is none, words as they are."""
    if value is None:
        return "-"
    return value if isinstance(value, str) else f"{value if scale == 1.0 else scale * value:{form}}"


def with_ends(value: float | None, ends: Iterable[float | None], join: str = "-", form: str = ".3f") -> str:
    """A figure with its interval in brackets; a dash where there is none, a question mark for an open end."""
    if value is None:
        return "-"
    return f"{value:{form}} ({join.join('?' if end is None else f'{end:{form}}' for end in ends)})"


def table(
    heads: Sequence[str], rows: Iterable[Sequence[str]] = (), *, left: int | None = None, fixed: int = 0, **look: Any
) -> Table:
    """A table. left: how many columns stand to the left, the others to the right (None: all); fixed: never broken."""
    from rich.table import Table

    made = Table(**look)
    for k, head in enumerate(heads):
        made.add_column(head, justify="left" if left is None or k < left else "right", no_wrap=k < fixed)
    for row in rows:
        made.add_row(*row)
    return made


def table_of(columns: Sequence[Column], rows: Iterable[Any], **look: Any) -> Table:
    """A table of facts by the description of its columns."""
    return table([column.title for column in columns], ([c.cell(row) for c in columns] for row in rows), **look)


def plain_look(*, edge: bool = True) -> dict[str, Any]:
    """A line under the heads and no other; without an edge the columns stand close."""
    from rich.box import SIMPLE_HEAD

    return {"box": SIMPLE_HEAD} | ({} if edge else {"show_edge": False, "padding": (0, 1, 0, 0)})


def say(*things: Any, wide: int = 0, soft: bool = False) -> None:
    """Print tables and lines, in so many columns at least. soft: long lines are not broken."""
    from rich.console import Console

    console = Console(markup=False, highlight=False)
    if wide:
        console.width = max(console.width, wide)
    for thing in things:
        console.print(thing, soft_wrap=soft)


def say_files(written: Mapping[str, Any], names: Iterable[str]) -> None:
    """Where what was written lies, a line a file."""
    for name in names:
        if written.get(name):
            say(f"{name.capitalize()}: {written[name]}", soft=True)


def answer(facts: Mapping[str, Any], as_json: bool, show: Callable[[], object]) -> None:
    """Print the facts as the one JSON object that was asked for, or show them to people."""
    if as_json:
        emit(facts)
    else:
        show()
