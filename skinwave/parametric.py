"""Parametric reduced body: one offline stage for every material of a range.

`prepare` is that stage, for a scene and ranges of some of its keys. `lines` takes milliseconds:
Galerkin's equations of each line of the scene's load in a few states. `answer` is the waveform from
rest, by the poles of the reduced-order model; `at` is that model, for any other Tacton. Poisson's
ratios, geometry and mesh are fixed. The absorbing layer of a slab with absorbing sides is as wide
as the fastest shear waves need.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from scipy import sparse

import fem
from fem.affine import AffineOperators, Solids, assemble_affine, operators_of, weights
from fem.line_basis import LineBasis, line_bases, steady_lines
from fem.maxwell import with_internal
from fem.reduced_affine import AffineModel, reduce_affine, steady
from meshes import cache
from meshes.tetmesh import Floats
from simple_model import Effort, Response
from simple_model.load_spectrum import load_lines, pressure_lines
from simple_model.prony import FIT_TOLERANCE
from skinwave.bodies.build import Build
from skinwave.bodies.mounting import FRAME
from skinwave.bodies.sizes import default_size
from skinwave.effort import Clock, Progress, one_thread, peak_memory, silent
from skinwave.models.free_materials import (
    FreeKey,
    Reference,
    free_keys,
    meshed_materials,
    meshing_values,
    reference_of,
    solids_of,
    training_shares,
    values_at,
    with_values,
)
from skinwave.models.full import meshed, spent
from skinwave.models.laws import check_laws, relaxing
from skinwave.models.loads import line_factor, probe_rows, surface_load
from skinwave.models.parametric_cache import packed, unpacked
from skinwave.models.prepared import Prepared, entry_name, typical_spots
from skinwave.models.prepared import answer as answer_of
from skinwave.models.reduction import BAND, ReducedBody
from skinwave.scene import Body, Scene, check_load

TOLERANCE = 0.01  # relative error of a line that is not faint
SHARE = 0.4  # of the tolerance: of the reduced-order model, and of the lines' bases
FAINTEST = 1e-3  # of the strongest line that moves the probes: weaker ones are left out
MOST_LINES = 400
FORMAT = "parametric 1"  # of what is cached
ARRAYS = ("outputs", "load", "points", "frequencies")
INSIDE = 128  # materials inside the ranges, for the lines' bases


@dataclass(frozen=True, kw_only=True, eq=False)
class ParametricBody:
    """Reduced body of a scene for every material of a range.

    The `keys` that are free; the `reference` that was meshed; projected matrices `affine`, and in
    their coordinates what the probes read, `outputs` (p c, r), and reduced forces `load` (k, r) of
    unit pressure at the surface points (k, 3) in metre; `bases` (f,) of the lines at `frequencies`
    (f,) in Hz; and the `effort` of the offline stage, with the number of its factorisations.
    """

    scene: Scene
    keys: tuple[FreeKey, ...]
    reference: Reference
    affine: AffineOperators
    outputs: Floats
    load: Floats
    points: Floats
    frequencies: Floats
    bases: tuple[LineBasis, ...]
    effort: Effort


def prepare(
    scene: Scene,
    free: Mapping[str, tuple[float, float]],
    tolerance: float = TOLERANCE,
    progress: Progress | None = None,
    *,
    h: float | None = None,
    solver: str = "auto",
) -> ParametricBody:
    """Offline stage: reduce a scene's body once for all materials within ranges.

    Parameters
    ----------
    scene : Scene
    free : key of a scene file, such as "body.material.shear_modulus_pa" or
        "body.layers.0.material.viscosity_pa_s" -> its least and largest value, in the file's unit
    tolerance : float, relative error of each line of the load at the probes
    progress : called with the name of the phase and the fraction done
    h : float, metre, element size; the default of the body if not given
    solver : a backend of `fem.linear_solver`

    Returns
    -------
    ParametricBody

    Raises
    ------
    ValueError
        If a key cannot be free, the scene's probes read what depends on more than motion, or the
        tolerance is out of reach.
    """
    keys = free_keys(scene.body, free)
    _check(scene, tolerance)
    clock, report = Clock(), progress or silent
    body = relaxing(with_values(scene.body, keys, meshing_values(keys)), FIT_TOLERANCE)
    build = meshed(body, h, clock, report)
    reference = reference_of(body, build, keys)
    probes, _ = probe_rows(body, build, scene.probe_points, scene.reading)
    of_body = entry_name(body, build, scene.probe_points, solver, tolerance, outputs=probes)
    name = cache.key(FORMAT, of_body, scene.pressure, scene.reading, keys)
    with clock("read from cache"):
        entry = cache.load(name)
    if not entry:
        stage = _Stage(
            scene=scene, keys=keys, reference=reference, build=build, probes=probes,
            tolerance=tolerance, solver=solver,
        )  # fmt: skip
        entry = _reduced(stage, clock, report, h or default_size(body))
        cache.store(name, **entry)
    affine, bases = unpacked(entry, entry["outputs"])
    effort = Effort(**{**entry["meta"], "seconds": clock.seconds, "peak_memory": peak_memory()})
    return ParametricBody(
        scene=scene, keys=keys, reference=reference, affine=affine, bases=bases, effort=effort,
        **{array: entry[array] for array in ARRAYS},
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class _Stage:
    """Offline stage of a scene on its mesh; `probes` (p c, 3 n) is what they read."""

    scene: Scene
    keys: tuple[FreeKey, ...]
    reference: Reference
    build: Build
    probes: sparse.csr_array
    tolerance: float
    solver: str

    def training(self, inside: int) -> list[Solids]:
        """Materials over the ranges, with so many inside them."""
        shares = training_shares(len(self.keys), inside).tolist()
        values = (values_at(self.keys, each) for each in shares)
        bodies = (with_values(self.scene.body, self.keys, each) for each in values)
        return [solids_of(self.reference, body) for body in bodies]


def _reduced(stage: _Stage, clock: Clock, report: Progress, h: float) -> dict[str, Any]:
    """Arrays and `meta`, the effort, of what is cached."""
    build, tolerance = stage.build, stage.tolerance
    with clock("assemble"):
        report("assemble", 0.0)
        affine = assemble_affine(
            build.mesh, meshed_materials(build), fixed=build.fixed, absorbing=build.absorbing,
            drag=build.drag, support=build.support, coat=build.coat,
        )  # fmt: skip
        P, points = surface_load(build)
        frequencies, forces = _moving(stage.scene, P, points)
    few = stage.training(0)
    with clock("factorise and reduce"), one_thread():
        model = reduce_affine(
            affine, [_relaxed(solids) for solids in few], stage.probes,
            (frequencies, forces[:, affine.free]), band=BAND, tolerance=SHARE * tolerance,
            loads=P @ typical_spots(stage.scene.body, points), solver=stage.solver,
            progress=partial(report, "reduce"),
        )  # fmt: skip
    with clock("lines"), one_thread():
        kept, bases, error = _bases(
            model, frequencies, few, stage.training(INSIDE), tolerance, report
        )
    effort = Effort(
        dofs=len(affine.free), reduced_dofs=model.basis.shape[1],
        solver=fem.available()[0] if stage.solver == "auto" else stage.solver,
        estimate=model.error + error, factorisations=model.factorisations,
    )  # fmt: skip
    return {
        "meta": asdict(spent(effort, clock, build, h)), "outputs": model.outputs,
        "load": P[affine.free].T @ model.basis, "points": points, "frequencies": kept,
        **packed(model.affine, bases),
    }  # fmt: skip


def lines(prepared: ParametricBody, values: Mapping[str, float]) -> tuple[Floats, fem.Complex]:
    """Steady state of a material at the strong lines of the scene's load.

    Returns
    -------
    frequencies : (f,) float, Hz
    amplitudes : (f, p c) complex, of the components that the probes read, in the quantity's unit
    """
    solids = solids_of(prepared.reference, _body(prepared, values))
    of_parts = weights(prepared.affine, solids, prepared.frequencies)
    found = steady_lines(prepared.bases, of_parts)
    s = 2j * np.pi * prepared.frequencies
    return prepared.frequencies, found * line_factor(
        prepared.scene.reading.asked, s, (), found.shape[1]
    )


def answer(prepared: ParametricBody, values: Mapping[str, float]) -> Response:
    """Response of a material from rest to the scene's Tacton, all lines and the free vibration."""
    return answer_of(at(prepared, values), prepared.scene)


