"""The errors a user can cause, each one line: what is wrong, where, and what to do."""


class FlownavError(Exception):
    """Base of every error that flownav raises on purpose; the command line prints its one line."""


class InputError(FlownavError):
    """Bad input (a file, an option, a log): the command line exits with status 2."""


class VerdictError(FlownavError):
    """The job ran and its verdict is bad: the command line exits with status 1."""
