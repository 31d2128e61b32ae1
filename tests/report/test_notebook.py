"""The notebook of examples/ runs from its first cell to its last, and shows what it promises."""

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
NOTEBOOK = ROOT / "examples/notebook.ipynb"


@pytest.mark.slow
@pytest.mark.filterwarnings("default")  # of the libraries of notebooks
def test_the_notebook_runs(monkeypatch):
    monkeypatch.delenv("MPLBACKEND", raising=False)  # by which figures would not be inline
    client = pytest.importorskip("nbclient")
    nbformat = pytest.importorskip("nbformat")
    pytest.importorskip("ipykernel")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    assert len(notebook.cells) == 15
    assert not any(cell.get("outputs") for cell in notebook.cells)  # which would be out of date
    place = {"metadata": {"path": str(NOTEBOOK.parent)}}
    client.NotebookClient(notebook, timeout=300, resources=place).execute()
    shown = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    kinds = [set(output.get("data", {})) for output in shown]
    assert (
        sum("text/html" in kind for kind in kinds) == 5
    )  # scene, plan, response, comparison, table
    assert sum("image/png" in kind for kind in kinds) == 3  # waveforms, lines, the figure
    said = "".join(output.get("text", "") for output in shown)
    assert "f_d-f_AM: " in said
    assert "Kausel" in said
