"""Parametric reduced body: one offline stage for every material of a range.

`prepare` is that stage, for a scene and ranges of some of its keys. `lines` takes milliseconds: Galerkin's equations of each line of the scene's load in a few states.
`answer` is the waveform from rest, by the poles of the reduced-order model; `at` is that model, for
any other Tacton. Poisson's ratios, geometry and mesh are fixed. The absorbing layer of a slab with
absorbing sides is as wide as the fastest shear waves need.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

import fem
from fem.affine import AffineOperators, Solids, assemble_affine, operators_of, weights
from fem.line_basis import LineBasis, line_bases, steady_lines
from fem.maxwell import with_internal
from fem.reduced_affine import AffineModel, reduce_affine, steady
from meshes.tetmesh import Floats
from simple_model import Effort, Response
from simple_model.load_spectrum import load_lines, pressure_lines
from skinwave.bodies.sizes import default_size
from skinwave.effort import Clock, Progress, one_thread, silent
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
from skinwave.models.laws import relaxing
from skinwave.models.loads import line_factor, probe_rows, surface_load
from skinwave.models.prepared import SERIES_ERROR, Prepared, typical_spots
from skinwave.models.prepared import answer as answer_of
from skinwave.models.reduction import BAND, ReducedBody
from skinwave.scene import Body, Scene

TOLERANCE = 0.01  # relative error of a line that is not faint
SHARE = 0.4  # of the tolerance: of the reduced-order model, and of the lines' bases
FAINTEST = 1e-3  # of the strongest line that moves the probes: weaker ones are left out
MOST_LINES = 400
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
    body = relaxing(with_values(scene.body, keys, meshing_values(keys)), SERIES_ERROR * tolerance)
    build = meshed(body, h, clock, report)
    reference = reference_of(body, build, keys)
    with clock("assemble"):
        report("assemble", 0.0)
        affine = assemble_affine(
            build.mesh, meshed_materials(build), fixed=build.fixed, absorbing=build.absorbing,
            drag=build.drag, support=build.support, coat=build.coat,
        )  # fmt: skip
        P, points = surface_load(build)
        frequencies, pressures = pressure_lines(scene.pressure, points)
        lines = frequencies, (P @ pressures.T)[affine.free].T
        probes, _ = probe_rows(body, build, scene.probe_points, scene.reading)
    with clock("factorise and reduce"), one_thread():
        few = _training(scene, keys, reference, training_shares(len(keys), 0))
        model = reduce_affine(
            affine, [_relaxed(solids, tolerance) for solids in few], probes,
            _moving(scene, lines), band=BAND, tolerance=SHARE * tolerance,
            loads=P @ typical_spots(body, points), solver=solver,
            progress=partial(report, "reduce"),
        )  # fmt: skip
    with clock("lines"), one_thread():
        many = _training(scene, keys, reference, training_shares(len(keys), INSIDE))
        kept, bases, error = _bases(model, _moving(scene, lines)[0], few, many, tolerance, report)
    effort = Effort(
        dofs=len(affine.free), reduced_dofs=len(model.outputs.T), solver=_used(solver),
        estimate=model.error + error, factorisations=model.factorisations,
    )  # fmt: skip
    load = np.zeros((affine.n_dofs, model.basis.shape[1]))
    load[affine.free] = model.basis
    return ParametricBody(
        scene=scene, keys=keys, reference=reference, affine=model.affine, outputs=model.outputs,
        load=P.T @ load, points=points, frequencies=kept, bases=bases,
        effort=spent(effort, clock, build, h or default_size(body)),
    )  # fmt: skip


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
    body = relaxing(_body(prepared, values), SERIES_ERROR * TOLERANCE)
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


def _check(scene: Scene, tolerance: float) -> None:
    """Refuse what no affine sum gives."""
    if not 0 < tolerance < 1:
        raise ValueError(f"tolerance = {tolerance} is outside 0 < tolerance < 1")
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


def _moving(scene: Scene, lines: tuple[Floats, fem.Complex]) -> tuple[Floats, fem.Complex]:
    """The lines without the mean if the body is unconstrained, which drifts under it."""
    frequencies, forces = lines
    kept = (frequencies > 0) | scene.body.is_held
    return frequencies[kept], forces[kept]


def _body(prepared: ParametricBody, values: Mapping[str, float]) -> Body:
    return with_values(prepared.scene.body, prepared.keys, values)


def _training(
    scene: Scene, keys: Sequence[FreeKey], reference: Reference, shares: Floats
) -> list[Solids]:
    bodies = (with_values(scene.body, keys, values_at(keys, each)) for each in shares.tolist())
    return [solids_of(reference, body) for body in bodies]


def _relaxed(solids: Solids, tolerance: float) -> Solids:
    """The materials with Prony series for modulus laws of their own."""
    own = tuple(m.relaxing(SERIES_ERROR * tolerance) for m in solids.materials)
    return replace(solids, materials=own)


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


def _used(solver: str) -> str:
    return fem.available()[0] if solver == "auto" else solver
