"""The tutorials: scripts with cells (docs/tutorials/*.py, docs/how-to/*.py, Jupytext's percent format), run in order.

Each runs in a fresh interpreter and in an empty folder of its own. A cell that raises fails the build, with the
tutorial, the cell and the error. Run as a script, it writes the executed notebooks: `notebooks.py FOLDER [NAME...]`.
"""

from __future__ import annotations

import os
import re
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import jupytext
import nbformat
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError

PROJECT = Path(__file__).parents[2]
DOCS = PROJECT / "docs"
CELL_LIMIT_S = 300
COLOURS = re.compile(r"\x1b\[[0-9;]*m")
# 80 columns fit the page; no colours; what a tutorial draws is a picture, never a window
PLAIN = "import os; os.environ.pop('FORCE_COLOR', None); os.environ.pop('CLICOLOR_FORCE', None)"  # the kernel sets them
SURROUNDINGS = {
    "COLUMNS": "80",
    "NO_COLOR": "1",
    "TERM": "dumb",
    "MPLBACKEND": "module://matplotlib_inline.backend_inline",
}


def tutorials() -> list[Path]:
    """The script of every tutorial and of every how-to that runs, by folder and name."""
    return sorted(DOCS.glob("*/*.py"))


def read(script: Path) -> nbformat.NotebookNode:
    """A tutorial's cells, not yet run."""
    notebook = jupytext.read(script, fmt="py:percent")
    notebook.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3", "language": "python"}
    return notebook


def run(script: Path) -> nbformat.NotebookNode:
    """A tutorial's cells with what they printed and showed.

    Raises RuntimeError with the tutorial, the cell that failed and its error.
    """
    notebook = read(script)
    began_s = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="flownav-tutorial-") as folder:
        client = NotebookClient(
            notebook, timeout=CELL_LIMIT_S, startup_timeout=CELL_LIMIT_S, iopub_timeout=CELL_LIMIT_S,
            resources={"metadata": {"path": folder}},
        )  # fmt: skip
        client.extra_arguments = [f"--IPKernelApp.exec_lines={PLAIN}", "--log-level=ERROR"]
        try:
            client.execute(env=_surroundings())
        except CellExecutionError as error:
            raise RuntimeError(failure(script, notebook, str(error))) from None
    print(f"{script.stem}: {time.monotonic() - began_s:.0f} s", flush=True)
    return notebook


def failure(script: Path, notebook: nbformat.NotebookNode, error: str) -> str:
    """The tutorial, the number of its first cell that raised (from 1, counting all cells), and the error."""
    for number, cell in enumerate(notebook.cells, 1):
        if any(output.output_type == "error" for output in cell.get("outputs", ())):
            return f"{script.name}: cell {number} failed\n{COLOURS.sub('', error)}"
    return f"{script.name}: {COLOURS.sub('', error)}"


def run_all(scripts: list[Path]) -> dict[Path, nbformat.NotebookNode]:
    """Every script run, two at a time where there are two cores. Raises RuntimeError as `run`."""
    with ProcessPoolExecutor(max_workers=min(2, os.cpu_count() or 1)) as pool:
        return dict(zip(scripts, pool.map(run, scripts), strict=True))


def _surroundings() -> dict[str, str]:
    """The environment of a tutorial: `flownav` is the one of this interpreter."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    return {**os.environ, **SURROUNDINGS, "PATH": path}


def main(folder: Path, names: list[str]) -> None:
    """Write the executed notebooks of the named tutorials, or of all, into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    scripts = [script for script in tutorials() if not names or script.stem in names]
    for script, notebook in run_all(scripts).items():
        nbformat.write(notebook, folder / f"{script.stem}.ipynb")


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
