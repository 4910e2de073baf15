"""The page of `flownav build --target wasm32` in headless Chromium, from a file: its figures are `flownav replay`'s."""

from __future__ import annotations

import json
import shutil
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import flownav
from browsing import Visit
from command import run
from fed_records import queue_of_flight, record_of

pytestmark = pytest.mark.browser

CANVASES = ("timeline", "path", "level", "innovations")
MOST_BYTES = 1_000_000
ENDED = "['done', 'failed'].includes(document.documentElement.dataset.state)"
INK = """(name) => { const canvas = document.getElementById(name);
  const bytes = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  let found = 0; for (let i = 3; i < bytes.length; i += 4) found += bytes[i] > 0; return found; }"""
DROP = """([name, bytes]) => { const data = new DataTransfer();
  data.items.add(new File([Uint8Array.from(atob(bytes), (c) => c.charCodeAt(0))], name));
  dispatchEvent(new DragEvent("drop", { dataTransfer: data })); }"""


class Page(Visit):
    """The page, which is opened from a file."""

    def wait(self) -> None:
        self.until("document.documentElement.dataset.state === 'waiting'")

    def give(self, path: Path) -> str:
        """Choose a file; what the page says in the end."""
        return self.after(lambda: self.page.set_input_files("#file", path))

    def after(self, what: Callable[[], object]) -> str:
        """The page's state after an action that lets it fuse."""
        self.page.evaluate("document.documentElement.dataset.state = 'busy'")
        what()
        self.until(ENDED)
        return str(self.page.inner_text("#state"))

    @property
    def figures(self) -> dict[str, Any]:
        assert self.page.evaluate("document.documentElement.dataset.state") == "done"
        found: dict[str, Any] = json.loads(self.page.get_attribute("#figures", "data-json"))
        return found


@pytest.fixture(scope="module")
def record(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("flight") / "pad_return.fnr"
    flownav.fly("pad_return", seed=3).save(path)
    return path


@pytest.fixture(scope="module")
def html(record, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("page") / "built"
    flownav.build("wasm32", folder, record=record)
    alone = folder.parent / "alone" / "flownav.html"
    alone.parent.mkdir()
    shutil.copy(folder / "flownav.html", alone)  # nothing lies beside it
    return alone


@pytest.fixture
def page(browser, html) -> Iterator[Page]:
    visit = Page(browser, html, 1100)
    yield visit
    visit.context.close()


def replayed(record: Path, folder: Path, *more: object) -> dict[str, Any]:
    """The figures of `flownav replay` on the same record, as far as the page has them."""
    done = run("replay", record, *more, "--json", "--out", folder / "replayed.fnr", "--force")
    assert done.returncode == 0, done.stderr
    facts: dict[str, Any] = json.loads(done.stdout)
    return {
        "outages": facts["outages"],
        "velocity_rms_m_s": facts["velocity_rms_m_s"],
        "truth": {name: value for name, value in facts["truth"].items() if name not in ("reference", "yaw_rad")},
        "protection": {name: facts["protection"][name] for name in ("horizontal_m", "vertical_m")},
        "consistency": {
            name: {key: each[key] for key in ("nis_per_dof", "samples")} for name, each in facts["consistency"].items()
        },
        "rejected": facts["rejected"],
    }


# -- figures --------------------------------------------------------------------------------------------------
def test_a_record_gives_the_figures_of_replay_to_the_last_digit(page, record, html, tmp_path):
    assert html.stat().st_size < MOST_BYTES
    assert "readings" in page.give(record)
    found = page.figures
    assert found.pop("estimates") > 1000
    assert flownav.verify(found.pop("digest"), record, horizon_s=0.0)["equal"]
    assert found == replayed(record, tmp_path)
    assert found["truth"]["horizontal_rms_m"] > 0.0
    for name in CANVASES:
        assert page.page.evaluate(INK, name) > 1000, name
    assert page.errors == []
    assert [request for request in page.requests if not request.startswith(("file:", "data:", "blob:"))] == []
    assert page.page.evaluate("document.documentElement.scrollWidth") <= page.width


def test_a_gps_cut_that_is_drawn_on_the_timeline_is_flown(page, record, tmp_path):
    page.give(record)
    before, box, mouse = page.figures, page.page.locator("#timeline").bounding_box(), page.page.mouse

    def draw() -> None:
        mouse.move(box["x"] + 0.4 * box["width"], box["y"] + 100.0)
        mouse.down()
        mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 100.0, steps=4)
        mouse.up()

    page.after(draw)
    found = page.figures
    (cut,) = found["outages"]
    assert 5.0 < cut["t1"] - cut["t0"] < 20.0
    assert cut["horizontal_rms_m"] > 0.0
    assert found.pop("digest") != before["digest"]
    del found["estimates"]
    assert found == replayed(record, tmp_path, "--gps-outage", f"{cut['t0']!r}:{cut['t1']!r}")
    page.page.fill("#from", "")
    page.after(lambda: page.page.click("form button"))
    assert page.figures == before


def test_a_csv_of_what_was_fed_gives_the_same_without_the_truth(page, record, tmp_path):
    assert run("export", record, "--to", "csv", "--out", tmp_path / "csv").returncode == 0
    page.give(tmp_path / "csv" / "fed.csv")
    found = page.figures
    del found["estimates"], found["digest"]
    expected = replayed(record, tmp_path)
    del expected["truth"]
    assert found == expected


def test_a_file_may_be_dropped(page, record):
    import base64

    content = base64.b64encode(record.read_bytes()).decode()
    assert "pad_return.fnr: " in page.after(lambda: page.page.evaluate(DROP, ["pad_return.fnr", content]))
    assert page.figures["estimates"] > 1000


# -- what cannot be ---------------------------------------------------------------------------------------------
def test_what_is_no_flight_is_said(page, tmp_path):
    for name, content, said in (
        ("a.fnr", b"no zip at all, and long enough for one", "not a record of flownav: no zip"),
        ("a.csv", b"t,gyro_x\n0,1\n", "the CSV file lacks t_s, sensor or value_0"),
        ("b.csv", b"t_s,sensor,value_0\n0,5,1\n1,5,1\n", "the filter never started"),
    ):
        (tmp_path / name).write_bytes(content)
        assert said in page.give(tmp_path / name)
    with zipfile.ZipFile(tmp_path / "empty.fnr", "w") as made:
        made.writestr("manifest.json", "{}")
    assert "does not say what a navigator was fed" in page.give(tmp_path / "empty.fnr")
    assert page.errors == []


def test_a_record_of_other_settings_is_not_fused_as_if_they_were_the_same(page, tmp_path):
    path = tmp_path / "other.fnr"
    record_of(queue_of_flight()).save(path)
    said = page.give(path)
    assert "write a page for it with `flownav build --target wasm32 --record other.fnr`" in said