def at(prepared: ParametricBody, values: Mapping[str, float]) -> Prepared:
    """Reduced body of a material, for any Tacton."""
    body = relaxing(_body(prepared, values), FIT_TOLERANCE)
    small = operators_of(prepared.affine, solids_of(prepared.reference, body))
    upright = np.linalg.inv(np.linalg.cholesky(small.M)).T  # coordinates of unit mass
    K, C, R = (upright.T @ matrix @ upright for matrix in (small.K, small.C, small.R))
    branches = tuple(
        replace(branch, K=upright.T @ branch.K @ upright)
        for branch in with_internal(small.branches)
    )
    outputs = prepared.outputs @ upright
    model = fem.ReducedModel(
        basis=upright, K=K, C=C, R=R, outputs=outputs, moments=0,
        estimate=prepared.effort.estimate, solver=prepared.effort.solver, branches=branches,
    )  # fmt: skip
    reduced = ReducedBody(
        poles=fem.poles(model, outputs=np.eye(len(K))), damping=C, radiation=R, branches=branches,
        load=prepared.load @ upright, points=prepared.points, effort=prepared.effort,
    )  # fmt: skip
    return Prepared(
        probes=prepared.scene.probe_points, read=outputs, body=reduced,
        reading=prepared.scene.reading,
    )  # fmt: skip


