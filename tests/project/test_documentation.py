"""README, pages, docstrings and notebook: what they show works, and what they link to is there."""

import ast
import doctest
import re
import shlex
import warnings
from importlib import import_module
from pathlib import Path

import pytest
import pyvista
from test_how_tos import WRITTEN, example  # whose blocks are run there, one after the other

from skinwave import SkinwaveWarning, dumps, loads
from skinwave.commands import cli
from skinwave.report.renderer import renderer

ROOT = Path(__file__).parents[2]
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))
PACKAGES = ("fem", "meshes", "simple_model", "skinwave")
MODULES = sorted(
    path.relative_to(ROOT).with_suffix("").as_posix().replace("/", ".")
    for package in PACKAGES
    for path in (ROOT / package).rglob("*.py")
    if ">>> " in path.read_text(encoding="utf-8")
)
NOTEBOOK = ROOT / "examples/notebook.ipynb"


def code_blocks(language, without_how_tos=False):
    pattern = re.compile(rf"```{language}\n(.*?)```", re.DOTALL)
    found = {}
    for page in PAGES:
        text = page.read_text("utf-8")
        if without_how_tos and page.stem in WRITTEN:
            text = text.replace(example(text), "")
        found[page] = pattern.findall(text)
    return {page: texts for page, texts in found.items() if texts}


def test_the_readme_is_short():
    assert len((ROOT / "README.md").read_text("utf-8").splitlines()) <= 90


def test_what_pages_link_to_is_there():
    links = [
        page.parent / link
        for page in PAGES
        for link in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text("utf-8"))
        if "://" not in link
    ]
    assert [link for link in links if not link.exists()] == []


def test_files_that_pages_name_exist():
    top = "fem|simple_model|meshes|skinwave|bench|tests|examples"
    named = {
        file
        for page in (*PAGES, ROOT / "CONTRIBUTING.md")
        for file in re.findall(rf"`((?:{top})/[\w/.-]+\.\w+)`", page.read_text("utf-8"))
    }
    assert len(named) > 30
    assert [file for file in sorted(named) if not (ROOT / file).exists()] == []


def test_every_scene_that_the_documentation_shows_is_one():
    for page, texts in code_blocks("toml").items():
        for text in texts:
            scene = loads(text)
            assert loads(dumps(scene)) == scene, page


def test_commands_are_understood():
    for page, texts in code_blocks("sh").items():
        for text in texts:
            lines = text.replace("\\\n", "").splitlines()
            lines = [line for line in lines if line.startswith("skinwave ")]
            for line in lines:
                words = shlex.split(line, comments=True)[1:]
                assert cli.parser().parse_args(cli._join_up_option(words)).command, page
            assert lines or "python3 -m venv" in text, page


@pytest.mark.slow
@pytest.mark.parametrize("page", code_blocks("python", True), ids=lambda page: page.stem)
def test_python_runs(page, monkeypatch, capsys):
    if page.stem in ("notebooks", "2-kernel-and-waves") and not renderer().is_available:
        pytest.skip("nothing draws in three dimensions here")
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(pyvista, "OFF_SCREEN", True)  # no windows
    for text in code_blocks("python", True)[page]:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SkinwaveWarning)  # the point kernel has no propagation
            exec(compile(text, str(page), "exec"), {})
        assert capsys.readouterr().out


def test_lines_of_code_fit_the_column_of_the_site():
    texts = [page.read_text("utf-8") for page in (*PAGES, ROOT / "bench/README.md")]
    fence = re.compile(r"^```([^\n]*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
    found = [block for text in texts for block in fence.findall(text)]
    blocks = [block for language, block in found if language != "{raw} html"]
    assert len(blocks) > 80
    assert [line for block in blocks for line in block.splitlines() if len(line) > 100] == []


def test_outputs_follow_the_code_of_the_tutorial():
    for page in sorted((ROOT / "docs/tutorial").glob("?-*.md")):
        text = page.read_text("utf-8")
        pieces = re.split(r"```python\n.*?```\n", text, flags=re.DOTALL)[1:]
        assert pieces
        assert all(piece.startswith("\n<!-- output") for piece in pieces), page


def test_each_part_of_the_stated_error_is_explained():
    sources = [path.read_text("utf-8") for path in (ROOT / "skinwave").rglob("*.py")]
    names = {name for text in sources for name in re.findall(r'ErrorPart\(\s*name="([^"]+)"', text)}
    page = (ROOT / "docs/explanation/errors.md").read_text("utf-8")
    assert len(names) > 12
    assert [name for name in sorted(names) if f"| {name} |" not in page] == []


def test_scripts_of_the_gallery_are_short_and_assert_a_number():
    scripts = sorted((ROOT / "examples/gallery").glob("*.py"))
    assert len(scripts) >= 12
    for path in scripts:
        text = path.read_text("utf-8")
        tree = ast.parse(text)
        lines = text.count("\n") - (ast.get_docstring(tree) or "").count("\n")
        assert 20 <= lines <= 70, path
        assert any(isinstance(node, ast.Assert) for node in tree.body), path


@pytest.mark.parametrize("name", MODULES)
def test_examples_of_docstrings_run(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    options = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
    results = doctest.testmod(import_module(name), optionflags=options)
    assert results.attempted
    assert not results.failed


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
    # Of scene, plan, response, comparison and table; waveforms, lines and the figure.
    for kind, count in (("text/html", 5), ("image/png", 3)):
        assert sum(kind in each for each in kinds) == count
