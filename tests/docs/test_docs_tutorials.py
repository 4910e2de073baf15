"""Tutorials as pages: what a cell prints and shows stands under it, and a cell that raises is named."""

from __future__ import annotations

import jupytext
import nbformat
import pytest

from docs_tools import cells, notebooks
from places import DOCS, PROJECT

CELLS = """# %% [markdown]
# # A title

# %%
import sys
print("one")
print("hidden", file=sys.stderr)
print("two")
6 * 7

# %% language="bash"
# echo shell
"""


def _script(folder, text):
    path = folder / "example.py"
    path.write_text(text)
    return path


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tutorial")
    return cells.page(notebooks.run(_script(folder, CELLS)), "example", folder)


def test_what_is_printed_stands_under_its_cell(ran):
    assert ran.index("# A title") < ran.index('print("one")') < ran.index("one\ntwo") < ran.index("42")
    assert "```bash\necho shell\n```" in ran
    assert "\nshell\n" in ran


def test_standard_error_stays_out_of_the_page(ran):
    assert "\nhidden" not in ran


def test_a_cell_that_raises_is_named_with_its_error(tmp_path):
    with pytest.raises(RuntimeError, match=r"(?s)example\.py: cell 2 failed.*ZeroDivisionError: division by zero"):
        notebooks.run(_script(tmp_path, "# %%\nx = 0\n\n# %%\n1 / x\n"))


def test_a_command_that_fails_is_named(tmp_path):
    with pytest.raises(RuntimeError, match=r"(?s)example\.py: cell 1 failed.*status 3"):
        notebooks.run(_script(tmp_path, '# %% language="bash"\n# exit 3\n'))


def _shown(data):
    output = nbformat.v4.new_output("display_data", data)
    cell = nbformat.v4.new_code_cell("x", outputs=[output])
    return nbformat.v4.new_notebook(cells=[cell])


def test_a_picture_becomes_a_file_beside_the_page(tmp_path):
    page = cells.page(_shown({"image/png": "aGk=", "text/plain": "a plot"}), "example", tmp_path)
    assert "![a plot](example_files/1.png)" in page
    assert (tmp_path / "example_files" / "1.png").read_bytes() == b"hi"


def test_a_plotly_figure_becomes_a_frame_that_uses_the_sites_own_script(tmp_path):
    page = cells.page(_shown({cells.PLOTLY: {"data": [], "layout": {"width": 5}}}), "example", tmp_path)
    assert 'src="example_files/1.html"' in page
    figure = (tmp_path / "example_files" / "1.html").read_text()
    assert 'src="../../assets/plotly.min.js"' in figure
    assert "http" not in figure


def test_a_table_is_kept_as_html(tmp_path):
    page = cells.page(_shown({"text/html": "<table>\n\n<tr></tr></table>", "text/plain": "x"}), "example", tmp_path)
    assert "<table>\n<tr></tr></table>" in page


def test_every_tutorial_has_a_title_and_a_place_in_the_navigation():
    navigation = (PROJECT / "mkdocs.yml").read_text(encoding="utf-8")
    scripts = notebooks.tutorials()
    assert scripts
    for script in scripts:
        first = jupytext.read(script, fmt="py:percent").cells[0]
        assert first.cell_type == "markdown", script.name
        assert first.source.startswith("# "), script.name
        assert f": {script.relative_to(DOCS).with_suffix('.md').as_posix()}\n" in navigation, script.name
