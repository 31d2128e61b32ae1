"""Scripts of the gallery run, assert their number, and draw one picture."""

import ast
import runpy
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

from skinwave.report.renderer import renderer

SCRIPTS = sorted((Path(__file__).parents[2] / "examples" / "gallery").glob("*.py"))
SOLID = [path for path in SCRIPTS if "pyvista" in path.read_text("utf-8")]
FLAT = [path for path in SCRIPTS if path not in SOLID]


def named(paths):
    return [pytest.param(path, id=path.stem) for path in paths]


def test_there_are_as_many_as_the_documentation_promises():
    assert len(SCRIPTS) >= 12
    assert len(SOLID) >= 2


@pytest.mark.parametrize("path", named(SCRIPTS))
def test_a_script_is_short_and_asserts_a_number(path):
    text = path.read_text("utf-8")
    tree = ast.parse(text)
    lines = text.count("\n") - (ast.get_docstring(tree) or "").count("\n")
    assert 20 <= lines <= 70
    assert any(isinstance(node, ast.Assert) for node in tree.body)


@pytest.mark.parametrize("path", named(FLAT))
def test_its_number_is_as_asserted(path):
    plt.close("all")
    runpy.run_path(str(path))
    assert len(plt.get_fignums()) == 1
    plt.close("all")


@pytest.mark.parametrize("path", named(SOLID))
def test_its_number_is_as_asserted_in_three_dimensions(path, monkeypatch):
    pyvista = pytest.importorskip("pyvista")
    if not renderer().found:
        pytest.skip("there is nothing to draw with")
    shown = []
    monkeypatch.setattr(pyvista, "OFF_SCREEN", True)
    show = pyvista.Plotter.show
    monkeypatch.setattr(
        pyvista.Plotter, "show", lambda self: shown.append(show(self, return_img=True))
    )
    runpy.run_path(str(path))
    (picture,) = shown
    assert picture.std() > 10  # not blank
