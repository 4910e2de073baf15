"""Size and structure of the code: `make weigh`. Rooms on floors, modules, lines, functions too long or wide, index
arithmetic.

python tools/weigh.py [--list ARGUMENTS|LINES|NESTING]
"""

from __future__ import annotations

import ast
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from house import SOURCE, arrows, between_rooms, circles, drawing

MOST = {"arguments": 8, "lines": 50, "nesting": 3}
INDEX = "* len(lanes)"
BRANCHES = (ast.If, ast.For, ast.While, ast.With, ast.Try, ast.Match)


def functions(tree: ast.Module) -> Iterator[ast.FunctionDef]:
    """Every function of a module, methods and inner ones too."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            yield node


def nesting(node: ast.AST, depth: int = 0) -> int:
    """How deep blocks stand within each other; an `elif` is as deep as its `if`."""
    deepest = depth
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef):
            continue
        elif_of = (
            isinstance(node, ast.If) and isinstance(child, ast.If) and child in node.orelse and len(node.orelse) == 1
        )
        inside = isinstance(child, BRANCHES) and not elif_of
        deepest = max(deepest, nesting(child, depth + inside))
    return deepest


def measures(function: ast.FunctionDef) -> dict[str, int]:
    """How many arguments a function takes, how many lines it is long, how deep it is nested."""
    told = function.args
    arguments = [*told.posonlyargs, *told.args, *told.kwonlyargs]
    return {
        "arguments": sum(argument.arg != "self" for argument in arguments),
        "lines": (function.end_lineno or function.lineno) - function.lineno + 1,
        "nesting": nesting(function),
    }


def weigh(source: Path = SOURCE) -> tuple[dict[str, int], Counter[str], dict[str, list[str]]]:
    """The counts, the index expressions by room, and the functions beyond each limit of MOST."""
    files = sorted(source.rglob("*.py"))
    texts = {path: path.read_text(encoding="utf-8") for path in files}
    beyond: dict[str, list[str]] = {name: [] for name in MOST}
    for path, text in texts.items():
        for function in functions(ast.parse(text)):
            for name, value in measures(function).items():
                if value > MOST[name]:
                    beyond[name].append(f"{value:4d}  {path.relative_to(source)}:{function.lineno} {function.name}")
    rooms = Counter({path.relative_to(source).parts[0]: 0 for path in files})
    for path, text in texts.items():
        rooms[path.relative_to(source).parts[0]] += text.count(INDEX)
    lines = [line for text in texts.values() for line in text.splitlines()]
    counts = {
        "entries of src/flownav": sum(
            not entry.name.startswith("_") or entry.suffix == ".py" for entry in source.iterdir()
        ),
        "modules": len(files),
        "lines": len(lines),
        "comment lines": sum(line.lstrip().startswith("#") for line in lines),
        "lines with `fmt: skip`": sum("# fmt: skip" in line for line in lines),
        **{f"functions beyond {most} {name}": len(beyond[name]) for name, most in MOST.items()},
        f"index expressions `{INDEX}`": sum(rooms.values()),
    }
    return counts, rooms, beyond


def drawn() -> str:
    """The rooms on their floors, and what runs in a circle."""
    every = arrows()
    rooms = between_rooms(every)
    loops = "".join(f"\ncircle: {', '.join(group)}" for group in circles(every) + circles(rooms))
    return f"{len(rooms)} arrows between rooms, the highest floor first:\n{drawing(rooms)}{loops or ', no circle'}"


def main(asked: list[str]) -> None:
    """Print the counts, or the functions beyond a limit."""
    counts, rooms, beyond = weigh()
    if asked[:1] == ["--list"]:
        print("\n".join(sorted(beyond[asked[1].lower()], reverse=True)))
        return
    for name, count in counts.items():
        print(f"{count:8d}  {name}")
    for room, count in rooms.most_common():
        if count:
            print(f"{count:8d}    in {room}")
    print(drawn())


if __name__ == "__main__":
    main(sys.argv[1:])
