"""Runs the commands whose figures pages name, `make figures`, and writes docs/figures.json and the README's figures.

`make figures ONLY=league` runs one producer of `figures_table.py`, `ONLY=outages,indoor` some, `ONLY=readme` those that
the README names. Without ONLY everything runs, which takes hours: for a release. The code that a figure depends on must
be committed, since the figure is noted with that commit. What has run is kept where another fails.
"""

from __future__ import annotations

import json
import os
import platform
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import figures_book
import figures_history as history
import figures_pages as pages
from figures_book import Book, Figure, Run
from figures_table import DATA, PRODUCERS, Producer, at, interval_at

PROJECT = Path(__file__).parents[2]
README = PROJECT / "README.md"


def chosen(only: str, readme: str) -> list[str]:
    """The producers that ONLY names; all of them where it is empty. ValueError where one is unknown."""
    names: dict[str, None] = {}
    for word in filter(None, only.split(",")):
        names |= dict.fromkeys(_of_readme(readme) if word == "readme" else [word])
    if unknown := [name for name in names if name not in PRODUCERS]:
        raise ValueError(f"no figures {', '.join(unknown)}; choose from readme, {', '.join(PRODUCERS)}")
    return list(names) or list(PRODUCERS)


def _of_readme(text: str) -> list[str]:
    return sorted({found[1].partition(".")[0] for found in pages.IN_README.finditer(text)})


def measure(name: str, producer: Producer, book: Book, commit: str, typed: Callable[[str], str]) -> None:
    """Run a producer and put what it prints into the book, with a digit more than pages show.

    `typed` runs a command line and returns what it prints. LookupError where a figure is not in it.
    """
    line = producer.command if producer.page else f"{producer.command} --json"
    out = typed(line)
    printed: Any = None if producer.page else json.loads(out)
    found = {
        f"{name}.{key}": Figure(round(float(at(printed, read.path)), read.decimals + 1), read.unit, read.decimals, name,
                                interval_at(printed, read.interval))
        for key, read in producer.figures.items()
    }  # fmt: skip
    book.runs[name] = Run(producer.command, commit, f"{datetime.now(UTC):%Y-%m-%d}", machine(), producer.depends,
                          producer.page)  # fmt: skip
    book.figures.update(found)


def machine() -> str:
    """The cores and the kind of the processor."""
    return f"{os.cpu_count()} cores, {platform.machine()}"


def run(line: str) -> str:
    """Output of a command, with the logs of $FLOWNAV_DATA. RuntimeError where it fails; flownav's 1 is a verdict."""
    words = [word.replace(DATA, os.environ.get("FLOWNAV_DATA", DATA)) for word in shlex.split(line)]
    first = {"flownav": [sys.executable, "-m", "flownav"], "python": [sys.executable]}.get(words[0], words[:1])
    done = subprocess.run([*first, *words[1:]], cwd=PROJECT, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode not in ((0, 1) if words[0] == "flownav" else (0,)):
        raise RuntimeError(f"`{line}` ended with status {done.returncode}")
    return done.stdout


def main(names: Iterable[str]) -> int:
    """Measure, write the book after each producer, and the README; the exit status, 1 where one failed.

    ValueError where there is no git, or code that is not committed.
    """
    book, failed = figures_book.read(), 0
    for name in names:
        producer = PRODUCERS[name]
        commit = history.last_change(producer.depends)
        if not commit:
            raise ValueError("figures are noted with the commit of their code: run this in a clone, with git")
        if changed := history.uncommitted(producer.depends):
            raise ValueError(f"{name}: commit {', '.join(changed[:3])} first, a figure is noted with its code's commit")
        print(f"figures: {name}: {producer.command}", file=sys.stderr)
        try:
            measure(name, producer, book, commit, run)
        except (RuntimeError, LookupError, ValueError) as error:
            print(f"figures: {name}: {error}", file=sys.stderr)
            failed = 1
            continue
        figures_book.write(book)
    README.write_text(pages.readme(README.read_text(encoding="utf-8"), book), encoding="utf-8")
    return failed


if __name__ == "__main__":
    try:
        only = sys.argv[1] if len(sys.argv) > 1 else ""
        sys.exit(main(chosen(only, README.read_text(encoding="utf-8"))))
    except ValueError as error:
        sys.exit(f"make figures: {error}")
