"""Error against time of every model on one scene, over its discretisation parameters.

The reference is the finest run of `fem` or, for a sheet that stretches, of `plate-modes-nonlinear`.
Errors are those of the worst probe's waveform.
"""

import os
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from simple_model import Response
from simple_model.numbers import percent
from skinwave.bodies.sizes import default_size
from skinwave.models import named, names
from skinwave.models.flat_body import FLAT_BODY, HARMONIC
from skinwave.models.limits import takes
from skinwave.models.linear_elements import FEM
from skinwave.models.options import SolveOptions
from skinwave.models.plate_modes import FROM_REST, STRETCHED
from skinwave.models.plate_modes import MODES as PLATES
from skinwave.models.reduced import answer, reduce_scene
from skinwave.planning.deflection import stretches
from skinwave.planning.simulate import compute
from skinwave.report.figures import legend, png
from skinwave.results.comparison import compare
from skinwave.scene.scene import Scene, check_load
from skinwave.system.document import Picture, Report
from skinwave.system.effort import Progress, peak_memory
from skinwave.system.failures import failure_text, or_failed
from skinwave.system.processes import pool
from skinwave.system.table import Column, Table


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """Model and its discretisation: element size in m, tolerance of its reduction or time
    integration, and time step in s.
    """

    model: str
    h: float | None = None
    tolerance: float | None = None
    dt: float | None = None

    @property
    def name(self) -> str:
        """Name in tables."""
        discretisation = [f"h = {1e3 * self.h:.2f} mm"] if self.h else []
        discretisation += [f"tolerance {self.tolerance:g}"] if self.tolerance else []
        discretisation += [f"dt = {1e3 * self.dt:g} ms"] if self.dt else []
        return ", ".join([self.model, *discretisation])


@dataclass(frozen=True, kw_only=True)
class Result:
    """Relative error of a candidate at the worst probe, seconds `cold` and `warm`, peak memory in
    bytes, and degrees of freedom.
    """

    candidate: Candidate
    error: float
    cold: float
    warm: float
    memory: int
    dofs: int

    def beats(self, other: "Result") -> bool:
        """Whether error, cold and warm time are no larger than the other's, and one is smaller."""
        own, others = ((m.error, m.cold, m.warm) for m in (self, other))
        return own != others and all(a <= b for a, b in zip(own, others, strict=True))


@dataclass(frozen=True, kw_only=True)
class Tradeoff:
    """Results of all candidates by cold time, and reasons of candidates that failed.

    `self_convergence` is the difference of the reference from the next coarser run; `bars` are the
    errors for which the page names the cheapest candidate.
    """

    results: tuple[Result, ...]
    reference: Candidate
    self_convergence: float
    failures: Mapping[str, str] = field(default_factory=dict)
    bars: tuple[float, ...] = (0.01, 0.05, 0.20)

    @property
    def is_converged(self) -> bool:
        """Whether the two finest runs differ by less than a tenth of the smallest error."""
        return self.self_convergence < 0.1 * min(m.error for m in self.results)

    def front(self) -> list[Result]:
        """Return the Pareto front in error, cold and warm time."""
        return [m for m in self.results if not any(o.beats(m) for o in self.results)]

    def cheapest(self, bar: float) -> Result | None:
        """Return the result of the fastest candidate with an error of `bar` at most, or None."""
        return next((m for m in self.results if m.error <= bar), None)


def candidates(scene: Scene) -> list[Candidate]:
    """Return every model that can compute the scene, over its discretisation parameters."""
    h = default_size(scene.body)
    refinements = (2.6, 2.0, 1.6, 1.3, 1.0)  # element size over the default one
    sizes = [round(h * factor, 6) for factor in refinements]
    every = [Candidate(model="point-kernel")]
    every += [Candidate(model=each.name) for each in (HARMONIC, FLAT_BODY) if takes(each, scene)]
    tolerances = (0.3, 0.05, 0.02)  # for stretching plates
    if takes(STRETCHED, scene):
        every += [Candidate(model=each.name) for each in (PLATES, FROM_REST)]
        every += [Candidate(model=STRETCHED.name, tolerance=t) for t in tolerances]
        return every + [Candidate(model="fem", h=size) for size in sizes[:2] if takes(FEM, scene)]
    every += [Candidate(model="fem", h=size) for size in sizes]
    every += [Candidate(model="fem", h=sizes[2], tolerance=t) for t in (0.3, 0.03)]
    if scene.body.air:
        return every
    every += [Candidate(model="fem-transient", h=sizes[2], dt=dt) for dt in (1e-3, 5e-4, 2e-4)]
    return [*every, Candidate(model="fem-harmonic", h=sizes[1])]


