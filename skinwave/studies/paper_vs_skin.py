"""Paper versus skin: which mechanism causes which spectral line of the 15 Tactons.

Lim, Seifi and Park (CHI EA '24) measured lines on paper that their model lacks. Here the same
Tactons act as a linear load, as the squared amplitude of the sound, and on a sheet that stretches
as it bends. One Tacton also acts at a quarter, a half and the whole of its amplitude: a line of the
load keeps its ratio to f_AM when the drive is reduced, a line of the sheet does not.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from simple_model import MovingPressure, Response, Tacton, Trajectory, lines, resolved_lines
from skinwave.models.options import SolveOptions
from skinwave.models.plate_modes import FROM_REST, STRETCHED
from skinwave.models.reduced import answer, reduce_scene
from skinwave.planning.simulate import compute
from skinwave.report.figures import png
from skinwave.report.palette import colour, label, marker
from skinwave.results.run import ASSESSED
from skinwave.scene.paper15 import MEASURED_ON, tactons
from skinwave.scene.scene import BODIES, STILL, Body, Scene
from skinwave.system.document import Details, Picture, Report
from skinwave.system.effort import Progress
from skinwave.system.failures import failure_text, or_failed
from skinwave.system.table import Column, Table


@dataclass(frozen=True, kw_only=True)
class Findings:
    """Levels in dB re the strongest line of a run, by (Tacton, line) and mechanism; ratios of 2
    f_AM to f_AM at the `amplitudes`, by mechanism; and reasons of failed runs.
    """

    levels: Mapping[tuple[str, str], Mapping[str, float]]
    ratios: Mapping[str, tuple[float, ...]]
    amplitudes: tuple[float, ...]
    failures: Mapping[str, str] = field(default_factory=dict)
    negligible_ratio: float = 1e-5  # of 2 f_AM to f_AM


def paper_vs_skin(
    progress: Progress,
    *,
    h: float | None = None,
    patterns: Iterable[tuple[str, Tacton]] | None = None,
    bodies: Mapping[str, Body] | None = None,
    duration: float = 0.5,
    amplitudes: tuple[float, ...] = (0.25, 0.5, 1.0),
    am_frequency: float = 140.0,
) -> Findings:
    """Run Tactons by each mechanism on bodies, with solid elements of size h in m.

    By default these are the paper's 15 Tactons on `paper15.MEASURED_ON`. Of the `duration` in s the
    later half is evaluated. A Tacton at rest with `am_frequency` in Hz has several `amplitudes`.
    """
    bodies = bodies or {name: BODIES[name] for name in MEASURED_ON}
    chosen = [(n, replace(t, duration=duration)) for n, t in (patterns or tactons())]
    still = Tacton(am_frequency=am_frequency, duration=duration, trajectory=Trajectory())
    levels: dict[tuple[str, str], dict[str, float]] = {}
    ratios: dict[str, tuple[float, ...]] = {}
    failures: dict[str, str] = {}
    for body_name, body in bodies.items():
        mechanisms: list[Mechanism] = []
        with or_failed(failures, label(body_name)):
            mechanisms = _mechanisms(body, h, progress)
        for cause, drive, solve in mechanisms:
            mechanism = f"{label(body_name)}: {cause}"
            settled = partial(_steady_half, solve, body, drive)
            for k, (name, tacton) in enumerate(chosen):
                progress(mechanism, k / (len(chosen) + 1))
                with or_failed(failures, f"{name} on {mechanism}"):
                    for line, level in _levels(*settled(tacton)).items():
                        levels.setdefault((name, line), {})[mechanism] = level
            scaled = [replace(still, amplitude=amplitude) for amplitude in amplitudes]
            with or_failed(failures, f"ratios of {mechanism}"):
                both = (lines(settled(t)[1], [am_frequency, 2 * am_frequency]) for t in scaled)
                ratios[mechanism] = tuple(float(twice[0] / once[0]) for once, twice in both)
    if not levels:
        raise ValueError(failure_text(failures))
    return Findings(levels=levels, ratios=ratios, amplitudes=amplitudes, failures=failures)


Mechanism = tuple[str, str, Callable[[Scene], Response]]  # its name, its drive, and its model


def _mechanisms(body: Body, h: float | None, progress: Progress) -> list[Mechanism]:
    """Return the mechanisms that may cause lines on a body."""
    others: list[Mechanism] = []
    if body.of_kind.is_plate:
        linear, stretching = (partial(compute, model=m.name) for m in (FROM_REST, STRETCHED))
        others = [("squared load, stretching", "pressure_squared", stretching)]
    else:
        still = Scene(pressure=STILL, body=body)
        linear = partial(answer, reduce_scene(still, SolveOptions(h=h, progress=progress)))
    squared = ("squared load", "pressure_squared", linear)
    return [("linear load", "linear", linear), squared, *others]


def _steady_half(
    solve: Callable[[Scene], Response], body: Body, drive: str, tacton: Tacton
) -> tuple[MovingPressure, Response]:
    """Return the load of a Tacton, and the later half of its response, after the transient."""
    pressure = MovingPressure(tacton=tacton, drive=drive)
    response = solve(Scene(pressure=pressure, body=body))
    half = len(response.times) // 2
    times = response.times[half:] - response.times[half]
    return pressure, replace(response, times=times, values=response.values[half:])


def _levels(pressure: MovingPressure, later: Response) -> dict[str, float]:
    """Return lines in dB re the strongest, at the probe where each is strongest.

    They include the lines of claims, because a stretching sheet has lines that its load does not.
    """
    highest = 700.0  # Hz
    names, _ = resolved_lines(pressure, later, candidates=ASSESSED, highest=highest)
    amplitudes = lines(later, list(names.values())).max(axis=1)
    with np.errstate(divide="ignore"):
        levels = 20 * np.log10(amplitudes / amplitudes.max(initial=np.finfo(float).tiny))
    return {name: float(level) for name, level in zip(names, levels, strict=True)}


def load_ratios() -> dict[str, tuple[float, ...]]:
    """Return the amplitudes at 2f, 3f and 4f relative to that at f, for each law of the load.

    The response of a body changes these ratios.
    """
    m = np.sin(2 * np.pi * (np.arange(4096) + 0.5) / 4096)  # one period of the modulation
    loads = {
        "force follows the command, with a mean": (1 + m) / 2,
        "square of the sound's amplitude": ((1 + m) / 2) ** 2,
        "contact on one side only": np.maximum(m, 0),
        "clipped sound, squared": np.maximum(m, 0) ** 2,
        "square root of the command": np.sqrt((1 + m) / 2),
    }
    spectra = {name: np.abs(np.fft.rfft(load)) for name, load in loads.items()}
    return {name: tuple((a[2:5] / a[1]).tolist()) for name, a in spectra.items()}


def sentences(findings: Findings) -> list[str]:
    """Return conclusions: explained lines, unexplained lines, and the deciding experiment."""
    parts, low = [], f"{100 * findings.amplitudes[0]:.0f}"
    negligible_change = 1e-3  # relative, of a ratio over the amplitudes
    for mechanism, ratios in findings.ratios.items():
        if max(ratios) < findings.negligible_ratio:
            parts.append(f"{mechanism}: no 2 f_AM at any amplitude.")
        elif max(ratios) < (1 + negligible_change) * min(ratios):
            parts.append(
                f"{mechanism}: 2 f_AM is {ratios[-1]:.3f} of f_AM at {low} to 100 % of the "
                "amplitude. It is a line of the load."
            )
        else:
            parts.append(
                f"{mechanism}: 2 f_AM is {ratios[0]:.3g} of f_AM at {low} % of the amplitude and "
                f"{ratios[-1]:.3g} at 100 %. It is a line of both sheet and load."
            )
    return [
        *parts,
        "Linear waves add no line to those of the load. Multiples of both f_AM and f_d need a load "
        "with a mean. Contact and clipping were not simulated; the table shows their patterns.",
        "One experiment decides: the same Tacton at half and at full amplitude. If 2 f_AM / f_AM "
        "stays the same, the drive causes the line; if it grows, the sheet does.",
    ]


def report(findings: Findings) -> Report:
    """Return the page: conclusions, ratio over amplitude, lines by mechanism, patterns of loads."""
    caption = "Ratio of 2 f_AM to f_AM at the focus over the amplitude of the drive."
    weakest = -100.0  # dB re the strongest line of a run: weaker lines are round-off
    strong = {
        key: {name: level for name, level in own.items() if level > weakest}
        for key, own in findings.levels.items()
    }
    levels = Table(
        ["Tacton", "line", *(Column(each, unit="dB", digits=2) for each in findings.ratios)],
        [[*key, *map(own.get, findings.ratios)] for key, own in strong.items()], name="lines",
    )  # fmt: skip
    ratios = Table(
        ["mechanism", *(f"{100 * each:.0f} %" for each in findings.amplitudes)],
        [[mechanism, *own] for mechanism, own in findings.ratios.items()], name="ratios",
    )  # fmt: skip
    patterns = Table(
        ["load", "2f / f", "3f / f", "4f / f"], [[n, *own] for n, own in load_ratios().items()]
    )
    conclusions = sentences(findings)
    return Report(
        title="Paper and skin: which mechanism causes which line",
        verdict=conclusions[-2:],
        parts=[
            *conclusions[:-2],
            Picture(png(_figure(findings), dpi=130), caption, name="amplitude"),
            Details("2 f_AM over f_AM by amplitude", [ratios]),
            Details("Lines by mechanism", [levels]),
            Details("Patterns of loads", [patterns]),
        ],
        failures=findings.failures,
    )  # fmt: skip


def _figure(findings: Findings) -> Figure:
    """Draw 2 f_AM / f_AM over amplitude for each mechanism that has the line."""
    figure = Figure(figsize=(7, 4), layout="constrained")
    axes = figure.add_subplot()
    names = {label(name): name for name in BODIES}
    curves = {m: r for m, r in findings.ratios.items() if max(r) > findings.negligible_ratio}
    for mechanism, own in curves.items():
        body, _, cause = mechanism.partition(": ")
        name = names.get(body, body)
        axes.plot(
            100 * np.array(findings.amplitudes), own, marker=marker(name), color=colour(name),
            linestyle="--" if "stretching" in cause else "-", label=mechanism,
        )  # fmt: skip
    axes.set(xlabel="amplitude of the drive, %", ylabel=r"$2 f_{AM}$ / $f_{AM}$", yscale="log")
    axes.grid(alpha=0.3)
    if curves:
        figure.legend(loc="outside lower center", ncols=2, frameon=False)
    return figure
