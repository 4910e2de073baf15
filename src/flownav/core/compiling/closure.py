"""Dependencies of a kernel's machine code: the source of its module and of all that this module imports.

The stamp of a module is a hash over the parsed sources of its *import closure*, comments and docstrings left out:
a change in a page, in a reader or in a remark compiles nothing. Imports inside functions and under
`TYPE_CHECKING` are not followed: a kernel's code cannot come from them.
"""

import ast
import hashlib
import json
import os
import stat
import sys
import time
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

from flownav.core.files import written_whole

PACKAGE = Path(__file__).parents[2]
LIBRARIES = tuple({sys.prefix, sys.base_prefix, sys.exec_prefix})
INSTALLED = frozenset({"site-packages", "dist-packages"})
OTHERS_WRITE = 0o022  # of group and others, in a mode
OWN_FILE, OWN_FOLDER = 0o600, 0o700  # modes of what is kept, whatever the umask
KEPT_FILES = 2000
START_S = time.time()
# imported by every kernel's module through `flownav.core.compile`, and nothing in machine code comes from them
WITHOUT_CODE = {
    "flownav.core.files",
    "flownav.core.guard",
    *(
        f"flownav.core.compiling.{part}"
        for part in ("beside", "cache", "closure", "declared", "linker", "loaded", "progress", "words")
    ),
}


class Source(NamedTuple):
    """Contribution of one file: a hash of its code, and the modules that it imports when it is imported."""

    digest: str
    imports: tuple[str, ...]


class Sources:
    """The sources of modules, parsed once: what is known of a file's bytes is remembered in a JSON file."""

    def __init__(self, memory: Path) -> None:
        self._memory = memory
        self._known: dict[str, Source] | None = None
        self._learnt = False
        self._stamps: dict[frozenset[str], str | None] = {}
        self._more: dict[str, tuple[str, frozenset[str]]] = {}
        self._seen: dict[str, tuple[tuple[int, int], Source]] = {}

    def extend(self, module: str, more: Iterable[str], reason: str) -> None:
        """From now on a module also contains these others, and the text `said`; in this process only."""
        text, others = self._more.get(module, ("", frozenset()))
        self._more[module] = f"{text} {reason}", others | set(more)
        self._stamps.clear()

    def closure(self, modules: Iterable[str]) -> dict[str, str]:
        """The modules in the import closure of these, each with the hash of its code."""
        found: dict[str, str] = {}
        waiting = list(modules)
        while waiting:
            module = waiting.pop()
            if module in found or module in WITHOUT_CODE:
                continue
            file = source_file(module)
            if file is not None:
                source = self._read(file, module)
                text, more = self._more.get(module, ("", ()))
                found[module] = source.digest + text
                waiting += [*source.imports, *more]
        self._remember()
        return found

    def stamp(self, modules: Iterable[str]) -> str | None:
        """A hash over the import closure of these modules; None where one has no source, or not that of this process.

        A file that was changed after this process began may not be what has been imported.
        """
        wanted = frozenset(modules)
        if wanted not in self._stamps:
            found = self.closure(wanted)
            listing = "\n".join(f"{name} {found[name]}" for name in sorted(found))
            needed = wanted.union(*(more for module, (_, more) in self._more.items() if module in found))
            known = needed <= set(found) and not any(map(_changed_since_start, found))
            self._stamps[wanted] = hashlib.sha256(listing.encode()).hexdigest() if known else None
        return self._stamps[wanted]

    def _read(self, file: Path, module: str) -> Source:
        """Contribution of a module's file; it is read again when it has changed."""
        status = os.stat(file)
        state = status.st_mtime_ns, status.st_size
        if self._seen.get(module, (None,))[0] != state:
            self._seen[module] = state, self._parsed(file, module)
        return self._seen[module][1]

    def _parsed(self, file: Path, module: str) -> Source:
        content = file.read_bytes()
        key = hashlib.sha256(f"{module} {file.name} ".encode() + content).hexdigest()[:32]
        if self._known is None:
            self._known = _recalled(self._memory)
        if key not in self._known:
            self._known[key] = parse_source(content, module, file.name == "__init__.py")
            self._learnt = True
        return self._known[key]

    def _remember(self) -> None:
        """Keep what was learnt; where that cannot be, the next process parses again."""
        if not self._learnt or self._known is None:
            return
        self._learnt = False
        newest = list(self._known.items())[-KEPT_FILES:]
        try:
            if distrusted_folder(self._memory.parent, sticky=True):
                return
            with written_whole(self._memory) as file:
                file.touch(OWN_FILE)
                file.write_text(json.dumps(dict(newest)), encoding="utf-8")
        except OSError:
            pass


