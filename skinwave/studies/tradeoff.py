"""Error against time of every model on one scene, over its discretisation parameters.

The reference is the finest fem run or, of a sheet that stretches, the finest run of
`plate-modes-nonlinear`. Errors are of the worst probe's waveform.
"""

import os
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from simple_model import Response
from skinwave.bodies.sizes import default_size
from skinwave.models import named, names
from skinwave.models.flat_body import FLAT_BODY
from skinwave.models.limits import takes
from skinwave.models.linear_elements import FEM
from skinwave.models.plate_modes import FROM_REST, STRETCHED
from skinwave.models.plate_modes import MODES as PLATES
from skinwave.models.reduced import REDUCTION_TOLERANCE, answer, prepare
from skinwave.planning.estimates import has_wavenumber_solution
from skinwave.planning.left_out import beyond_linear
from skinwave.planning.simulate import compute
from skinwave.report.figures import png
from skinwave.results.comparison import compare
from skinwave.scene.scene import Scene, check_load
from skinwave.system.document import Picture, Report
from skinwave.system.effort import Progress, peak_memory
from skinwave.system.processes import pool
from skinwave.system.table import Column, Table

REFINEMENTS = (2.6, 2.0, 1.6, 1.3, 1.0)  # element size over the default one
FINEST = (0.6, 0.5)  # of the two runs whose difference decides whether the reference is accepted
TOLERANCES, FINEST_STEPS = (0.3, 0.05, 0.02), (0.01, 0.003)  # the same of plates that stretch
BARS = (0.01, 0.05, 0.20)
PLANNED = 0.05  # tolerance of a candidate that has none
CAPTION = (
    "Worst probe's waveform error against the reference, over the time of a first response (cold) "
    "and of a further one on the same body (warm). The area of a marker is the peak memory. A "
    "black edge marks the Pareto front: no other candidate is as accurate and as fast both times."
)


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """Model and its discretisation: element size in metre, tolerance of its reduction or its steps
    and modes, and time step in s.
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
class Measured:
    """A candidate's relative error at the worst probe, wall seconds `cold` and `warm`, peak memory
    in bytes and degrees of freedom.
    """

    candidate: Candidate
    error: float
    cold: float
    warm: float
    memory: int
    dofs: int

    def beats(self, other: "Measured") -> bool:
        """Whether it is as accurate and as fast, cold and warm, and better in one of these."""
        mine, theirs = ((m.error, m.cold, m.warm) for m in (self, other))
        return mine != theirs and all(a <= b for a, b in zip(mine, theirs, strict=True))


@dataclass(frozen=True, kw_only=True)
class Study:
    """All candidates, by cost, and how far the reference itself is converged."""

    measured: tuple[Measured, ...]
    reference: Candidate
    self_convergence: float

    @property
    def accepted(self) -> bool:
        """Whether two refinements differ by less than a tenth of the smallest error reported."""
        return self.self_convergence < 0.1 * min(m.error for m in self.measured)

    def front(self) -> list[Measured]:
        """Pareto front: candidates that no other beats in error, cold and warm time at once."""
        return [m for m in self.measured if not any(o.beats(m) for o in self.measured)]

    def cheapest(self, bar: float) -> Measured | None:
        """The cheapest candidate with an error within the tolerance."""
        return next((m for m in self.measured if m.error <= bar), None)


def candidates(scene: Scene) -> list[Candidate]:
    """Every model that can compute the scene, over the discretisation parameters it has."""
    h = default_size(scene.body)
    sizes = [round(h * factor, 6) for factor in REFINEMENTS]
    found = [Candidate(model="point-kernel")]
    if has_wavenumber_solution(scene):
        found += [Candidate(model=f"flat-body{how}") for how in ("-harmonic", "")]
    if takes(STRETCHED, scene):
        found += [Candidate(model=each.name) for each in (PLATES, FROM_REST)]
        found += [Candidate(model=STRETCHED.name, tolerance=t) for t in TOLERANCES]
        return found + [Candidate(model="fem", h=size) for size in sizes[:2] if takes(FEM, scene)]
    found += [Candidate(model="fem", h=size) for size in sizes]
    found += [Candidate(model="fem", h=sizes[2], tolerance=t) for t in (0.3, 0.03)]
    if scene.body.air:
        return found
    found += [Candidate(model="fem-transient", h=sizes[2], dt=dt) for dt in (1e-3, 5e-4, 2e-4)]
    return [*found, Candidate(model="fem-harmonic", h=sizes[1])]


def study(scene: Scene, progress: Progress, chosen: Iterable[Candidate] | None = None) -> Study:
    """Measure candidates on a scene, each in a process of its own so that memory is its own.

    Raises
    ------
    ValueError
        If the scene has no body, or another load than a pressure.
    """
    check_load(scene, "tradeoff")
    if not scene.body.of_kind.discretise:
        raise ValueError("a scene without a body has one model only; give it a sheet or a slab")
    todo = list(chosen or candidates(scene))
    fine = [Candidate(model="fem", h=round(default_size(scene.body) * f, 6)) for f in FINEST]
    if beyond_linear(scene, min(BARS)):
        fine = [Candidate(model=STRETCHED.name, tolerance=t) for t in FINEST_STEPS]
    results = {}
    with pool(1, threads=None, renewed=True) as other:
        for k, candidate in enumerate([*fine, *todo]):
            progress(candidate.name, k / (len(todo) + len(fine)))
            results[candidate.name] = other.submit(_run, scene, candidate).result()
    coarser, reference = (results[each.name][0] for each in fine)
    measured = [_measured(each, reference, *results[each.name]) for each in todo]
    return Study(
        measured=tuple(sorted(measured, key=lambda m: m.cold)), reference=fine[-1],
        self_convergence=float(compare(reference, coarser).relative_l2.max()),
    )  # fmt: skip


def _run(scene: Scene, candidate: Candidate) -> tuple[Response, float, float, int]:
    """A candidate's response, its first and second time, and the peak memory of its process."""
    os.environ["SKINWAVE_CACHE"] = ""  # a cold run
    started = time.perf_counter()
    if named(candidate.model).is_reduced:
        prepared = prepare(
            scene.body, scene.probe_points, h=candidate.h, reading=scene.reading,
            tolerance=candidate.tolerance or REDUCTION_TOLERANCE,
        )  # fmt: skip
        response, ready = answer(prepared, scene), time.perf_counter()
        answer(prepared, scene)
        return response, ready - started, time.perf_counter() - ready, peak_memory()
    tolerance = candidate.tolerance or PLANNED
    response = compute(scene, candidate.model, tolerance=tolerance, h=candidate.h, dt=candidate.dt)
    cold = time.perf_counter() - started
    return response, cold, cold, peak_memory()


