"""Parametric reduced body: one offline stage for every material and thickness of a range.

`prepare` is that stage, for a scene and ranges of some of its keys. `lines` takes milliseconds:
Galerkin's equations of each line of the scene's load in a few states. `answer` is the waveform from
rest, by the poles of the reduced-order model; `at` is that model, for any other Tacton. Poisson's
ratios and the elements are fixed: with a thickness the nodes of one mesh move, or modulus and
density of a sheet stand for it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache as cached
from functools import partial
from typing import Any

import numpy as np
from scipy import sparse

import fem
from fem.affine import weights
from fem.affine_model import AffineModel, operators_at, steady, steady_lines
from fem.boundary import fixed_dofs
from fem.greedy import Geometry, Variant, line_bases, reduce_affine
from meshes import cache
from simple_model import Effort, Response
from simple_model.layers.prony import FIT_TOLERANCE
from skinwave.bodies.build import Build
from skinwave.bodies.sizes import default_size
from skinwave.models.free_bodies import (
    Range,
    Reference,
    affine_operators,
    build_at,
    geometry_shares,
    nearest_geometry,
    range_of,
    reference_of,
    solids_of,
)
from skinwave.models.free_keys import (
    FreeKey,
    check_scene,
    free_keys,
    meshing_shares,
    training_shares,
    values_at,
    with_values,
)
from skinwave.models.laws import relaxing
from skinwave.models.meshed import (
    even_part,
    images,
    line_factor,
    load_lines_at,
    modelled_axes,
    probe_rows,
    spent,
    spread,
    surface_load,
)
from skinwave.models.reduced import (
    BAND,
    ReducedBody,
    cached_record,
    entry_name,
    reduced_of,
    store_record,
    typical_spots,
)
from skinwave.models.reduced import answer as answer_of
from skinwave.scene.scene import Body, Scene
from skinwave.system.effort import Clock, Progress, one_thread, silent
from skinwave.typing import Floats

TOLERANCE = 0.01  # relative error of a line that is not faint
SHARE = 0.4  # of the tolerance: of the reduced-order model, and of the lines' bases
FAINTEST = 1e-3  # of the strongest line that moves the probes: weaker ones are left out
FAINTEST_LOAD = 1e-6  # of the strongest line of the load
FORMAT = "parametric 5"  # of what is cached
BETWEEN = 0.3  # of each range: a body of no known geometry
INSIDE = 128  # materials inside the ranges, for the lines' bases


@dataclass(frozen=True, kw_only=True, eq=False)
class ParametricBody:
    """Reduced body of a scene for every material and thickness of a range.

    The `keys` that are free and the `bodies` of their values; the `reference` that was meshed; of
    g geometries the reduced `model`, whose outputs (g, p c, r) the probes read, with the reduced
    `forces` (g, c k, r) of unit pressure at the surface `points` (g, k, 3) in metre; models
    `bases` (f,) in it of the lines at `frequencies` (f,) in Hz; and the `effort` of the offline
    stage, with the number of its factorisations.
    """

    scene: Scene
    keys: tuple[FreeKey, ...]
    bodies: Range
    reference: Reference
    model: AffineModel
    forces: Floats
    points: Floats
    frequencies: Floats
    bases: tuple[AffineModel, ...]
    effort: Effort

    def __repr__(self) -> str:
        free = ", ".join(f"{key.key} {key.low:g} to {key.high:g}" for key in self.keys)
        geometries, *_, r = self.model.parts.shape
        order = f"{geometries} geometries of order {r}"
        return f"<ParametricBody of {self.scene!r}: {free}; {order}>"


def prepare(
    scene: Scene,
    free: Mapping[str, tuple[float, float]],
    tolerance: float = TOLERANCE,
    progress: Progress | None = None,
    *,
    h: float | None = None,
    solver: str = "auto",
) -> ParametricBody:
    """Offline stage: reduce a scene's body once for all materials and thicknesses within ranges.

    Parameters
    ----------
    scene : Scene
    free : key of a scene file, such as "body.material.shear_modulus_pa", "body.thickness_mm" or
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
    check_scene(scene, keys, tolerance)
    clock, report = Clock(), progress or silent
    with clock("mesh"):
        report("mesh", 0.0)
        bodies = _range(scene.body, keys, h)
        body = bodies.body(bodies.meshed)
        # One side gives all that probes on a plane of symmetry read.
        axes = modelled_axes(scene.body, scene.probe_points, "", scene.reading, scene.load)
        mesh = cached(partial(build_at, bodies, symmetry=axes))
        build = mesh(bodies.meshed)
    reference = reference_of(body, build, keys)
    of_body = entry_name(
        body, build, scene.probe_points, solver, tolerance, outputs=_probes(scene, body, build),
        load=scene.load,
    )  # fmt: skip
    name = cache.key(FORMAT, of_body, scene.pressure, scene.reading, keys)
    with clock("read from cache"):
        found = cached_record(name)
    if found is None:
        stage = _Stage(
            scene=scene, bodies=bodies, mesh=mesh, reference=reference, tolerance=tolerance,
            solver=solver,
        )  # fmt: skip
        found = _reduced(stage, clock, report, build)
        store_record(name, found, found["model"].parts, found["forces"])
    effort = spent(found["effort"], clock, build, h or default_size(body))
    return ParametricBody(
        scene=scene, keys=keys, bodies=bodies, reference=reference, **found | {"effort": effort}
    )


