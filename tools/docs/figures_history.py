"""Whether code has changed since a commit, as git knows it. Without git, or of an unknown commit, nobody can say.

Comments and docstrings are no code: a commit that changes only words leaves figures as they are.
"""

from __future__ import annotations

import ast
import subprocess
from collections.abc import Iterable
from functools import cache
from pathlib import Path

from figures_book import Run

PROJECT = Path(__file__).parents[2]


def stale(run: Run) -> bool:
    """Whether code that the run's figures depend on differs from that of its commit. False where git does not know."""
    return bool(changed_since(run.commit, run.depends))


@cache
def changed_since(commit: str, paths: tuple[str, ...], folder: Path = PROJECT) -> str | None:
    """A file below these paths whose code is not that of the commit, empty where there is none; None without git."""
    listed = git(folder, "diff", "--name-only", "--no-renames", commit, "HEAD", "--", *paths)
    if listed is None:
        return None
    return next((name for name in listed.splitlines() if _differs(commit, name, folder)), "")


def _differs(commit: str, name: str, folder: Path) -> bool:
    texts = [git(folder, "show", f"{at}:{name}") for at in (commit, "HEAD")]
    if not name.endswith(".py") or None in texts:
        return True
    return len({_code(text) for text in texts if text is not None}) > 1


def _code(text: str) -> str:
    """The program of a module, without comments and docstrings."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            node.body = node.body[ast.get_docstring(node, clean=False) is not None :]
    return ast.dump(tree)


def unknown(runs: Iterable[Run], folder: Path = PROJECT) -> list[str]:
    """The commits of runs that this clone does not have, as after a squash; none without git."""
    if git(folder, "rev-parse", "HEAD") is None:
        return []
    commits = sorted({run.commit for run in runs})
    return [each for each in commits if git(folder, "cat-file", "-e", f"{each}^{{commit}}") is None]


def uncommitted(paths: tuple[str, ...], folder: Path = PROJECT) -> list[str]:
    """The files below these paths that differ from the last commit."""
    return [line[3:] for line in (git(folder, "status", "--porcelain", "--", *paths) or "").splitlines()]


def last_change(paths: tuple[str, ...], folder: Path = PROJECT) -> str | None:
    """The last commit that changed one of these paths: that of the code which stands there. None without git."""
    return git(folder, "log", "-1", "--format=%h", "--abbrev=8", "--", *paths)


def git(folder: Path, *arguments: str) -> str | None:
    """Output of git; None where it fails, is not there, or where the folder is not the project's own clone."""
    if not (folder / ".git").exists():
        return None
    try:
        done = subprocess.run(["git", *arguments], cwd=folder, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return done.stdout.rstrip("\n")
