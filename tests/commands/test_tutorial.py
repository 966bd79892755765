"""The tutorial runs from its first cell to its last, and comes to the decision that its text names."""

from __future__ import annotations

import warnings
from pathlib import Path

import pytest

NOTEBOOK = Path(__file__).parents[2] / "docs/tutorial.ipynb"


@pytest.fixture(scope="module")
def cells(tmp_path_factory):
    """The cells, run afresh in a folder of their own."""
    nbformat = pytest.importorskip("nbformat", reason='no notebooks here: pip install "pendbench[test]"')
    nbclient = pytest.importorskip("nbclient", reason='no notebooks here: pip install "pendbench[test]"')
    pytest.importorskip("ipykernel", reason='no notebooks here: pip install "pendbench[test]"')
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.outputs = []
    folder = tmp_path_factory.mktemp("tutorial")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the libraries that run notebooks, about their own insides
        nbclient.NotebookClient(
            notebook, timeout=None, startup_timeout=600, resources={"metadata": {"path": str(folder)}}
        ).execute()
    return notebook.cells


def shown(cells, source: str) -> str:
    """What the one cell that has such a source shows, as text."""
    [cell] = [cell for cell in cells if cell.cell_type == "code" and source in cell.source]
    return "".join(out.get("text") or out["data"]["text/plain"] for out in cell.outputs)


def test_the_reader_sees_what_the_text_says(cells):
    assert shown(cells, "arm = pb.Scene.chain") == "<Scene 'arm': 3 links, 1 m, 2 s, gravity, joint_damping>"
    assert shown(cells, "pb.reference").startswith("horizon 2 s; off by at most ")
    assert shown(cells, "best =").startswith('<option integrator="RK4" timestep="')
    assert shown(cells, "load_run").startswith("<Trajectory of 'arm' by mujoco rk4 dt=")
    assert shown(cells, "rods = pb.load_scene").startswith("<Scene 'rods': 2 links, 1 m, 10 s, gravity, ")


def test_the_model_file_is_judged_and_mended(cells):
    found, again = shown(cells, "found = pb.judge"), shown(cells, "again = pb.judge")
    assert found.startswith("As it stands (euler, 0.005 s), the file follows the truth to 0.001 of the length for 0.0")
    assert "what parts them is the step" in found
    assert again.startswith('<option timestep="0.01" integrator="RK4"/>')
    assert "As it stands (rk4, 0.01 s), the file follows the truth to 0.001 of the length for all of 1 s" in again


def test_the_notebook_is_kept_as_it_was_run(cells):
    nbformat = pytest.importorskip("nbformat")
    kept = nbformat.read(NOTEBOOK, as_version=4).cells
    for source in ("arm = pb.Scene.chain", "best =", "load_run", "rods = pb.load_scene"):
        assert shown(kept, source) == shown(cells, source)
