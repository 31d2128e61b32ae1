"""Parametric reduced body: one offline stage for every material and thickness of a range.

`prepare` is that stage, for a scene and ranges of some of its keys. `lines` takes milliseconds:
Galerkin's equations of each line of the scene's load in a few states. `answer` is the waveform from
rest, by the poles of the reduced-order model; `at` is that model, for any other Tacton. Poisson's
ratios and the elements are fixed: with a thickness the nodes of one mesh move, or modulus and
density of a sheet's stand for it. The absorbing layer of a slab with absorbing sides is as wide as
the fastest shear waves need.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache as cached
from functools import partial
from typing import Any

import numpy as np
from scipy import sparse

import fem
from fem.affine import KINDS, Solids, weights
from fem.affine_model import AffineModel, operators_at, steady, steady_lines
from fem.boundary import fixed_dofs
from fem.greedy import Geometry, Variant, line_bases, reduce_affine
from meshes import cache
from meshes.tetmesh import Floats
from simple_model import Effort, Response
from simple_model.layers.prony import FIT_TOLERANCE
from skinwave.bodies.build import Build
from skinwave.bodies.sizes import default_size
from skinwave.models.free_keys import (
    FreeKey,
    check_scene,
    free_keys,
    meshing_shares,
    training_shares,
    values_at,
    with_values,
)
from skinwave.models.free_materials import Reference, affine_operators, reference_of, solids_of
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
from skinwave.models.prepared import Prepared, entry_name, typical_spots
from skinwave.models.prepared import answer as answer_of
from skinwave.models.reduction import BAND, reduced_variant
from skinwave.models.thicknesses import (
    Range,
    build_at,
    geometry_shares,
    nearest_geometry,
    range_of,
)
from skinwave.scene.scene import Body, Scene
from skinwave.system.effort import Clock, Progress, one_thread, peak_memory, silent

TOLERANCE = 0.01  # relative error of a line that is not faint
SHARE = 0.4  # of the tolerance: of the reduced-order model, and of the lines' bases
FAINTEST = 1e-3  # of the strongest line that moves the probes: weaker ones are left out
FAINTEST_LOAD = 1e-6  # of the strongest line of the load
FORMAT = "parametric 4"  # of what is cached
ARRAYS = ("load", "points", "frequencies")
OF_ALL = ("parts", "forces", "outputs")
OF_A_LINE = (*OF_ALL, "basis")
BETWEEN = 0.3  # of each range: a body of no known geometry
KEPT = 5  # full bodies at a time: more of them are assembled anew, for a third of the memory
INSIDE = 128  # materials inside the ranges, for the lines' bases


@dataclass(frozen=True, kw_only=True, eq=False)
class ParametricBody:
    """Reduced body of a scene for every material and thickness of a range.

    The `keys` that are free and the `bodies` of their values; the `reference` that was meshed; of
    g geometries the reduced `model`, whose outputs (g, p c, r) the probes read, with the reduced
    forces `load` (g, k, r) of unit pressure at the surface `points` (g, k, 3) in metre; models
    `bases` (f,) in it of the lines at `frequencies` (f,) in Hz; and the `effort` of the offline
    stage, with the number of its factorisations.
    """

    scene: Scene
    keys: tuple[FreeKey, ...]
    bodies: Range
    reference: Reference
    model: AffineModel
    load: Floats
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
        mesh = cached(partial(build_at, bodies, symmetry=_symmetry(scene)))
        build = mesh(bodies.meshed)
    reference = reference_of(body, build, keys)
    of_body = entry_name(
        body, build, scene.probe_points, solver, tolerance, outputs=_probes(scene, body, build),
        load=scene.load,
    )  # fmt: skip
    name = cache.key(FORMAT, of_body, scene.pressure, scene.reading, keys)
    with clock("read from cache"):
        entry = cache.load(name)
    if not entry:
        stage = _Stage(
            scene=scene, bodies=bodies, mesh=mesh, reference=reference, tolerance=tolerance,
            solver=solver,
        )  # fmt: skip
        entry = _reduced(stage, clock, report, build, h or default_size(body))
        cache.store(name, **entry)
    model, bases = _unpacked(entry)
    effort = Effort(**{**entry["meta"], "seconds": clock.seconds, "peak_memory": peak_memory()})
    return ParametricBody(
        scene=scene, keys=keys, bodies=bodies, reference=reference, model=model,
        bases=bases, effort=effort, **{array: entry[array] for array in ARRAYS},
    )  # fmt: skip


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


def _reduced(
    stage: _Stage, clock: Clock, report: Progress, build: Build, h: float
) -> dict[str, Any]:
    """Arrays and `meta`, the effort, of what is cached."""
    bodies, tolerance, scene = stage.bodies, stage.tolerance, stage.scene
    few_geometries = len(bodies.geometries) <= KEPT
    geometries: dict[Any, Callable[[], Geometry]] = {
        at: partial(stage.geometry, at) for at in bodies.geometries
    }
    if few_geometries:
        geometries = {at: cached(made) for at, made in geometries.items()}
    with clock("assemble"):
        report("assemble", 0.0)
        frequencies, _ = _moving(scene, *_surface(scene, build))
        for geometry in geometries.values() if few_geometries else ():
            geometry()
    few = [_variant(stage, at, geometries) for at in _training(stage)]
    with clock("factorise and reduce"), one_thread():
        model, error, factorisations = reduce_affine(
            list(geometries.values()), few, frequencies, band=BAND, tolerance=SHARE * tolerance,
            solver=stage.solver, progress=partial(report, "reduce"),
        )  # fmt: skip
    surface = [_reduced_surface(scene, stage.mesh(at), model) for at in geometries]
    with clock("lines"), one_thread():
        kept, bases, of_lines = _bases(stage, model, frequencies, few, report)
    effort = Effort(
        dofs=len(model.basis), reduced_dofs=model.basis.shape[1],
        solver=fem.available()[0] if stage.solver == "auto" else stage.solver,
        estimate=error + of_lines, factorisations=factorisations,
    )  # fmt: skip
    load, points = (np.stack(each) for each in zip(*surface, strict=True))
    return {
        "meta": asdict(spent(effort, clock, build, h)), "load": load, "points": points,
        "frequencies": kept, **_packed(model, bases),
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
    return Variant(
        solids=_relaxed(solids_of(stage.reference, body)), shares=shares,
        geometry=nearest if is_known else partial(stage.geometry, at),
    )  # fmt: skip


def _reduced_surface(scene: Scene, build: Build, model: AffineModel) -> tuple[Floats, Floats]:
    """Reduced forces (c k, r) of a unit load, and the points (k, 3) where it is."""
    P, points = _surface(scene, build)
    return P[~fixed_dofs(build.mesh, build.constraints)].T @ model.basis, points


def lines(prepared: ParametricBody, values: Mapping[str, float]) -> tuple[Floats, fem.Complex]:
    """Steady state of a body of the range at the strong lines of the scene's load: frequencies (f,)
    in Hz, and amplitudes (f, p c) of the components that the probes read, in the quantity's unit.
    """
    return lines_of(prepared, _body(prepared, values))


def lines_of(prepared: ParametricBody, body: Body) -> tuple[Floats, fem.Complex]:
    """The same of a body that differs from the scene's by values of the free keys alone."""
    solids = solids_of(prepared.reference, body)
    of_parts = weights(prepared.model.terms, solids, prepared.frequencies)
    found = steady_lines(prepared.bases, of_parts, geometry_shares(prepared.bodies, body))
    s = 2j * np.pi * prepared.frequencies
    return prepared.frequencies, found * line_factor(
        prepared.scene.reading.asked, s, (), found.shape[1]
    )