def tradeoff(
    scene: Scene, progress: Progress, chosen: Iterable[Candidate] | None = None, *,
    finest: Sequence[float] = (0.6, 0.5),
) -> Tradeoff:  # fmt: skip
    """Measure candidates on a scene, each in a process of its own, which measures its memory.

    `finest` are the element sizes of the two finest runs over the default one; the difference of
    these runs tests convergence. Raises a ValueError if the scene has no body, or a load other than
    a pressure, or if the reference or every candidate fails.
    """
    check_load(scene, "tradeoff")
    if not scene.body.of_kind.discretise:
        raise ValueError("a scene without a body has one model only. Give it a sheet or a slab")
    tested = list(chosen or candidates(scene))
    fine = [Candidate(model="fem", h=round(default_size(scene.body) * f, 6)) for f in finest]
    if stretches(scene, min(Tradeoff.bars)):
        fine = [Candidate(model=STRETCHED.name, tolerance=t) for t in (0.01, 0.003)]
    runs = {}
    failures: dict[str, str] = {}
    with pool(1, threads=None, renewed=True) as other:
        for k, candidate in enumerate([*fine, *tested]):
            progress(candidate.name, k / (len(tested) + len(fine)))
            with or_failed(failures, candidate.name):
                runs[candidate.name] = other.submit(_run, scene, candidate).result()
    if any(each.name in failures for each in fine) or len(failures) == len(tested):
        raise ValueError(failure_text(failures))
    coarser, reference = (runs[each.name][0] for each in fine)
    results = []
    for each in (one for one in tested if one.name in runs):
        response, cold, warm, memory = runs[each.name]
        error = float(compare(reference, response).relative_l2.max())
        results.append(Result(
            candidate=each, error=error, cold=cold, warm=warm, memory=memory,
            dofs=response.effort.dofs,
        ))  # fmt: skip
    return Tradeoff(
        results=tuple(sorted(results, key=lambda result: result.cold)), reference=fine[-1],
        self_convergence=float(compare(reference, coarser).relative_l2.max()), failures=failures,
    )  # fmt: skip


def _run(scene: Scene, candidate: Candidate) -> tuple[Response, float, float, int]:
    """Return a candidate's response, its cold and warm time, and the memory of its process."""
    os.environ["SKINWAVE_CACHE"] = ""  # no cache
    started = time.perf_counter()
    if named(candidate.model).is_reduced:
        size = SolveOptions(h=candidate.h)
        prepared = reduce_scene(scene, size, reduction=candidate.tolerance)
        response, ready = answer(prepared, scene), time.perf_counter()
        answer(prepared, scene)
        return response, ready - started, time.perf_counter() - ready, peak_memory()
    tolerance = candidate.tolerance or SolveOptions.tolerance
    response = compute(scene, candidate.model, tolerance=tolerance, h=candidate.h, dt=candidate.dt)
    cold = time.perf_counter() - started
    return response, cold, cold, peak_memory()


def write(folder: Path, scene: Scene, outcome: Tradeoff) -> None:
    """Write index.html, tradeoff.png and tradeoff.csv."""
    front = outcome.front()
    table = Table(
        ["candidate", Column("front", "on the front"), Column("error_percent", "error", "%"),
         Column("cold_s", "cold", "s", digits=2), Column("warm_s", "warm", "s", digits=2),
         Column("memory_mib", "peak memory", "MiB"), Column("dofs", "degrees of freedom")],
        [(m.candidate.name, m in front, 100 * m.error, m.cold, m.warm, m.memory / 2**20, m.dofs)
         for m in outcome.results], name="tradeoff",
    )  # fmt: skip
    caption = (
        "Error of the worst probe's waveform against the reference, over the time of a first "
        "response (cold) and of another one on the same body (warm). The area of a marker is the "
        "peak memory. A black edge marks the Pareto front: no other candidate is as accurate and "
        "as fast both times."
    )
    picture = Picture(png(_figure(outcome), dpi=130), caption, "tradeoff")
    title = f"Speed against accuracy: {scene.name}"
    parts, bars = sentences(outcome), len(outcome.bars)
    verdict = [" ".join(parts[-bars:]), " ".join(parts[:-bars])]
    Report(title, verdict, [picture, table], failures=outcome.failures).write(folder)


def sentences(outcome: Tradeoff) -> list[str]:
    """Return sentences on the reference, and on the cheapest candidate for each bar."""
    parts = [
        f"The reference, {outcome.reference.name}, differs from the next coarser run by "
        f"{percent(outcome.self_convergence)}."
    ]
    if not outcome.is_converged:
        limit = percent(10 * outcome.self_convergence)
        parts[0] += f" Errors below {limit} are therefore upper estimates."
    if any(m.candidate.model == FLAT_BODY.name for m in outcome.results):
        parts.append(
            "flat-body is the analytic solution of a laterally infinite body. It differs from the "
            "meshed body by the reflections from its sides."
        )
    for bar in outcome.bars:
        best = "no candidate"
        if m := outcome.cheapest(bar):
            best = f"{m.candidate.name}, {m.cold:.2g} s (error {percent(m.error)})"
        parts.append(f"Cheapest within {100 * bar:g} %: {best}.")
    return parts


def _figure(outcome: Tradeoff) -> Figure:
    """Draw error over cold and warm seconds, with one colour for each model."""
    figure = Figure(figsize=(10, 5.2), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    front = outcome.front()
    entries: dict[str, dict[str, Any]] = {}
    for model in names():
        if own := [m for m in outcome.results if m.candidate.model == model]:
            colour, edges = named(model).colour, [1.5 * (m in front) for m in own]
            entries[model] = {"color": colour, "marker": "o", "ms": 7, "ls": "", "alpha": 0.75}
            for ax, when in zip(panels, ("cold", "warm"), strict=True):
                ax.scatter(
                    [getattr(m, when) for m in own], [100 * m.error for m in own],
                    s=[20 + m.memory / 2**22 for m in own], color=colour, alpha=0.75,
                    edgecolors="black", linewidths=edges,
                )  # fmt: skip
    dotted = entries["difference of the two finest runs"] = {"color": "0.5", "ls": ":", "lw": 1}
    for ax in panels:
        ax.axhline(100 * outcome.self_convergence, **dotted)
        ax.set(xscale="log", yscale="log")
        ax.grid(alpha=0.3, which="both")
    panels[0].set(xlabel="first response (cold), s", ylabel="error of the worst probe, %")
    panels[1].set(xlabel="next response on the same body (warm), s")
    legend(figure, entries, 4)
    return figure
