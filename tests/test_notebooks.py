"""The notebooks run from top to bottom, as a reader would run them, and keep small outputs."""

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


def test_there_are_five_notebooks_that_can_be_read_where_they_are_shown():
    """All cells were run, in their order; of outputs they keep texts and small pictures."""
    assert len(NOTEBOOKS) == 5 and sum(path.stat().st_size for path in NOTEBOOKS) < 1_000_000
    for path in NOTEBOOKS:
        cells = [c for c in nbformat.read(path, as_version=4).cells if c.cell_type == "code"]
        outputs = [output for cell in cells for output in cell.outputs]
        assert [cell.execution_count for cell in cells] == [*range(1, len(cells) + 1)]
        kinds = {kind for output in outputs for kind in output.get("data", {})}
        assert kinds == {"image/png", "text/plain"}
        assert not any(output.output_type == "error" for output in outputs)
