"""The documentation's site, `make docs`: the pages of docs/, what is generated from the code, and executed tutorials.

docs/ is copied to out/docs-pages, which mkdocs.yml names; generated pages, remade pictures and the tutorials with
what they printed are written there, so that none of them can be stale and none is committed. Figures that pages name
are filled in from docs/figures.json, and marked where their code has changed since. Then zensical makes the
site in out/docs. A page with a broken link, a generator that fails and a tutorial whose cell raises fail the build.
`--quick` takes the pictures as they are committed and leaves the tutorials unexecuted: their pages have words and code.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import cells
import figures_book
import figures_history
import figures_pages
import notebooks
import pictures
import ziamath
from fontTools.ttLib import TTFont
from plotly.offline import get_plotlyjs
from reference import PAGES

PROJECT = Path(__file__).parents[2]
SOURCE, BUILT = PROJECT / "docs", PROJECT / "out" / "docs-pages"


def main(quick: bool) -> None:
    """Build the site.

    Raises RuntimeError where a tutorial fails, ValueError where a page names a figure that is unknown, SystemExit with
    zensical's status where that fails.
    """
    shutil.rmtree(BUILT, ignore_errors=True)
    shutil.copytree(SOURCE, BUILT, ignore=shutil.ignore_patterns("*.py", "__pycache__", figures_book.BOOK.name))
    fill_figures(BUILT)
    assets(BUILT / "assets")
    for name, generate in PAGES.items():
        (BUILT / name).parent.mkdir(parents=True, exist_ok=True)
        (BUILT / name).write_text(generate(), encoding="utf-8")
    if not quick:
        pictures.draw_all(BUILT / "pictures", [])
    write_tutorials(BUILT, quick)
    sys.exit(site())


def fill_figures(folder: Path) -> None:
    """Figures in place of their names. ValueError where a name is unknown; a line where a commit is."""
    book = figures_book.read()
    figures_pages.fill_folder(folder, book, figures_history.stale)
    if unknown := figures_history.unknown(book.runs.values()):
        print(f"figures of commits that this clone does not have are not marked: {', '.join(unknown)}", file=sys.stderr)


def assets(folder: Path) -> None:
    """The font of the equations and Plotly's script, from the packages that bear them: the site needs no network."""
    font = TTFont(Path(ziamath.__file__).parent / "fonts" / "STIXTwoMath-Regular.ttf")
    font.flavor = "woff"
    font.save(folder / "STIXTwoMath.woff")
    (folder / "plotly.min.js").write_text(get_plotlyjs(), encoding="utf-8")


def write_tutorials(folder: Path, quick: bool) -> None:
    """Each tutorial's page, with what its cells printed unless in a hurry. Raises RuntimeError where one fails."""
    scripts = notebooks.tutorials()
    ran = {script: notebooks.read(script) for script in scripts} if quick else notebooks.run_all(scripts)
    for script, notebook in ran.items():
        place = folder / script.parent.name
        place.mkdir(exist_ok=True)
        (place / f"{script.stem}.md").write_text(cells.page(notebook, script.stem, place), encoding="utf-8")


def site() -> int:
    """Run zensical, which finds the extension `mathematics` beside this file; its exit status."""
    surroundings = {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path])}
    zensical = Path(sys.executable).parent / "zensical"
    order = [str(zensical), "build", "--clean", "--strict", "--config-file", "mkdocs.yml"]
    return subprocess.run(order, cwd=PROJECT, env=surroundings, check=False).returncode


if __name__ == "__main__":
    try:
        main("--quick" in sys.argv[1:])
    except (RuntimeError, ValueError) as error:
        sys.exit(f"make docs: {error}")
