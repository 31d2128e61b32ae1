"""Section of a page, and tables, of an ensemble."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from meshes.tetmesh import Floats
from simple_model.load.line_names import line_frequency
from skinwave.report.figures import png
from skinwave.scene.scene import Scene
from skinwave.scene.spreads import Spread
from skinwave.sweeps.ensemble_figures import bands_figure, maps_figure, tornado_figure
from skinwave.sweeps.indices import Tornado, tornado
from skinwave.sweeps.propagate import (
    PERCENTILES,
    Ensemble,
    ensemble,
    outputs,
    percentiles,
    propagate,
)
from skinwave.sweeps.solutions import solve
from skinwave.system import document
from skinwave.system.effort import Progress
from skinwave.system.numbers import significant
from skinwave.system.plain_text import csv_table

COLUMNS = (
    "what", "frequency_hz", "unit", "probe_x_mm", "probe_y_mm", *(f"p{k}" for k in PERCENTILES)
)  # fmt: skip
BANDS = (
    "Bands of the samples at each time, and bars of each line: half of the samples within the dark "
    "part, nine of ten within all of it. Bands are of one time or one line each: no single sample "
    "follows their edge."
)
MAPS = (
    "Percentiles of the RMS motion at each place, and how many samples have a place above the "
    "threshold of detection; dotted: the path of the focus."
)
TOGETHER = ", nearly all of one reduced-order model, in the steady state"
TORNADO = (
    "One number at a time at the ends of the 90 % about its median, all others at their central "
    "values: the widest bar is what is worth measuring first."
)
NAMED = 12  # lines of the table


@dataclass(frozen=True, kw_only=True, eq=False)
class Uncertainty:
    """An ensemble, the waveform (t, p) of its central values, and its tornado charts by output."""

    found: Ensemble
    centre: Floats
    charts: Mapping[str, Tornado]


def uncertainty_of(
    scene: Scene,
    n: int,
    model: str,
    progress: Progress,
    *,
    h: float | None = None,
    solver: str = "auto",
    seed: int = 0,
    workers: int = 1,
) -> Uncertainty:
    """Ensemble of a scene, and its outputs with one number at a time at its ends.

    Parameters
    ----------
    scene, n, model, h, solver, seed, workers, progress : as for `propagate`

    Returns
    -------
    Uncertainty

    Raises
    ------
    ValueError
        As `propagate` does.
    """
    found = propagate(
        scene, n, model=model, h=h, solver=solver, seed=seed, workers=workers, progress=progress
    )

    def evaluate(values: Floats) -> Mapping[str, Floats]:
        return outputs(ensemble(scene, found.spreads, values, found.method))

    centre = solve(scene, found.method).waveform
    return Uncertainty(found=found, centre=centre, charts=tornado(evaluate, found.spreads))


def write(folder: Path, known: Uncertainty) -> list[str]:
    """percentiles.csv, samples.csv and figures of a folder; the parts of a page."""
    found = known.found
    (folder / "percentiles.csv").write_bytes(csv_table(COLUMNS, _percentile_rows(found)))
    header = [*(s.key for s in found.spreads), *outputs(found)]
    rows = np.column_stack([found.values, *outputs(found).values()])
    (folder / "samples.csv").write_bytes(csv_table(header, ([f"{x:.9g}" for x in r] for r in rows)))

    def picture(name: str, figure: Figure, caption: str) -> str:
        drawn = png(figure)
        (folder / f"{name}.png").write_bytes(drawn)
        return document.picture(drawn, caption, name)

    return [document.section("Uncertainty", *page_parts(known, picture))]


def page_parts(known: Uncertainty, picture: Callable[[str, Figure, str], str]) -> list[str]:
    """Sentences, tables and figures of an ensemble; `picture` makes a part of a page of a figure,
    with its name and caption.
    """
    found = known.found
    keys = [s.key for s in found.spreads]
    parts: list[str] = [document.paragraph(" ".join(sentences(found)))]
    parts.append(document.table(*spread_table(found.spreads)))
    parts.append(picture("bands", bands_figure(found, known.centre), BANDS))
    if found.has_map:
        parts.append(picture("bands-map", maps_figure(found), MAPS))
    parts.append(picture("tornado", tornado_figure(_shown(known), keys), TORNADO))
    parts.append(document.table(*line_table(found)))
    return parts


def sentences(found: Ensemble) -> list[str]:
    """Number of samples and method, and the 90 % of the motion, of its level and of the area."""
    n, d = found.values.shape
    how = "by the wavenumber integral, in the steady state" if found.method.mapped else (
        f"by {found.method.model}{TOGETHER if found.method.family else ''}"
    )  # fmt: skip
    p, asked = strongest(found), found.scene.reading.asked
    x, y = (1e3 * z for z in found.scene.probes[p])
    low, _, median, _, high = (
        significant(asked.per_unit * v) for v in percentiles(found.rms)[:, p]
    )
    said = [
        f"{n} samples of {d} uncertain number{'s' * (d > 1)}, {how}.",
        f"RMS at ({x:g}, {y:g}) mm: {median} {asked.shown}, in nine of ten {low} to {high}.",
    ]
    named = outputs(found)
    if (name := "highest sensation level at a probe, dB") in named:
        low, _, median, _, high = (f"{v:+.0f}" for v in percentiles(named[name]))
        share = 100 * float((named[name] >= 0).mean())
        said.append(
            f"Highest sensation level at a probe: {median} dB, in nine of ten {low} to {high} dB; "
            f"above threshold in {share:.0f} % of the samples."
        )
    return said


def strongest(found: Ensemble) -> int:
    """The probe of largest median RMS."""
    return int(np.argmax(np.median(found.rms, axis=0)))


def spread_table(spreads: tuple[Spread, ...]) -> tuple[list[str], list[list[str]]]:
    """Header and rows of the uncertain numbers, each with its distribution and who says so."""
    rows = [
        [s.key, significant(s.value), s.distribution.words, s.part,
         "the preset's sources" if s.implied else "the scene"]
        for s in spreads
    ]  # fmt: skip
    return ["uncertain number", "central value", "distribution", "part", "given by"], rows


def line_table(found: Ensemble) -> tuple[list[str], list[list[str]]]:
    """Header and rows of percentiles of the lines at the probe that moves most, the strongest
    first.
    """
    p, asked = strongest(found), found.scene.reading.asked
    bands = asked.per_unit * percentiles(found.lines)[..., p]
    order = np.argsort(-bands[2])[:NAMED]
    names, tacton = found.method.lines, found.scene.tacton
    rows = [
        [names[k], f"{line_frequency(tacton, names[k]) or 0.0:.1f}",
         *(significant(v) for v in bands[:, k])]
        for k in order
    ]  # fmt: skip
    x, y = (1e3 * z for z in found.scene.probes[p])
    shown = [f"{k} %, {asked.shown}" for k in PERCENTILES]
    return [f"line at ({x:g}, {y:g}) mm", "frequency, Hz", *shown], rows


def _shown(known: Uncertainty) -> dict[str, Tornado]:
    """Charts of the probe that moves most, and of all outputs that are of no single probe."""
    p = strongest(known.found)
    names = list(known.charts)
    probes = len(known.found.scene.probes)
    return {name: known.charts[name] for name in (names[p], *names[probes:])}


def _percentile_rows(found: Ensemble) -> Iterator[list[object]]:
    asked, tacton = found.scene.reading.asked, found.scene.tacton
    rms, level = asked.per_unit * percentiles(found.rms), percentiles(found.level)
    lines = asked.per_unit * percentiles(found.lines)
    skin = asked.is_normal and found.scene.reading.is_plain and found.scene.body.is_skin
    for p, (x, y) in enumerate(found.scene.probes):
        where = [f"{1e3 * x:.6g}", f"{1e3 * y:.6g}"]
        for k, name in enumerate(found.method.lines):
            frequency = f"{line_frequency(tacton, name) or 0.0:.6g}"
            yield [name, frequency, asked.shown, *where, *(f"{v:.6g}" for v in lines[:, k, p])]
        yield ["rms", "", asked.shown, *where, *(f"{v:.6g}" for v in rms[:, p])]
        if skin:
            yield ["sensation level", "", "dB", *where, *(f"{v:.6g}" for v in level[:, p])]
