"""The README and the pages of docs/: what they show works, and what they link to is there."""

import ast
import re
import shlex
import warnings
from pathlib import Path

import pytest
from test_how_tos import WRITTEN  # whose blocks are run there, one after the other

from skinwave import SkinwaveWarning, dumps, loads
from skinwave.commands import cli

ROOT = Path(__file__).parents[2]
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))
OTHERS = [page for page in PAGES if page.stem not in WRITTEN]


def code_blocks(language, pages=PAGES):
    pattern = re.compile(rf"```{language}\n(.*?)```", re.DOTALL)
    found = {page: pattern.findall(page.read_text("utf-8")) for page in pages}
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


def test_pictures_of_the_gallery_are_of_scripts_that_there_are():
    named = {
        (page.stem, script)
        for page in PAGES
        for script in re.findall(r"sphx_glr_(\w+)_\d{3}\.png", page.read_text("utf-8"))
    }
    assert {"propagation", "elements", "silicone-disc"} <= {page for page, _ in named}
    assert [x for x in named if not (ROOT / f"examples/gallery/{x[1]}.py").exists()] == []


def test_every_scene_that_the_documentation_shows_is_one():
    for page, texts in code_blocks("toml").items():
        for text in texts:
            scene = loads(text)
            assert loads(dumps(scene)) == scene, page


def test_commands_are_understood():
    for page, texts in code_blocks("sh").items():
        for text in texts:
            lines = [line for line in text.splitlines() if line.startswith("skinwave ")]
            for line in lines:
                words = shlex.split(line, comments=True)[1:]
                assert cli.parser().parse_args(cli._join_up_option(words)).command, page
            assert lines or "python3 -m venv" in text, page


@pytest.mark.slow
@pytest.mark.parametrize("page", code_blocks("python", OTHERS), ids=lambda page: page.stem)
def test_python_runs(page, monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    for text in code_blocks("python", OTHERS)[page]:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SkinwaveWarning)  # the point kernel has no propagation
            exec(compile(text, str(page), "exec"), {})
        assert capsys.readouterr().out


def test_scripts_of_the_gallery_are_short_and_assert_a_number():
    scripts = sorted((ROOT / "examples/gallery").glob("*.py"))
    assert len(scripts) >= 12
    for path in scripts:
        text = path.read_text("utf-8")
        tree = ast.parse(text)
        lines = text.count("\n") - (ast.get_docstring(tree) or "").count("\n")
        assert 20 <= lines <= 70, path
        assert any(isinstance(node, ast.Assert) for node in tree.body), path
