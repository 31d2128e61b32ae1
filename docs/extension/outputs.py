"""Outputs of code: `<!-- output: alternative text -->` after a block adds what it prints and draws.

The blocks of a page run one after the other in an empty folder with a link to `examples/`. A scene
that begins with a comment such as `# scene.toml` is written there. Other blocks do not run.
"""

import base64
import contextlib
import io
import re
import shlex
import tempfile
import textwrap
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

ROOT = Path(__file__).parents[2]
BLOCK = re.compile(
    r"^```(?P<language>python|sh|toml)\n(?P<code>(?:# (?P<file>\S+\.toml)\n)?.*?)^```\n"
    r"(?P<mark>\n<!-- output(?:: (?P<alt>[^>]+))? -->\n)?",
    re.MULTILINE | re.DOTALL,
)
WIDTH = 100  # characters of a line of code


def with_outputs(text: str) -> str:
    """Return a Markdown page with the outputs of its marked blocks."""
    if "<!-- output" not in text:
        return text
    close_pictures()  # of others
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        Path("examples").symlink_to(ROOT / "examples")
        return BLOCK.sub(_run, text)


def _run(block: re.Match[str]) -> str:
    """Write the scene of a block, or return a block with its output."""
    if block["file"]:
        Path(block["file"]).write_text(block["code"], encoding="utf-8")
    if not block["mark"]:
        return block.group()
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # coarse elements, on purpose
        if block["language"] == "python":
            exec(compile(block["code"], "a block of a page", "exec"), {})
        else:
            _command_lines(block["code"])
    shown = block.group().removesuffix(block["mark"])
    if text := printed.getvalue().strip():
        lines = "\n".join(map(_wrapped, text.splitlines()))
        shown += f"\n```{{code-block}} text\n:class: output\n\n{lines}\n```\n"
    for png in drawn():
        if not block["alt"]:
            raise ValueError(f"A picture needs an alternative text after: {block['code']}")
        data = base64.b64encode(png).decode()
        shown += f"\n![{block['alt']}](data:image/png;base64,{data})\n"
    return shown


def _command_lines(code: str) -> None:
    from skinwave.commands.cli import main

    for line in code.replace("\\\n", "").splitlines():
        if main(shlex.split(line, comments=True)[1:]):
            raise ValueError(f"A command of a page failed: {line}")


def _wrapped(line: str) -> str:
    """Break a long line, with the rest below its last column."""
    columns = [0, *(each.end() for each in re.finditer(r" {2,}", line))]
    return textwrap.fill(line, WIDTH, subsequent_indent=" " * columns[-1])


def drawn() -> Iterator[bytes]:
    """Yield the open pictures of matplotlib and pyvista as PNG, and close them."""
    import matplotlib.pyplot as plt
    from pyvista.plotting.plotter import _ALL_PLOTTERS

    figures = [plt.figure(number).savefig for number in plt.get_fignums()]
    for save in (*figures, *(each.screenshot for each in _ALL_PLOTTERS.values())):
        file = io.BytesIO()
        save(file)
        yield file.getvalue()
    close_pictures()


def close_pictures() -> None:
    """Close all pictures of matplotlib and pyvista."""
    import matplotlib.pyplot as plt
    from pyvista import close_all

    plt.close("all")
    close_all()


def read(app: "Sphinx", page: str, source: list[str]) -> None:
    """Add outputs to the source of a page."""
    source[0] = with_outputs(source[0])


def setup(app: "Sphinx") -> dict[str, bool]:
    """Register the reader, after the one that changes links."""
    app.connect("source-read", read, priority=600)
    return {"parallel_read_safe": True}
