"""One HTML file that fuses a record in the browser: the module, what is around it, and what reads and draws."""

import base64
import json
import re
from collections.abc import Sequence
from importlib.resources import files
from typing import Any

from jinja2 import Environment, PackageLoader

from flownav.navigation.rings import Given

SCRIPTS = ("zstd.js", "record.js", "figures.js", "fusing.js", "page.js")  # each after what it imports
IMPORT = re.compile(r"^import .*\n", re.M)
EXPORT = re.compile(r"^export (?=const|class|function|async)", re.M)
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
    return WHOLE.sub("", EXPORT.sub("", text))


# -- the digests of test vectors ----------------------------------------------------------------------------------
DIGESTS = """<!doctype html><meta charset="utf-8"><p id="digests"></p><script>
{around}
const readings = {readings};
const bytes = Uint8Array.from(atob("{module}"), (letter) => letter.charCodeAt(0));
Navigator.load(bytes).then((nav) => {{
  const found = [];
  readings.forEach(([tS, sensor, numbers], i) => {{
    const [quality, delayS, exposureS, withheld] = numbers.slice(9), variance = numbers.slice(6, 9);
    nav.take(tS, sensor, numbers.slice(0, 6), {{ variance, quality, delayS, exposureS, withheld }});
    if ((i + 1) % {every} === 0) found.push(nav.digest());
  }});
  document.getElementById("digests").textContent = found.join(" ");
}});
</script>
"""


def digests_page(module: bytes, around: str, readings: Sequence[Given], every: int) -> str:
    """A page that passes readings to the module and shows the digest after every `every` of them, in `#digests`."""
    rows = json.dumps([[given.t_s, given.sensor, given.numbers.tolist()] for given in readings])
    own = EXPORT.sub("", around)
    return DIGESTS.format(around=own, readings=rows, module=base64.b64encode(module).decode(), every=every)
