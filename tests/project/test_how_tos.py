"""How-to pages: a user's own code does what the page says in an empty folder, block after block."""

import re
import shlex
import warnings
from pathlib import Path

import pytest

from skinwave import SkinwaveWarning
from skinwave.commands import cli

DOCS = Path(__file__).parents[2] / "docs"
WRITTEN = {  # pages, or their sections "Example", and files that they write
    "labelled-data": ("tactons.csv",),
    "fit": (
        "palm.csv",
        "inspected/index.html",
        "fitted/scene.toml",
        "fitted/estimates.csv",
    ),
    "sheets": ("sheet/lines.csv", "clips/rows"),
    "silicone-disc": ("disc/responses.npz", "disc.gif", "disc.pvd"),
    "fingertip": (),
    "uncertainty": ("skin/percentiles.csv", "skin/samples.csv"),
    "own-laws": (),
    "results": ("supplement/record.json", "again/record.json"),
}
LONGEST = 30  # lines of code


def example(text):
    """The section "Example" of a page, or the whole page."""
    _, is_there, rest = text.partition("\n## Example\n")
    return rest.partition("\n## ")[0] if is_there else text


def blocks(page):
    text = example((DOCS / f"{page}.md").read_text("utf-8"))
    found = re.findall(r"```(\w+)\n(.*?)```", text, re.DOTALL)
    return sorted(found, key=lambda block: block[0] != "toml")


def run(language, text):
    if language == "toml":
        Path(text.partition("\n")[0].removeprefix("# ")).write_text(text, encoding="utf-8")
    elif language == "python":
        exec(compile(text, "how-to", "exec"), {})
    else:
        for line in text.replace("\\\n", "").splitlines():
            quiet = ["--quiet"] * ("plan" not in line)
            assert cli.main([*shlex.split(line)[1:], *quiet]) == 0


@pytest.mark.slow
@pytest.mark.parametrize("page", WRITTEN)
def test_a_how_to_does_what_it_says(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SkinwaveWarning)  # coarse elements, on purpose
        for language, text in blocks(page):
            assert len(text.splitlines()) <= LONGEST
            run(language, text)
    assert [name for name in WRITTEN[page] if not Path(name).exists()] == []