def _recalled(memory: Path) -> dict[str, Source]:
    """Sources that an earlier process has written; empty where the file is missing or damaged."""
    try:
        if distrusted_folder(memory.parent, sticky=True) or distrusted(memory.stat()):  # who opens a FIFO waits
            return {}
        with memory.open("rb") as file:
            if distrusted(os.fstat(file.fileno())):  # another file may have taken its name meanwhile
                return {}
            entries = json.loads(file.read())
        return {key: Source(str(digest), tuple(map(str, imports))) for key, (digest, imports) in entries.items()}
    except (OSError, ValueError, TypeError, AttributeError):
        return {}


def distrusted(status: os.stat_result) -> str:
    """Why somebody other than this user and root could put anything into a file or a folder; "" where nobody could."""
    if not hasattr(os, "geteuid"):
        return ""
    if status.st_uid not in (0, os.geteuid()):
        return "it belongs to another user"
    return "others may write to it: `chmod -R go-w`" if status.st_mode & OTHERS_WRITE else ""


def distrusted_folder(folder: Path, *, sticky: bool = False) -> str:
    """Why somebody else could lead a folder's name elsewhere, or rename what lies in it; "" where nobody could.

    sticky: others may write where they may rename only their own files (/tmp). A link counts as its maker's: a
    superuser who keeps a user's home would otherwise write wherever that user's links lead. A folder that is not there
    yet is nobody's. OSError where it cannot be looked at.
    """
    try:
        link, status = folder.lstat(), folder.stat()
    except FileNotFoundError:
        return ""
    if stat.S_ISLNK(link.st_mode) and hasattr(os, "geteuid") and link.st_uid not in (0, os.geteuid()):
        return "it is a link of another user"
    if sticky and status.st_mode & stat.S_ISVTX and status.st_uid == 0:
        return ""
    return distrusted(status)


def _changed_since_start(module: str) -> bool:
    file = source_file(module)
    return file is None or START_S < file.stat().st_mtime <= time.time()


def source_file(module: str) -> Path | None:
    """The source file of a module of this package, or of one outside that is no library's (a script, a test)."""
    if module.split(".")[0] == PACKAGE.name:
        return _own_source(module)
    file = getattr(sys.modules.get(module), "__file__", None)
    if file is None or not file.endswith(".py") or is_of_library(file) or not Path(file).is_file():
        return None
    return Path(file)


@cache
def _own_source(module: str) -> Path | None:
    """The source file of a module of this package."""
    path = PACKAGE.joinpath(*module.split(".")[1:])
    candidates = [path / "__init__.py", *([path.with_suffix(".py")] if path != PACKAGE else [])]
    return next((candidate for candidate in candidates if candidate.is_file()), None)


def is_of_library(file: str) -> bool:
    """Whether a file was installed, wherever: a stamp must be the same in every installation of the same versions."""
    return file.startswith(LIBRARIES) or not INSTALLED.isdisjoint(Path(file).parts)


def parse_source(content: bytes, module: str, is_package: bool) -> Source:
    """The hash of a file's code, and the modules that it may import: `from a import b` names a and perhaps a.b."""
    tree = ast.parse(content)
    package = module if is_package else module.rpartition(".")[0]
    imports = sorted(set(_imports(tree.body, package)))
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node, False) is not None:
            del node.body[0]
    return Source(hashlib.sha256(ast.dump(tree).encode()).hexdigest()[:32], tuple(imports))


def _imports(statements: Iterable[ast.AST], package: str) -> Iterator[str]:
    """The modules that these statements import when they run at import time."""
    for statement in statements:
        if isinstance(statement, ast.Import):
            yield from (alias.name for alias in statement.names if not _of_library(alias.name))
        elif isinstance(statement, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) + 1 - statement.level] if statement.level else []
            source = ".".join([*above, *([statement.module] if statement.module else [])])
            if not _of_library(source):
                yield source
                yield from (f"{source}.{alias.name}" for alias in statement.names)
        elif isinstance(statement, ast.If) and "TYPE_CHECKING" in ast.dump(statement.test):
            yield from _imports(statement.orelse, package)
        elif not isinstance(statement, ast.FunctionDef | ast.AsyncFunctionDef):
            yield from _imports(ast.iter_child_nodes(statement), package)


def _of_library(module: str) -> bool:
    """Whether a module is certainly not ours: the standard library's, or NumPy and Numba, whose versions count."""
    return module.split(".")[0] in sys.stdlib_module_names or module.split(".")[0] in ("numpy", "numba", "llvmlite")
