"""Scripts of the gallery run, assert their number, and draw one picture."""

import ast
import runpy
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

from skinwave.report.renderer import renderer

SCRIPTS = sorted((Path(__file__).parents[2] / "examples" / "gallery").glob("*.py"))


def test_scripts_are_short_and_assert_a_number():
    assert len(SCRIPTS) >= 12
    for path in SCRIPTS:
        text = path.read_text("utf-8")
        tree = ast.parse(text)
        lines = text.count("\n") - (ast.get_docstring(tree) or "").count("\n")
        assert 20 <= lines <= 70, path
        assert any(isinstance(node, ast.Assert) for node in tree.body), path


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_its_number_is_as_asserted(path, monkeypatch):
    plt.close("all")
    shown = []
    if "pyvista" in path.read_text("utf-8"):
        pyvista = pytest.importorskip("pyvista")
        if not renderer().found:
            pytest.skip("there is nothing to draw with")
        show = pyvista.Plotter.show
        monkeypatch.setattr(pyvista, "OFF_SCREEN", True)
        monkeypatch.setattr(
            pyvista.Plotter, "show", lambda self: shown.append(show(self, return_img=True))
        )
    runpy.run_path(str(path))
    assert len(plt.get_fignums()) + len(shown) == 1
    assert not shown or shown[0].std() > 10  # not blank
    plt.close("all")
