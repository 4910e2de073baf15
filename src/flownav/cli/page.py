"""`flownav app`: a page on this machine for who does not type."""

from __future__ import annotations

import sys
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from flownav.cli import options
from flownav.cli.options import option, switch
from flownav.cli.output import emit

FOLDER = "The folder of logs and results, made if it is not there."
PORT = "The port on this machine."
WORKER = (sys.executable, "-m", "flownav.cli.page_worker")


def command(
    folder: Annotated[Path, option("DIR", FOLDER)] = Path("out/app"),
    port: Annotated[int, option("N", PORT, unset="a free one", within=(0, 65535))] = 0,
    browser: Annotated[bool, switch("Open the page in the browser.", "--browser/--no-browser")] = True,
    as_json: options.Json = False,
) -> None:
    """A page for who does not type: logs, GPS cuts, flights, campaigns, certificates. Ctrl-C ends it.

    Nothing leaves this machine, and only its own browser can open the page, at the address with the token.
    """
    from flownav.app.server import serve

    def begun(address: str) -> None:
        if as_json:
            emit({"address": address, "folder": str(folder)})
        else:
            typer.echo(f"The page: {address}\nIts files: {folder} (Ctrl-C ends it)")
        sys.stdout.flush()
        if browser:
            import webbrowser

            webbrowser.open(address)

    with suppress(KeyboardInterrupt):
        serve(folder, port, WORKER, begun)
