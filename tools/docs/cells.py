"""An executed notebook as a page: its words, its code, and what each cell printed and showed."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

PLOTLY = "application/vnd.plotly.v1+json"
FIGURE = """<!doctype html><meta charset="utf-8"><style>body {{ margin: 0 }}</style>
<div id="figure" style="width: 100%; height: 100vh"></div>
<script src="../../assets/plotly.min.js"></script>
<script>const figure = {figure}; figure.layout.autosize = true; delete figure.layout.width; delete figure.layout.height;
Plotly.newPlot("figure", figure.data, figure.layout, {{ responsive: true, displaylogo: false }});</script>
"""


def page(notebook: Any, name: str, folder: Path) -> str:
    """The Markdown of a notebook; pictures and figures are written to `folder/NAME_files`, which the page names."""
    files = _Files(folder / f"{name}_files")
    parts = []
    for cell in notebook.cells:
        parts.append(cell.source if cell.cell_type == "markdown" else _code(cell.source))
        for output in _joined(cell.get("outputs", ())):
            parts += _shown(output, files)
    return "\n\n".join(parts) + "\n"


def _code(source: str) -> str:
    """A cell's code, fenced; that of a `%%bash` cell as what is typed into a shell."""
    language, text = ("bash", source.split("\n", 1)[1]) if source.startswith("%%bash") else ("python", source)
    return f"```{language}\n{text}\n```"


def _joined(outputs: Any) -> list[Any]:
    """A cell's outputs with what was printed in pieces joined, and what went to standard error left out.

    Progress and a compiler's words stay in the notebook and do not enter the page.
    """
    joined: list[Any] = []
    for output in outputs:
        if output.output_type == "stream" and output.name != "stdout":
            continue
        if joined and output.output_type == joined[-1].output_type == "stream":
            joined[-1].text += output.text
        else:
            joined.append(output.copy())
    return joined


def _shown(output: Any, files: _Files) -> Iterator[str]:
    """One output of a cell as Markdown: printed text, a figure, a picture, a table, or a value's repr."""
    if output.output_type == "stream":
        if output.text.strip():
            yield _text(output.text)
        return
    data = output.get("data", {})
    if PLOTLY in data:
        name = files.write("html", FIGURE.format(figure=json.dumps(data[PLOTLY])).encode())
        yield f'<iframe class="flownav-figure" loading="lazy" title="Figure" src="{name}"></iframe>'
    elif "image/png" in data:
        yield f"![{data.get('text/plain', 'Figure')}]({files.write('png', base64.b64decode(data['image/png']))})"
    elif "text/html" in data:
        lines = "\n".join(line for line in "".join(data["text/html"]).splitlines() if line.strip())
        yield f'<div class="flownav-output">\n{lines}\n</div>'
    elif "text/plain" in data:
        yield _text(data["text/plain"])


def _text(text: str) -> str:
    """Printed text, fenced so that no line of it ends the fence."""
    lines = "\n".join(line.rstrip() for line in text.strip("\n").splitlines())
    fence = "````" if "```" in lines else "```"
    return f"{fence}{{ .text .flownav-output }}\n{lines}\n{fence}"


class _Files:
    """The numbered files of one page."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.count = 0

    def write(self, kind: str, content: bytes) -> str:
        """Write the next file; its path, relative to the page."""
        self.count += 1
        self.folder.mkdir(parents=True, exist_ok=True)
        (self.folder / f"{self.count}.{kind}").write_bytes(content)
        return f"{self.folder.name}/{self.count}.{kind}"
