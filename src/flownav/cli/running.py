"""How the command line runs and ends: exit statuses, one line for a mistake, compilation announced."""

from __future__ import annotations

import io
import sys

import typer

from flownav.core.compiling.progress import announce_compilation
from flownav.core.errors import FlownavError, InputError
from flownav.core.guard import a_run
from flownav.core.version import __version__

DONE, BAD_VERDICT, BAD_INPUT = 0, 1, 2  # Ctrl-C: 130, as shells have it


def run(app: typer.Typer) -> None:
    """Run a command and leave with its exit status."""
    for stream in (sys.stdout, sys.stderr):  # names of files are bytes, and need not be text
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    try:
        with a_run(), announce_compilation("flownav", throughout=True):
            status = app(prog_name="flownav", standalone_mode=False)
    except FlownavError as error:
        _leave(str(error), BAD_INPUT if isinstance(error, InputError) else BAD_VERDICT)
    except typer.TyperException as error:
        if not hasattr(error, "format_message"):
            raise
        _leave_usage(error)
    except typer.Abort:
        _leave("broken off", BAD_VERDICT)
    except OSError as error:  # a disk that is full, a file that went away
        _leave(f"{error.filename or 'a file'}: {error.strerror or error}", BAD_INPUT)
    sys.exit(status if isinstance(status, int) else DONE)


def say_version(asked: bool) -> None:
    """The version, and nothing else is done."""
    if asked:
        typer.echo(f"flownav {__version__}")
        raise typer.Exit


def _leave_usage(error: typer.TyperException) -> None:
    """What was typed cannot be: one line, and where to read what can."""
    context = getattr(error, "ctx", None)
    command = context.command_path if context is not None else "flownav"
    message = error.format_message().replace("\n", " ").strip()
    if not message or type(error).__name__ == "NoArgsIsHelpError":
        typer.echo(context.get_help() if context is not None else "", err=True)
        sys.exit(BAD_INPUT)
    _leave(f"{message.rstrip('.')}; `{command} --help` lists what can be given", BAD_INPUT)


def _leave(message: str, status: int) -> None:
    print(f"flownav: {message}", file=sys.stderr)
    sys.exit(status)
