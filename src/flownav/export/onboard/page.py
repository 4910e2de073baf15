"""One HTML file that fuses a record in the browser: the module, what is around it, and what reads and draws."""

import base64
import json
import re
from importlib.resources import files
from typing import Any

from jinja2 import Environment, PackageLoader

SCRIPTS = ("zstd.js", "record.js", "figures.js", "fusing.js", "page.js")  # each after what it imports
IMPORT = re.compile(r"^import .*\n", re.M)
WHOLE = re.compile(r"\bfigures\.(?=[a-z])")  # a namespace that a page of one script does not have


def page_of(module: bytes, around: str, flight: str, built_for: dict[str, Any]) -> str:
    """The page. around: `flownav.js`; built_for: the facts that a record must hold to be fused by it."""
    template = Environment(loader=PackageLoader(__package__, "files/page"), autoescape=False).get_template(
        "page.html.j2"
    )
    return template.render(
        module=base64.b64encode(module).decode(), built_for=_json(built_for), script=_one_script(around), flight=flight
    )


def _json(facts: dict[str, Any]) -> str:
    """JSON whose numbers that are none are texts, and which ends no script."""
    text = re.sub(r"-?\bInfinity\b|\bNaN\b", lambda word: f'"{word[0]}"', json.dumps(facts))
    return text.replace("</", "<\\/")


def _one_script(around: str) -> str:
    """Modules one after the other, without what they import of each other."""
    folder = files(__package__) / "files" / "page"
    parts = [around, *((folder / name).read_text(encoding="utf-8") for name in SCRIPTS)]
    text = "\n".join(IMPORT.sub("", part) for part in parts)
    return WHOLE.sub("", re.sub(r"^export (?=const|class|function|async)", "", text, flags=re.M))
