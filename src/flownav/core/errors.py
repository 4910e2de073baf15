"""The errors a user can cause, each one line: what is wrong, where, and what to do."""

import re
from collections.abc import Callable

# around an argument's name in a message; Unicode keeps them for a program's own use, so that no text of a user has them
BEGIN, END = "\ufdd0", "\ufdd1"
MOST_LETTERS = 2000  # of a message: chosen; the longest that says something, a list of all settings, has 1900
# a name in a message may hold a new line, or what moves a terminal's cursor
CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029]")
ARGUMENT = re.compile(f"{BEGIN}(\\w+){END}")


def arg(name: str) -> str:
    """The name of an argument for a message, marked: Python calls it by its name, the command line by its option."""
    return f"{BEGIN}{name}{END}"


class FlownavError(Exception):
    """Base of every error that flownav raises on purpose; the command line prints its one line.

    marked: the message with the marks of `arg`; as text the error names arguments as Python does.
    """

    def __init__(self, marked: object = "") -> None:
        text = CONTROL.sub(lambda found: repr(found[0])[1:-1], str(marked))
        middle = MOST_LETTERS // 2
        self.marked = text if len(text) <= MOST_LETTERS else f"{text[:middle]} ... {text[-middle:]}"
        super().__init__(self.naming(str))

    def naming(self, called: Callable[[str], str]) -> str:
        """The message with its arguments as somebody else calls them."""
        return ARGUMENT.sub(lambda found: called(found[1]), self.marked)


class InputError(FlownavError):
    """Bad input (a file, an argument, a log): the command line exits with status 2."""


class VerdictError(FlownavError):
    """The job ran and its verdict is bad: the command line exits with status 1."""
