"""The notebooks run from top to bottom, as a reader would run them, and keep no output."""

import os
from pathlib import Path

import pytest

nbformat = pytest.importorskip("nbformat", reason="needs pip install 'lrf3d[dev]'")
client = pytest.importorskip("nbclient", reason="needs pip install 'lrf3d[dev]'")
pytest.importorskip("ipykernel", reason="needs pip install 'lrf3d[dev]'")

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "examples" / "notebooks").glob("*.ipynb"))


# What Jupyter's own libraries warn of is theirs.
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("path", NOTEBOOKS, ids=[path.stem for path in NOTEBOOKS])
def test_every_cell_of_a_notebook_runs(path, tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]))
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    resources = {"metadata": {"path": str(tmp_path)}}
    client.NotebookClient(notebook, timeout=300, resources=resources).execute()
    shown = [
        kind
        for cell in notebook.cells
        for output in cell.get("outputs", [])
        for kind in output.get("data", {})
    ]
    assert "image/png" in shown
    assert not list(tmp_path.iterdir())


def test_there_are_five_notebooks_and_none_keeps_an_output():
    assert len(NOTEBOOKS) == 5
    for path in NOTEBOOKS:
        cells = nbformat.read(path, as_version=4).cells
        assert not any(cell.get("outputs") or cell.get("execution_count") for cell in cells)
