"""The notebooks of examples/ run from top to bottom, each in its own kernel; they are kept without output."""

import json
import os
import sys

import pytest

nbclient = pytest.importorskip("nbclient", reason="needs nbclient (tools/requirements-optional.txt)")
pytest.importorskip("ipykernel", reason="needs ipykernel (tools/requirements-optional.txt)")
nbformat = pytest.importorskip("nbformat")

EXPECTED = {  # what a reader must see
    "runs": ["finished tilt wrong by 0.", "1.0     [finished]"],
    "logs": ["mip ekf 8.0 s", "own: finished"],
}


def executed(path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    nbclient.NotebookClient(notebook, timeout=120, kernel_name="python3").execute()
    return notebook


def said(notebook) -> str:
    """Everything printed or shown as text."""
    texts = []
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            texts.append(output.get("text") or output.get("data", {}).get("text/plain", ""))
    return "\n".join(texts)


@pytest.mark.parametrize("name", EXPECTED)
def test_notebooks_run_from_top_to_bottom(root, monkeypatch, name):
    notebook = executed(root / f"examples/{name}.ipynb", monkeypatch)
    text = said(notebook)
    for expected in EXPECTED[name]:
        assert expected in text, text
    pictures = [
        o for cell in notebook.cells for o in cell.get("outputs", []) if "image/png" in o.get("data", {})
    ]
    assert pictures


def test_every_notebook_is_tested_and_kept_clean(root):
    notebooks = sorted(path.stem for path in (root / "examples").glob("*.ipynb"))
    assert notebooks == sorted(EXPECTED)
    for name in notebooks:
        cells = json.loads((root / f"examples/{name}.ipynb").read_text())["cells"]
        code = [cell for cell in cells if cell["cell_type"] == "code"]
        assert code and all(not cell["outputs"] and cell["execution_count"] is None for cell in code), name
