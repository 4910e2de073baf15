"""Find words that the house does not use, in its sentences and in its names: `python tools/words.py [--count] [ROOT]`.

Sentences are docstrings, comments and messages (strings with a space) of `src` and `tools`, docstrings of `tests`, and
the pages. Names are those of `src`. Each finding is a line `file:line: word -> suggestion`; `tools/words_allowed.txt`
lists what may stay. The glossary in ARCHITECTURE.md says which word is used for what.
"""

from __future__ import annotations

import argparse
import ast
import io
import re
import sys
import tokenize
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ALLOWED = "tools/words_allowed.txt"
BANNED = {  # in sentences; a suggestion each
    "told": "given, stated, known to",
    "untold": "unstated",
    "heard": "received",
    "unheard": "not received",
    "said": "stated, reported, named",
    "unsaid": "undetected, without a warning",
    "handed": "passed, given",
    "spelled": "written",
    "flown on": "used by the autopilot",
    "so many": "the number of",
    "what is told": "name the thing",
    "came of it": "the result, the summary",
    "comes of it": "the result, the summary",
    "nobody is told": "name who does not know it",
}
OPENING = "What"
BANNED_IN_NAMES = (
    "told",
    "untold",
    "heard",
    "unheard",
    "said",
    "unsaid",
    "handed",
    "spelled",
    "remembered",
    "taught",
    "seeing",
    "failing",
)
PAGES = ("README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md")
_WORDS = re.compile(
    r"(?<!-)\b(" + "|".join(sorted(map(re.escape, BANNED), key=len, reverse=True)) + r")\b", re.IGNORECASE
)
_CODE = re.compile(r"`[^`]*`|\]\([^)]*\)")
_PARTS = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])")


class Finding(NamedTuple):
    """A banned word in a line of a file."""

    file: str
    line: int
    word: str
    suggestion: str
    text: str

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.word} -> {self.suggestion}"


class Allowed(NamedTuple):
    """A line of the list of exceptions: a word that may stand in a file where the line holds this text."""

    word: str
    file: str
    text: str

    def covers(self, found: Finding) -> bool:
        """Whether this exception is for that finding; `*` stands for every file."""
        return found.word == self.word and self.file in ("*", found.file) and self.text in found.text


def in_sentence(text: str, file: str, first_line: int, *, docstring: bool = False) -> Iterator[Finding]:
    """The banned words of a piece of prose; names in backquotes and targets of links are no prose."""
    lines = _CODE.sub(lambda code: re.sub(r"[^\n]", " ", code[0]), text).split("\n")
    shown = text.split("\n")
    if docstring and re.match(rf"\s*{OPENING}\b", lines[0]):
        yield Finding(file, first_line, OPENING, "begin with the thing itself", shown[0])
    for offset, line in enumerate(lines):
        for match in _WORDS.finditer(line):
            word = match[0].lower()
            yield Finding(file, first_line + offset, word, BANNED[word], shown[offset])


def in_docstrings(tree: ast.Module, file: str) -> Iterator[Finding]:
    """The banned words of every docstring of a module."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            text = _docstring(node)
            if text is not None:
                yield from in_sentence(text.value, file, text.lineno, docstring=True)


def in_messages(tree: ast.Module, file: str) -> Iterator[Finding]:
    """The banned words of every string with a space that is no docstring."""
    documented = {id(_docstring(node)) for node in ast.walk(tree) if hasattr(node, "body")}
    for node in ast.walk(tree):
        message = isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in documented
        if message and " " in node.value.strip():
            yield from in_sentence(node.value, file, node.lineno)


def in_comments(source: str, file: str) -> Iterator[Finding]:
    """The banned words of every comment."""
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            yield from in_sentence(token.string, file, token.start[0])


def in_names(source: str, file: str) -> Iterator[Finding]:
    """The names of a module that hold a banned word."""
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.NAME:
            for part in _PARTS.findall(token.string):
                if part.lower() in BANNED_IN_NAMES:
                    yield Finding(file, token.start[0], part.lower(), f"rename {token.string}", token.line.rstrip("\n"))


def in_page(text: str, file: str) -> Iterator[Finding]:
    """The banned words of a page; of the changelog, those of what is not released."""
    if Path(file).name == "CHANGELOG.md":
        text = re.split(r"(?m)^## (?!.*unreleased)", text)[0]
    text = re.sub(r"(?ms)^```.*?^```", lambda code: re.sub(r"[^\n]", " ", code[0]), text)
    yield from in_sentence(text, file, 1)


def _docstring(node: ast.AST) -> ast.Constant | None:
    first = next(iter(getattr(node, "body", ()) if isinstance(getattr(node, "body", ()), list) else ()), None)
    value = first.value if isinstance(first, ast.Expr) else None
    return value if isinstance(value, ast.Constant) and isinstance(value.value, str) else None


def in_module(source: str, file: str) -> Iterator[Finding]:
    """Findings of a Python file; which words are searched for depends on where it lies."""
    tree = ast.parse(source)
    yield from in_docstrings(tree, file)
    if file.startswith("tests/"):
        return
    yield from in_messages(tree, file)
    yield from in_comments(source, file)
    if file.startswith("src/"):
        yield from in_names(source, file)


def findings(root: Path) -> list[Finding]:
    """Everything below a folder that is not allowed, in the order of files and lines."""
    allowed = exceptions(root)
    modules = [path for part in ("src", "tools", "tests") for path in sorted((root / part).rglob("*.py"))]
    pages = [root / page for page in PAGES if (root / page).exists()] + sorted((root / "docs").rglob("*.md"))
    found: list[Finding] = []
    for path in (*modules, *pages):
        file, text = path.relative_to(root).as_posix(), path.read_text(encoding="utf-8")
        each = in_module(text, file) if path.suffix == ".py" else in_page(text, file)
        found += sorted(one for one in each if not any(entry.covers(one) for entry in allowed))
    return found


def exceptions(root: Path) -> list[Allowed]:
    """The list of exceptions: `word | file or * | text of the line`, a line each; # begins a remark."""
    path = root / ALLOWED
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    return [
        Allowed(*(part.strip() for part in line.split("|", 2))) for line in lines if line.strip() and line[0] != "#"
    ]


def main(arguments: list[str] | None = None) -> int:
    """Print the findings, or with --count how often each word stands there; 1 where there is any."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("root", nargs="?", type=Path, default=Path(__file__).resolve().parent.parent)
    parser.add_argument("--count", action="store_true", help="print how often each word stands there")
    asked = parser.parse_args(arguments)
    found = findings(asked.root)
    if asked.count:
        for word, count in Counter(one.word for one in found).most_common():
            print(f"{count:6d} {word}")
        print(f"{len(found):6d} in {len({one.file for one in found})} files")
    else:
        print(*found, sep="\n", end="\n" if found else "")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