def _measured(
    candidate: Candidate, reference: Response, response: Response, cold: float, warm: float,
    memory: int,
) -> Measured:  # fmt: skip
    return Measured(
        candidate=candidate, error=float(compare(reference, response).relative_l2.max()),
        cold=cold, warm=warm, memory=memory, dofs=response.effort.dofs,
    )  # fmt: skip


def write(folder: Path, scene: Scene, found: Study) -> None:
    """index.html, tradeoff.png and tradeoff.csv of a study."""
    front = found.front()
    table = Table(
        ["candidate", Column("front", "on the front"), Column("error_percent", "error", "%"),
         Column("cold_s", "cold", "s", digits=2), Column("warm_s", "warm", "s", digits=2),
         Column("memory_mib", "peak memory", "MiB"), "dofs"],
        [(m.candidate.name, m in front, 100 * m.error, m.cold, m.warm, m.memory / 2**20, m.dofs)
         for m in found.measured], name="tradeoff",
    )  # fmt: skip
    picture = Picture(png(_figure(found), dpi=130), CAPTION, "tradeoff")
    title = f"Speed against accuracy: {scene.name}"
    said = sentences(found)
    verdict = [" ".join(said[-len(BARS) :]), " ".join(said[: -len(BARS)])]
    Report(title, verdict, [picture, table]).write(folder)


def sentences(found: Study) -> list[str]:
    """Results of the study, in sentences."""
    own = f"{100 * found.self_convergence:.2g} %"
    said = [f"The reference, {found.reference.name}, differs from the next coarser by {own}."]
    if not found.accepted:
        limit = f"{1000 * found.self_convergence:.2g} %"
        said[0] += f" Errors below {limit} are therefore upper estimates."
    if any(m.candidate.model == FLAT_BODY.name for m in found.measured):
        said.append(
            "flat-body is the analytic solution of a laterally infinite body; it differs from the "
            "meshed body by reflections at the sides."
        )
    for bar in BARS:
        best = "none of these"
        if m := found.cheapest(bar):
            best = f"{m.candidate.name}, {m.cold:.2g} s (error {100 * m.error:.2g} %)"
        said.append(f"Within {100 * bar:g} %: {best}.")
    return said


def _figure(found: Study) -> Figure:
    """Error against seconds, cold and warm, one colour a model."""
    drawing = Figure(figsize=(10, 5.2), layout="constrained")
    panels = drawing.subplots(1, 2, sharey=True)
    front = found.front()
    for ax, when in zip(panels, ("cold", "warm"), strict=True):
        for model in names():
            if mine := [m for m in found.measured if m.candidate.model == model]:
                ax.scatter(
                    [getattr(m, when) for m in mine], [100 * m.error for m in mine],
                    s=[20 + m.memory / 2**22 for m in mine], color=named(model).colour,
                    alpha=0.75, label=model, edgecolors="black",
                    linewidths=[1.5 * (m in front) for m in mine],
                )  # fmt: skip
        ax.axhline(100 * found.self_convergence, color="0.5", ls=":", lw=1,
                   label="finest two runs differ")  # fmt: skip
        ax.set(xscale="log", yscale="log")
        ax.grid(alpha=0.3, which="both")
    panels[0].set(xlabel="first response (cold), s", ylabel="worst probe's error, %")
    panels[1].set(xlabel="next response on the same body (warm), s")
    legend = panels[1].legend(title="area: peak memory")
    for handle in legend.legend_handles:
        if handle is not None and hasattr(handle, "set_sizes"):
            handle.set_sizes([50])
            handle.set_linewidth(0)
    return drawing
