"""Mechanisms behind spectral lines: the 15 Tactons on paper and on skin, one cause at a time.

Lim, Seifi and Park (CHI EA '24) measured lines on paper that their model lacks. Here the same
Tactons are driven by a linear load, by the square of the sound's amplitude, and on a sheet that
stretches as it bends; and at a quarter, a half and the whole of the amplitude, because a line of
the load keeps its ratio to f_AM when the drive is turned down, and a line of the sheet does not.
"""

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from meshes.tetmesh import Floats
from simple_model import MovingPressure, Response, Tacton, Trajectory, lines, resolved_lines
from skinwave.models.plate_modes import FROM_REST
from skinwave.models.prepared import answer, prepare
from skinwave.models.stretched_plate import STRETCHED
from skinwave.planning.simulate import compute
from skinwave.report.figures import png
from skinwave.results.run import ASSESSED
from skinwave.scene.paper15 import MEASURED_ON, tactons
from skinwave.scene.scene import BODIES, PROBES, Body, Scene
from skinwave.system import document
from skinwave.system.effort import Progress
from skinwave.system.plain_text import csv_table

DURATION = 0.5  # s of each Tacton, of which the later half is read
AMPLITUDES = (0.25, 0.5, 1.0)
AM = 140.0  # Hz of the Tacton whose amplitude is varied
STEADY = 1e-3  # relative change of a ratio that counts as none
HARMONICS = 4
# Loads over one period of the modulation m = sin, relative to the largest: each has its own ratios
# 2f/f, 3f/f and 4f/f, before the response of the body changes them.
SIGNATURES: Mapping[str, Callable[[Floats], Floats]] = {
    "force follows the command, with a mean": lambda m: (1 + m) / 2,
    "square of the sound's amplitude": lambda m: ((1 + m) / 2) ** 2,
    "contact on one side only": lambda m: np.maximum(m, 0),
    "clipped sound, squared": lambda m: np.maximum(m, 0) ** 2,
    "square root of the command": lambda m: np.sqrt((1 + m) / 2),
}


@dataclass(frozen=True, kw_only=True)
class MechanismLine:
    """Amplitude in metre of a line at the probe where it is strongest, by one mechanism."""

    tacton: str
    body: str
    mechanism: str
    line: str
    frequency: float
    amplitude: float


@dataclass(frozen=True, kw_only=True)
class Ratio:
    """2 f / f on a body at one amplitude of the drive, by one mechanism."""

    body: str
    mechanism: str
    amplitude: float
    ratio: float


@dataclass(frozen=True, kw_only=True)
class Findings:
    """Lines of every Tacton, ratios of one at several amplitudes, and which runs failed."""

    lines: tuple[MechanismLine, ...]
    ratios: tuple[Ratio, ...]
    failed: tuple[str, ...] = ()


def paper_vs_skin(
    progress: Progress,
    *,
    h: float | None = None,
    chosen: Iterable[tuple[str, Tacton]] | None = None,
    bodies: Mapping[str, Body] | None = None,
) -> Findings:
    """Run the Tactons, or chosen ones by name, through the mechanisms on paper and on skin.

    Parameters
    ----------
    h : float, metre, element size of solids; that of the body if not given
    """
    on = dict(bodies or {name: BODIES[name] for name in MEASURED_ON})
    patterns = [(n, replace(t, duration=DURATION)) for n, t in (chosen or tactons())]
    still = Tacton(am_frequency=AM, duration=DURATION, trajectory=Trajectory())
    found: list[MechanismLine] = []
    ratios: list[Ratio] = []
    failed: list[str] = []
    for body_name, body in on.items():
        for mechanism, (drive, ask) in _mechanisms(body, h, progress, body_name).items():
            for k, (name, tacton) in enumerate(patterns):
                progress(f"{body_name}: {mechanism}", k / (len(patterns) + len(AMPLITUDES)))
                scene = _scene(name, tacton, body, drive)
                try:
                    response = ask(scene)
                except ArithmeticError as error:
                    failed.append(f"{name} on {body_name}, {mechanism}: {error}")
                    continue
                found += _lines(name, body_name, mechanism, scene.pressure, response)
            for amplitude in AMPLITUDES:
                quiet = replace(still, amplitude=amplitude)
                response = ask(_scene("amplitude", quiet, body, drive))
                f, twice = lines(steady(response), [AM, 2 * AM])[:, 0]
                found_by = {"body": body_name, "mechanism": mechanism}
                ratios.append(Ratio(**found_by, amplitude=amplitude, ratio=float(twice / f)))
    return Findings(lines=tuple(found), ratios=tuple(ratios), failed=tuple(failed))


