"""The notebook of the documentation in a kernel, as Jupyter and the site run it: what its cells show."""

from __future__ import annotations

import base64
import io

import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient
from pages import ROOT, blocks
from PIL import Image

PAGE = ROOT / "docs" / "guides" / "results-in-pandas.md"


@pytest.fixture(scope="module")
def shown(tmp_path_factory) -> dict[str, dict[str, str]]:
    """Cell -> what it shows last, by type of content."""
    cells = [block.text for block in blocks(PAGE.read_text("utf-8")) if block.language == "python"]
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in cells])
    place = {"metadata": {"path": tmp_path_factory.mktemp("notebook")}}
    NotebookClient(notebook, timeout=300, kernel_name="python3", resources=place).execute()
    outputs = {cell.source: [out.data for out in cell.outputs if "data" in out] for cell in notebook.cells}
    return {cell: found[-1] if found else {} for cell, found in outputs.items()}


def test_results_are_a_table(shown):
    html = shown["results\n"]["text/html"]
    assert "<table" in html
    assert "<td>8: 8 converged</td>" in html
    assert "<th>modified-newton</th>" in html


def test_a_plot_is_a_picture(shown):
    """Without that the notebook has imported pyplot; it has curves in four colours."""
    (cell,) = (cell for cell in shown if "results.plot(" in cell)
    with Image.open(io.BytesIO(base64.b64decode(shown[cell]["image/png"]))) as picture:
        pixels = np.asarray(picture.convert("RGB")).reshape(-1, 3)
    assert picture.width > 600
    for colour in ("0072B2", "D55E00", "009E73", "CC79A7"):
        assert (pixels == list(bytes.fromhex(colour))).all(axis=1).any()
