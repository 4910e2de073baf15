"""The data that pages pass to Plotly's script are those of Plotly's own Python package, and are made without it."""

from __future__ import annotations

import base64
import gzip
import json
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

from flownav.core.errors import InputError
from flownav.paper.figures_rig import pictures
from flownav.report import html, panels
from flownav.report.campaign_figures import envelope, envelope_figure, sensitivity
from flownav.report.certificate_figures import ranking
from flownav.report.chart import Chart
from flownav.report.panels import Panel
from flownav.report.style import drawing, layout
from report_records import flight

INTERVAL = {"low": 0.1, "high": 0.6, "value": 0.3}
BINS = [{"from_m_s": 0.0, "to_m_s": 4.0, "direction_deg": turn, "landed": 0.5, "low": 0.2, "high": 0.8, "flights": 9}
        for turn in (0.0, 90.0, 180.0)]  # fmt: skip
CELL = {
    "label": "landing", "envelope": BINS,
    "sensitivity": [{"input": f"wind.{k}", "rank_correlation": 0.3, "low": -0.1, "high": 0.6} for k in range(3)],
}  # fmt: skip
ROWS = [{"speed_20ft_m_s": speed, "from_direction_deg": turn, "success": {"rate": 0.5, "low": 0.2, "high": 0.8},
         "crashed": 1, "rest": {"r95_m": None}} for speed in (3.0, 8.0) for turn in (0.0, 180.0)]  # fmt: skip
RANKED = {"input": "vehicle.body.mass_kg", "known": "build", "first": 0.2, "first_interval": [0.1, 0.3], "total": 1.2,
          "total_interval": [0.9, 1.4]}  # fmt: skip
FACTS = {"ranking": [RANKED], "split": [RANKED], "ranking_of": "ranks", "ranking_flights": 64, "ranking_cell": "x",
         "ranking_measure": "touchdown.horizontal_m"}  # fmt: skip


def drawn_panels() -> list[Panel]:
    """Scatter, bars, sectors and pictures, from records, campaigns, certificates and the paper."""
    of_record = [one for section in html.sections(flight()) for one in section.panels if isinstance(one.drawing, Chart)]
    grey = np.arange(12, dtype=float).reshape(3, 4)
    own = [envelope("envelope", CELL), sensitivity("sensitivity", CELL), *ranking(FACTS)]
    singles = [envelope_figure("title", ROWS), pictures([("one", grey), ("other", grey[::-1])])]
    return [
        *of_record,
        *(one for one in own if one),
        *(Panel(f"one{k}", "", drawing=one) for k, one in enumerate(singles)),
    ]


def told(text: str) -> Any:
    """JSON with the bytes of its arrays as the numbers that they are, and without a template."""

    def plain(value: dict[str, Any]) -> Any:
        if "bdata" not in value:
            return value
        numbers = np.frombuffer(base64.b64decode(value["bdata"]), np.dtype(value["dtype"]))
        shape = [int(size) for size in value.get("shape", str(len(numbers))).split(",")]
        return np.where(np.isfinite(numbers), numbers.astype(object), None).reshape(shape).tolist()

    said = json.loads(text, object_hook=plain)
    said["layout"].pop("template", None)
    return said


@pytest.mark.parametrize("panel", drawn_panels(), ids=lambda panel: panel.key)
def test_a_drawing_is_the_figure_that_plotly_makes_of_it(panel):
    assert panel.drawn is not None
    assert told(panel.drawn.to_json()) == told(panel.figure.to_json())


def test_numbers_that_are_none_are_null_and_arrays_are_their_bytes():
    said = drawing(
        [{"y": np.array([1.0, 2.5], np.float32), "x": [1.0, float("nan")], "z": np.float64(3.0)}], layout(90)
    )
    found = json.loads(said.to_json())["data"][0]
    assert found["x"] == [1.0, None]
    assert found["z"] == 3.0
    assert np.frombuffer(base64.b64decode(found["y"]["bdata"]), found["y"]["dtype"]).tolist() == [1.0, 2.5]


def test_a_page_is_drawn_without_plotlys_package():
    code = """
import sys
from flownav.report import campaign, html
page = html.page_of("A </title> in it", campaign.figures.envelope_figure("title", []))
assert "Plotly.newPlot" in page and "A &lt;/title&gt;" in page and len(page) > 1_000_000
assert "plotly" not in sys.modules, "loaded"
"""
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_page_with_plotlys_script_is_small_enough_to_send():
    given = html.drawn_with([])
    assert gzip.decompress(base64.b64decode(given["plotly"])).decode() == html.plotly_script()
    assert len(given["plotly"]) + len(given["style"]) + sum(map(len, given["scripts"])) <= 2.1e6


def test_without_plotly_one_line_says_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "plotly.graph_objects", None)
    with pytest.raises(InputError, match=r"plots in Python need the package plotly: pip install 'flownav\[plots\]'"):
        panels.plotly()
    monkeypatch.setattr(html, "find_spec", lambda name: None)
    monkeypatch.setattr(html, "HERE", tmp_path)
    with pytest.raises(InputError, match=r"drawn by Plotly's script, which .* pip install 'flownav\[plots\]'"):
        html.plotly_script()
    (tmp_path / "vendor").mkdir()
    (tmp_path / "vendor" / "plotly.min.js").write_text("the wheel's")
    assert html.plotly_script() == "the wheel's"


def test_no_page_asks_for_a_figure_of_plotlys_package():
    """`Panel.figure` is for who goes on in Python; a template that asks for it would need the package."""
    templates = sorted(html.HERE.parent.rglob("*.j2"))
    assert len(templates) > 5
    assert not [path.name for path in templates if ".figure." in path.read_text(encoding="utf-8")]
