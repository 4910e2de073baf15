"""Help of a command whose options are too many for one list: in groups, with examples."""

from collections.abc import Mapping, Sequence
from typing import Any

from typer.core import TyperCommand

OTHERS = "Other options"


def grouped(groups: Mapping[str, Sequence[str]], examples: Sequence[tuple[str, str]]) -> type[TyperCommand]:
    """A command's class. groups: titles, and the names of the parameters of each; those of no group stand last.

    examples: what each is for, and what is typed.
    """

    class Grouped(TyperCommand):
        """The command."""

        def format_options(self, ctx: Any, formatter: Any) -> None:
            """Arguments and options."""
            left = {param.name: param.get_help_record(ctx) for param in self.get_params(ctx)}
            titled = {title: [left.pop(name) for name in names] for title, names in groups.items()}
            for title, rows in (titled | {OTHERS: list(left.values())}).items():
                with formatter.section(title):
                    formatter.write_dl([row for row in rows if row is not None])

        def format_epilog(self, ctx: Any, formatter: Any) -> None:
            """The examples."""
            with formatter.section("Examples"):
                for what, typed in examples:
                    formatter.write_text(f"{what}:")
                    formatter.write(f"{'':{formatter.current_indent + 2}}{typed}\n")

    return Grouped