def _range(body: Body, keys: tuple[FreeKey, ...], h: float | None) -> Range:
    """Bodies of all values of the free keys."""

    def at(shares: Sequence[float]) -> Body:
        return relaxing(with_values(body, keys, values_at(keys, shares)), FIT_TOLERANCE)

    return range_of(at, meshing_shares(keys), [key.moves for key in keys], h)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Stage:
    """Offline stage of a scene and the bodies of a range; `mesh` is that of shares of the range."""

    scene: Scene
    bodies: Range
    mesh: Callable[[tuple[float, ...]], Build]
    reference: Reference
    tolerance: float
    solver: str

    def geometry(self, at: tuple[float, ...]) -> Geometry:
        """Full body at shares of the range."""
        body, build = self.bodies.body(at), self.mesh(at)
        affine = affine_operators(body, build)
        P, points = _surface(self.scene, build)
        return Geometry(
            affine=affine, probes=_probes(self.scene, body, build),
            forces=_moving(self.scene, P, points)[1][:, affine.free],
            loads=spread(P, typical_spots(body, points)),
        )  # fmt: skip


def _reduced(stage: _Stage, clock: Clock, report: Progress, build: Build) -> dict[str, Any]:
    """What is cached: fields of a `ParametricBody`."""
    bodies, tolerance, scene = stage.bodies, stage.tolerance, stage.scene
    geometries: dict[Any, Callable[[], Geometry]] = {
        at: cached(partial(stage.geometry, at)) for at in bodies.geometries
    }
    with clock("assemble"):
        report("assemble", 0.0)
        frequencies, _ = _moving(scene, *_surface(scene, build))
        for geometry in geometries.values():
            geometry()
    few = [_variant(stage, at, geometries) for at in _training(stage)]
    with clock("factorise and reduce"), one_thread():
        model, error, factorisations = reduce_affine(
            list(geometries.values()), few, frequencies, band=BAND, tolerance=SHARE * tolerance,
            solver=stage.solver, progress=partial(report, "reduce"),
        )  # fmt: skip
    surface = []
    for mesh in map(stage.mesh, geometries):
        P, points = _surface(scene, mesh)
        surface.append((P[~fixed_dofs(mesh.mesh, mesh.constraints)].T @ model.basis, points))
    with clock("lines"), one_thread():
        kept, bases, of_lines = _bases(stage, model, frequencies, few, report)
    effort = Effort(
        dofs=len(model.basis), reduced_dofs=model.basis.shape[1],
        solver=fem.available()[0] if stage.solver == "auto" else stage.solver,
        estimate=error + of_lines, factorisations=factorisations,
    )  # fmt: skip
    forces, places = (np.stack(each) for each in zip(*surface, strict=True))
    return {
        "model": replace(model, basis=model.basis[:0]), "forces": forces, "points": places,
        "frequencies": kept, "bases": bases, "effort": effort,
    }  # fmt: skip


def _training(stage: _Stage) -> list[tuple[float, ...]]:
    """Shares (k,) of corners and middle, of geometries that are known, and of one between them."""
    count = len(stage.bodies.meshed)
    few = [nearest_geometry(stage.bodies, each) for each in training_shares(count, 0).tolist()]
    between = [(BETWEEN,) * count] if len(stage.bodies.geometries) > 1 else []
    return list(dict.fromkeys([*few, *between]))