def _mechanisms(
    body: Body, h: float | None, progress: Progress, name: str
) -> Mapping[str, tuple[str, Callable[[Scene], Response]]]:
    """Mechanism -> drive law, and the function that computes a scene's response with it."""

    def report(phase: str, done: float) -> None:
        progress(f"{name}: {phase}", done)

    if not body.of_kind.is_plate:
        linear = partial(answer, prepare(body, np.array(PROBES), report, h=h))
        return {"linear load": ("linear", linear), "squared load": ("pressure_squared", linear)}
    bending, stretching = (partial(compute, model=each.name) for each in (FROM_REST, STRETCHED))
    return {
        "linear load": ("linear", bending),
        "squared load": ("pressure_squared", bending),
        "squared load, stretching": ("pressure_squared", stretching),
    }


def _scene(name: str, tacton: Tacton, body: Body, drive: str) -> Scene:
    return Scene(name=name, pressure=MovingPressure(tacton=tacton, drive=drive), body=body)


def steady(response: Response) -> Response:
    """The later half of a response, after the transient."""
    times, half = response.times, len(response.times) // 2
    later = response.values[half:]
    return replace(response, times=times[half:] - times[half], values=later)


def _lines(
    tacton: str, body: str, mechanism: str, pressure: MovingPressure, response: Response
) -> list[MechanismLine]:
    # A stretching sheet has lines that no load has: those that claims are about are looked for.
    later = steady(response)
    names, _ = resolved_lines(pressure, later, candidates=ASSESSED, highest=700.0)
    amplitudes = lines(later, list(names.values())).max(axis=1)
    return [
        MechanismLine(tacton=tacton, body=body, mechanism=mechanism, line=name, frequency=f,
             amplitude=float(a))
        for (name, f), a in zip(names.items(), amplitudes, strict=True)
    ]  # fmt: skip


def signatures() -> dict[str, tuple[float, ...]]:
    """Load -> its amplitudes at 2f, 3f and 4f over that at f."""
    m = np.sin(2 * np.pi * (np.arange(4096) + 0.5) / 4096)
    found = {}
    for name, load in SIGNATURES.items():
        amplitude = np.abs(np.fft.rfft(load(m)))
        found[name] = tuple(float(a) for a in amplitude[2 : HARMONICS + 1] / amplitude[1])
    return found


def sentences(found: Findings) -> list[str]:
    """Conclusions: lines explained, lines not explained, and the experiment that would decide."""
    said = []
    for body in dict.fromkeys(r.body for r in found.ratios):
        for mechanism in dict.fromkeys(r.mechanism for r in found.ratios if r.body == body):
            mine = [r for r in found.ratios if (r.body, r.mechanism) == (body, mechanism)]
            values = [r.ratio for r in mine]
            change = max(values) / max(min(values), 1e-300) - 1
            if max(values) < 1e-5:
                said.append(f"{body}, {mechanism}: no 2 f_AM at any amplitude.")
            elif change < STEADY:
                said.append(
                    f"{body}, {mechanism}: 2 f_AM is {values[-1]:.3f} of f_AM, the same from "
                    f"{100 * AMPLITUDES[0]:.0f} to 100 % of the amplitude: a line of the load."
                )
            else:
                said.append(
                    f"{body}, {mechanism}: 2 f_AM goes from {values[0]:.3g} to {values[-1]:.3g} "
                    f"of f_AM as the amplitude goes from {100 * AMPLITUDES[0]:.0f} to 100 %: a "
                    "line of the sheet as well as of the load."
                )
    said.append(
        "Linear waves add no line to those of the load; multiples of f_AM and of f_d together "
        "need a load with a mean. Contact and clipping are known by their pattern only (table): "
        "they were not simulated."
    )
    said.append(
        "What would decide: the same Tacton at a half and at the whole of the amplitude. A ratio "
        "2 f_AM / f_AM that stays comes from the drive, one that grows from the sheet."
    )
    return said


