"""The README and the pages of docs/: what they show works, and what they link to is there."""

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


def shown(language, pages=PAGES):
    """Code blocks of a language, each with its page."""
    pattern = re.compile(rf"```{language}\n(.*?)```", re.DOTALL)
    return [
        pytest.param(text, id=f"{page.stem} {k}")
        for page in pages
        for k, text in enumerate(pattern.findall(page.read_text("utf-8")))
    ]


def test_the_readme_is_short():
    assert len((ROOT / "README.md").read_text("utf-8").splitlines()) <= 90


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_what_a_page_links_to_is_there(page):
    links = re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text("utf-8"))
    local = [link for link in links if "://" not in link]
    assert [link for link in local if not (page.parent / link).exists()] == []


def test_pictures_of_the_gallery_are_of_scripts_that_there_are():
    """The site's build draws them: the repository holds none."""
    named = {
        (page.stem, script)
        for page in PAGES
        for script in re.findall(r"sphx_glr_(\w+)_\d{3}\.png", page.read_text("utf-8"))
    }
    assert {"propagation", "elements", "silicone-disc"} <= {page for page, _ in named}
    assert [x for x in named if not (ROOT / f"examples/gallery/{x[1]}.py").exists()] == []


@pytest.mark.parametrize("text", shown("toml"))
def test_every_scene_that_the_documentation_shows_is_one(text):
    scene = loads(text)
    assert loads(dumps(scene)) == scene


@pytest.mark.parametrize("text", shown("sh"))
def test_commands_are_understood(text):
    lines = [line for line in text.splitlines() if line.startswith("skinwave ")]
    for line in lines:
        words = shlex.split(line, comments=True)[1:]
        assert cli.parser().parse_args(cli._joined(words)).command
    assert lines or "python3 -m venv" in text


@pytest.mark.slow
@pytest.mark.parametrize("text", shown("python", [p for p in PAGES if p.stem not in WRITTEN]))
def test_python_runs(text, monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SkinwaveWarning)  # the point kernel has no propagation
        exec(compile(text, "documentation", "exec"), {})
    assert capsys.readouterr().out