def has_affine_operators(body: Body) -> bool:
    """Whether the operators of a body are sums over its materials: those of a sheet that is
    stretched, not held by all of its edges, or orthotropic have other terms.
    """
    return body.mounting == FRAME and body.solid.orthotropy is None


def _check(scene: Scene, tolerance: float) -> None:
    """Refuse what no affine sum gives."""
    if not 0 < tolerance < 1:
        raise ValueError(f"tolerance = {tolerance} is outside 0 < tolerance < 1")
    check_load(scene, "a body with free materials")
    check_laws(scene.body, scene.pressure)
    if not has_affine_operators(scene.body):
        raise ValueError(
            "a body with free materials is an isotropic sheet in a frame, or none: tension and "
            "other mountings do not scale with its modulus; reduce the body of each material"
        )
    if scene.body.air:
        raise ValueError(
            "a body with free materials has no air: its added mass is a dense operator; leave air "
            "out, or reduce the body of each material"
        )
    asked, solid = scene.reading.asked, scene.body.solid
    rows, doubled = (asked.rows(each) for each in (solid, solid.scaled(modulus=2.0)))
    if asked.relaxes or not np.array_equal(rows, doubled):
        raise ValueError(
            f"{scene.reading.words} depends on the material beyond the motion, which is all that a "
            "body with free materials gives; take a displacement, velocity or strain"
        )
    if (count := len(np.unique(load_lines(scene.pressure).frequencies))) > MOST_LINES:
        raise ValueError(
            f"the load has {count:,} lines, the limit with free materials is {MOST_LINES}; leave "
            "out the rhythm or signal"
        )


def _moving(scene: Scene, P: sparse.csr_array, points: Floats) -> tuple[Floats, fem.Complex]:
    """Frequencies (f,) in Hz and nodal forces (f, 3 n) in N of the load's lines, without the mean
    if the body is unconstrained, which drifts under it.
    """
    frequencies, pressures = pressure_lines(scene.pressure, points)
    kept = (frequencies > 0) | scene.body.is_held
    return frequencies[kept], (P @ pressures[kept].T).T


def _body(prepared: ParametricBody, values: Mapping[str, float]) -> Body:
    return with_values(prepared.scene.body, prepared.keys, values)


def _relaxed(solids: Solids) -> Solids:
    """The materials with Prony series for modulus laws of their own."""
    return replace(solids, materials=tuple(m.relaxing() for m in solids.materials))


def _bases(
    model: AffineModel,
    frequencies: Floats,
    few: Sequence[Solids],
    many: Sequence[Solids],
    tolerance: float,
    report: Progress,
) -> tuple[Floats, tuple[LineBasis, ...], float]:
    """Frequencies, bases and error of the lines that are strong for some of a few materials."""
    every = range(len(frequencies))
    strengths = np.array(
        [np.linalg.norm(steady(model, each, frequencies, every), axis=1) for each in few]
    )
    moving = np.where(frequencies > 0, strengths, 0.0).max(axis=1, keepdims=True)
    kept = (frequencies == 0) | (strengths > FAINTEST * moving).any(axis=0)
    found, error = line_bases(
        np.stack(model.affine.parts), model.forces[kept], model.outputs,
        np.stack([weights(model.affine, each, frequencies[kept]) for each in many]),
        SHARE * tolerance, partial(report, "lines"),
    )  # fmt: skip
    return frequencies[kept], found, error