def answer(prepared: ParametricBody, values: Mapping[str, float]) -> Response:
    """Response of a body of the range from rest to the scene's Tacton, all lines and the free
    vibration.
    """
    return answer_of(at(prepared, values), prepared.scene)


def at(prepared: ParametricBody, values: Mapping[str, float]) -> Prepared:
    """Reduced body of values of the free keys, for any Tacton."""
    body = relaxing(_body(prepared, values), FIT_TOLERANCE)
    shares = geometry_shares(prepared.bodies, body)
    model = prepared.model
    outputs, load, points = (
        np.tensordot(shares, each, 1) for each in (model.outputs, prepared.load, prepared.points)
    )
    small = operators_at(model, solids_of(prepared.reference, body), shares)
    return Prepared(
        probes=prepared.scene.probe_points, read=outputs, reading=prepared.scene.reading,
        load=prepared.scene.load,
        body=reduced_variant(small, load, points, prepared.effort),
    )  # fmt: skip


def _symmetry(scene: Scene) -> str:
    """Axes, of "xy", across which the part of the body on one side gives what the probes read."""
    return modelled_axes(scene.body, scene.probe_points, "", scene.reading, scene.load)


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


def _body(prepared: ParametricBody, values: Mapping[str, float]) -> Body:
    return with_values(prepared.scene.body, prepared.keys, values)


def _relaxed(solids: Solids) -> Solids:
    """The materials with Prony series for modulus laws of their own."""
    return replace(solids, materials=tuple(m.relaxing() for m in solids.materials))


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


def _packed(model: AffineModel, bases: Sequence[AffineModel]) -> dict[str, np.ndarray]:
    """Arrays of a model without its basis, and of those of lines in it, end to end."""
    return {
        "terms": np.array([(KINDS.index(kind), r) for kind, r in model.terms]),
        **{name: getattr(model, name) for name in OF_ALL},
        "sizes": np.array([line.basis.shape[1] for line in bases]),
        **{f"line_{name}": np.concatenate([getattr(line, name).ravel() for line in bases])
           for name in OF_A_LINE},
    }  # fmt: skip


def _unpacked(entry: Mapping[str, Any]) -> tuple[AffineModel, tuple[AffineModel, ...]]:
    """Model of an entry, its basis without rows, and those of lines in it."""
    terms = tuple((KINDS[kind], r) for kind, r in entry["terms"].tolist())
    (g, q, r, _), p = entry["parts"].shape, entry["outputs"].shape[1]
    model = AffineModel(
        terms=terms, basis=np.zeros((0, r)), **{name: entry[name] for name in OF_ALL}
    )
    starts, lines = dict.fromkeys(OF_A_LINE, 0), []
    for m in entry["sizes"].tolist():
        shapes = {"parts": (g, q, m, m), "forces": (g, 1, m), "outputs": (g, p, m), "basis": (r, m)}
        arrays = {}
        for name, shape in shapes.items():
            start = starts[name]
            starts[name] += int(np.prod(shape))
            arrays[name] = entry[f"line_{name}"][start : starts[name]].reshape(shape)
        lines.append(AffineModel(terms=terms, **arrays))
    return model, tuple(lines)