def _variant(stage: _Stage, at: tuple[float, ...], geometries: Mapping[Any, Any]) -> Variant:
    """Body at shares of the range, of a geometry that is meshed already, or of one of its own."""
    body = stage.bodies.body(at)
    shares = geometry_shares(stage.bodies, body)
    nearest = list(geometries.values())[int(np.argmax(shares))]
    is_known = nearest_geometry(stage.bodies, at) == at
    solids = solids_of(stage.reference, body)
    return Variant(
        solids=replace(solids, materials=tuple(m.relaxing() for m in solids.materials)),
        shares=shares,
        geometry=nearest if is_known else partial(stage.geometry, at),
    )  # fmt: skip


def lines(prepared: ParametricBody, values: Mapping[str, float]) -> tuple[Floats, fem.Complex]:
    """Steady state of a body of the range at the strong lines of the scene's load: frequencies (f,)
    in Hz, and amplitudes (f, p c) of the components that the probes read, in the quantity's unit.
    """
    return lines_of(prepared, with_values(prepared.scene.body, prepared.keys, values))


def lines_of(prepared: ParametricBody, body: Body) -> tuple[Floats, fem.Complex]:
    """The same of a body that differs from the scene's by values of the free keys alone."""
    solids = solids_of(prepared.reference, body)
    of_parts = weights(prepared.model.terms, solids, prepared.frequencies)
    found = steady_lines(prepared.bases, of_parts, geometry_shares(prepared.bodies, body))
    s = 2j * np.pi * prepared.frequencies
    return prepared.frequencies, found * line_factor(
        prepared.scene.reading.record, s, (), found.shape[1]
    )


def answer(prepared: ParametricBody, values: Mapping[str, float]) -> Response:
    """Response of a body of the range from rest to the scene's Tacton."""
    return answer_of(at(prepared, values), prepared.scene)


def at(prepared: ParametricBody, values: Mapping[str, float]) -> ReducedBody:
    """Reduced body of values of the free keys, for any Tacton."""
    body = relaxing(with_values(prepared.scene.body, prepared.keys, values), FIT_TOLERANCE)
    shares, scene = geometry_shares(prepared.bodies, body), prepared.scene
    model = prepared.model
    read, forces, points = (
        np.tensordot(shares, each, 1) for each in (model.outputs, prepared.forces, prepared.points)
    )
    small = operators_at(model, solids_of(prepared.reference, body), shares)
    return reduced_of(
        small, forces, points, prepared.effort,
        probes=scene.probe_points, read=read, reading=scene.reading, load=scene.load,
    )  # fmt: skip


def _probes(scene: Scene, body: Body, build: Build) -> sparse.csr_array:
    """Probe operator (p c, 3 n) of a mesh."""
    places = images(scene.probe_points, build.symmetry)
    return probe_rows(body, build, places, scene.reading)[0]


def _surface(scene: Scene, build: Build) -> tuple[sparse.csr_array, Floats]:
    """Load operator (3 n, c k) of a mesh, and the points (k, 3) where it takes the load."""
    return even_part(*surface_load(build, scene.load), build.symmetry)


def _moving(scene: Scene, P: sparse.csr_array, points: Floats) -> tuple[Floats, fem.Complex]:
    """Frequencies (f,) in Hz and nodal forces (f, 3 n) in N of the load's lines, without the mean
    if the body is unconstrained, which drifts under it.
    """
    frequencies, pressures = load_lines_at(scene.loads, points, FAINTEST_LOAD)
    kept = (frequencies > 0) | scene.body.is_held
    return frequencies[kept], (P @ pressures[kept].T).T


def _bases(
    stage: _Stage,
    model: AffineModel,
    frequencies: Floats,
    few: Sequence[Variant],
    report: Progress,
) -> tuple[Floats, tuple[AffineModel, ...], float]:
    """Frequencies, bases and error of the lines that are strong for some of a few variants."""
    every = range(len(frequencies))

    def strength(each: Variant) -> Floats:
        at = weights(model.terms, each.solids, frequencies)
        return np.asarray(np.linalg.norm(steady(model, at, each.shares, every), axis=1))

    strengths = np.array([strength(each) for each in few])
    moving = np.where(frequencies > 0, strengths, 0.0).max(axis=1, keepdims=True)
    kept = (frequencies == 0) | (strengths > FAINTEST * moving).any(axis=0)
    many = [
        stage.bodies.body(at) for at in training_shares(len(stage.bodies.meshed), INSIDE).tolist()
    ]
    found, error = line_bases(
        replace(model, forces=model.forces[:, kept]),
        np.stack([weights(model.terms, solids_of(stage.reference, each), frequencies[kept])
                  for each in many]),
        np.stack([geometry_shares(stage.bodies, each) for each in many]),
        SHARE * stage.tolerance, partial(report, "lines"),
    )  # fmt: skip
    return frequencies[kept], found, error
