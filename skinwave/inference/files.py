"""Files that are made of the tables of an inference: its page, its figures, scenes of sheets."""

from pathlib import Path
from typing import Any

from skinwave.inference import stretched_table
from skinwave.inference.nearest_sheets import sheets
from skinwave.inference.page import drawings, page
from skinwave.inference.scenes import scene_text
from skinwave.results.outputs import output_file
from skinwave.sweeps import dataset

PAGE = "index.html"
FIGURES = tuple(f"{name}.png" for name in ("shares", "rivals", "decides", "regions"))
SCENES = tuple(f"sheet-{number}.toml" for number in (1, 2, 3))


def refuse_changed(out: Path) -> None:
    """Refuse, before any work, to replace a file that was changed since skinwave wrote it.

    Raises
    ------
    ValueError
        If there is one.
    """
    for name in (PAGE, *FIGURES, *SCENES):
        dataset.refuse_changed(out, name)


def write(out: Path) -> list[dict[str, Any]]:
    """Write index.html, its figures and scenes of the best sheets; the rows they are made of."""
    rows = dataset.read(out)
    drawn, stretched = drawings(rows), stretched_table.read(out, rows)
    _replace(out, PAGE, page(rows, drawn, stretched).encode())
    for each in drawn:
        _replace(out, f"{each.name}.png", each.image)
    for name, row in zip(SCENES, sheets(rows), strict=False):
        _replace(out, name, scene_text(row).encode())
    return rows


def _replace(out: Path, name: str, content: bytes) -> None:
    dataset.refuse_changed(out, name)
    with output_file(out / name, overwrite=True) as file:
        file.write(content)
    dataset.enter(out, name)