def write(folder: Path, found: Findings) -> None:
    """index.html, amplitude.png, lines.csv and mechanisms.json."""
    (folder / "mechanisms.json").write_text(json.dumps(asdict(found), indent=1), encoding="utf-8")
    header = ["tacton", "body", "mechanism", "line", "frequency_hz", "displacement_um"]
    rows = (
        [x.tacton, x.body, x.mechanism, x.line, f"{x.frequency:.6g}", f"{1e6 * x.amplitude:.6g}"]
        for x in found.lines
    )
    (folder / "lines.csv").write_bytes(csv_table(header, rows))
    drawn = png(figure(found.ratios), dpi=130)
    (folder / "amplitude.png").write_bytes(drawn)
    parts = [
        *map(document.paragraph, sentences(found)),
        *(document.paragraph(f"Failed: {said}.") for said in found.failed),
        document.picture(drawn, "2 f_AM over f_AM at the focus against the amplitude."),
        document.section("Lines by mechanism", document.table(*line_table(found))),
        document.section("Patterns of loads", document.table(*signature_table())),
    ]
    page = document.page("Paper and skin: which mechanism makes which line", *parts)
    (folder / "index.html").write_text(page, encoding="utf-8")


def line_table(found: Findings) -> tuple[list[str], list[list[str]]]:
    """Header and rows: dB re the strongest line of the same run, by mechanism."""
    mechanisms = list(dict.fromkeys((x.body, x.mechanism) for x in found.lines))
    loudest: dict[tuple[str, str, str], float] = {}
    amplitude: dict[tuple[str, str, str, str], float] = {}
    for x in found.lines:
        run = (x.tacton, x.body, x.mechanism)
        loudest[run] = max(loudest.get(run, 1e-300), x.amplitude)
        amplitude[(*run, x.line)] = x.amplitude
    rows = []
    for tacton, line in dict.fromkeys((x.tacton, x.line) for x in found.lines):
        cells = []
        for body, mechanism in mechanisms:
            value = amplitude.get((tacton, body, mechanism, line), 0.0)
            decibel = 20 * np.log10(max(value / loudest.get((tacton, body, mechanism), 1), 1e-9))
            cells.append(f"{decibel:.0f}" if decibel > -100 else "none")
        rows.append([tacton, line, *cells])
    header = ["Tacton", "line", *(f"{body}: {mechanism}, dB" for body, mechanism in mechanisms)]
    return header, rows


def signature_table() -> tuple[list[str], list[list[str]]]:
    """Header and rows of the loads' own ratios."""
    rows = [[name, *(f"{r:.3f}" for r in ratios)] for name, ratios in signatures().items()]
    return ["load", "2f / f", "3f / f", "4f / f"], rows


def figure(ratios: Iterable[Ratio]) -> Figure:
    """2 f / f against amplitude, a curve for each body and mechanism that has the line."""
    drawn = Figure(figsize=(7, 4), layout="constrained")
    axes = drawn.add_subplot()
    styles = {"paper-sheet": ("#D55E00", "s"), "skin-slab": ("#0072B2", "o")}
    curves: dict[tuple[str, str], list[Ratio]] = {}
    for ratio in ratios:
        curves.setdefault((ratio.body, ratio.mechanism), []).append(ratio)
    for (body, mechanism), mine in curves.items():
        if max(r.ratio for r in mine) < 1e-5:
            continue
        colour, marker = styles.get(body, ("#009E73", "^"))
        axes.plot([100 * r.amplitude for r in mine], [r.ratio for r in mine], marker=marker,
                  color=colour, linestyle="--" if "stretching" in mechanism else "-",
                  label=f"{body}: {mechanism}")  # fmt: skip
    axes.set(xlabel="amplitude of the drive, %", ylabel="2 f_AM / f_AM, displacement at the focus",
             yscale="log")  # fmt: skip
    axes.grid(alpha=0.3)
    if curves:
        drawn.legend(loc="outside lower center", ncols=2, frameon=False)
    return drawn
