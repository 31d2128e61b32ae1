"""Parametric reduced body: one offline stage for every material and thickness of a range.

`prepare` is that stage, for a scene and ranges of some of its keys. `lines` takes milliseconds: it
solves Galerkin's equations of each line of the scene's load in a few states. `answer` returns the
waveform from rest, from the poles of the reduced-order model. `at` returns this model, for any
other Tacton. Poisson's ratios and the elements are fixed. With a thickness, the nodes of one mesh
move, or the modulus and density of a sheet change.
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
from fem.affine_model import AffineModel, operators_at, steady_lines, steady_outputs
from fem.boundary import fixed_dofs
from fem.greedy import Geometry, Variant, line_bases, reduce_affine
from meshes import cache
from simple_model import Effort, Response
from simple_model.layers.prony import FIT_TOLERANCE
from skinwave.bodies.build import Build
from skinwave.bodies.sizes import default_size
from skinwave.models import free_bodies, free_keys, meshed
from skinwave.models.free_bodies import Range, Reference
from skinwave.models.free_keys import FreeKey
from skinwave.models.laws import relaxing
from skinwave.models.options import DEFAULT, solver_name, underflow_to_zero
from skinwave.models.reduced import ReducedBody, reduced_of, typical_spots
from skinwave.models.reduced import answer as answer_of
from skinwave.models.reduced_cache import cache_key, cached_record
from skinwave.models.symmetry import even_part, images, modelled_axes
from skinwave.scene.scene import Body, Scene
from skinwave.system.effort import Clock, Progress, silent
from skinwave.typing import Bools, Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class ParametricBody:
    """Reduced body of a scene for all materials and thicknesses of a range; see `skinwave.prepare`.

    Attributes
    ----------
    scene : Scene
    keys : tuple of FreeKey, the free keys
    bodies : Range, the bodies of their values
    reference : Reference, the body that was meshed
    model : AffineModel, reduced model of g geometries, with outputs (g, p c, r) at the probes
    forces : (g, c k, r) reduced forces of unit pressure
    points : (g, k, 3) surface points in m where the load is taken
    frequencies : (f,) in Hz of the lines
    bases : (f,) AffineModel, smaller models of the lines
    effort : Effort of the offline stage, with the number of its factorisations
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


@underflow_to_zero()
def prepare(
    scene: Scene,
    free: Mapping[str, tuple[float, float]],
    tolerance: float = 0.01,
    progress: Progress | None = None,
    *,
    h: float | None = None,
    solver: str = "auto",
) -> ParametricBody:
    """Reduce a scene's body once for all materials and thicknesses within ranges.

    Parameters
    ----------
    scene : Scene
    free : key of a scene file, such as "body.material.shear_modulus_pa", "body.thickness_mm" or
        "body.layers.0.material.viscosity_pa_s" -> (lowest, highest) value, in the unit of the file
    tolerance : float, relative error of each line of the load at the probes
    progress : called with the name of the phase and the fraction done
    h : float, m, element size; the default of the body if not given
    solver : a backend of `fem.linear_solver`

    Returns
    -------
    ParametricBody

    Raises
    ------
    ValueError
        If a key cannot be free or changes the probes' quantity directly, or the tolerance cannot
        be reached.

    Examples
    --------
    >>> import skinwave
    >>> from skinwave.models import parametric
    >>> scene = skinwave.loads(
    ...     "[tacton]\\nam_frequency_hz = 100\\nduration_s = 0.02\\n[body]\\nsides = 'clamped'\\n"
    ...     "size_x_mm = 40\\nsize_y_mm = 40\\nthickness_mm = 10"
    ... )
    >>> key = "body.material.shear_modulus_pa"
    >>> body = skinwave.prepare(scene, {key: (2e4, 3e4)}, tolerance=0.1, h=0.01)
    >>> body.keys[0].low, body.keys[0].high
    (20000.0, 30000.0)
    >>> parametric.answer(body, {key: 2.5e4}).values.shape
    (200, 5)
    """
    keys = free_keys.free_keys(scene.body, free)
    free_keys.check_scene(scene, keys, tolerance)
    clock, report = Clock(), progress or silent
    with clock("mesh"):
        report("mesh", 0.0)
        bodies = _range(scene.body, keys, h)
        body = bodies.body(bodies.meshed)
        # Probes on a plane of symmetry need only one half.
        axes = modelled_axes(scene.body, scene.probe_points, "", scene.reading, scene.load)
        mesh = cached(partial(free_bodies.build_at, bodies, symmetry=axes))
        build = mesh(bodies.meshed)
    reference = free_bodies.reference_of(body, build, keys)
    of_body = cache_key(
        body, build, scene.probe_points, solver, tolerance, outputs=_probes(scene, body, build),
        load=scene.load,
    )  # fmt: skip
    version = "parametric 7"  # of a cached body
    name = cache.key(version, of_body, scene.pressure, scene.reading, keys)
    stage = _Stage(
        scene=scene, bodies=bodies, mesh=mesh, reference=reference, tolerance=0.4 * tolerance,
        solver=solver,
    )  # fmt: skip
    fields = cached_record(name, clock, partial(_reduce, stage, clock, report, build))
    effort = meshed.with_cost(fields["effort"], clock, build, h or default_size(body))
    return ParametricBody(
        scene=scene, keys=keys, bodies=bodies, reference=reference, **fields | {"effort": effort}
    )


def _range(body: Body, keys: tuple[FreeKey, ...], h: float | None) -> Range:
    """Return the bodies of all values of the free keys."""

    def at(shares: Sequence[float]) -> Body:
        return relaxing(
            free_keys.with_values(body, keys, free_keys.values_at(keys, shares)), FIT_TOLERANCE
        )

    return free_bodies.range_of(at, free_keys.meshing_shares(keys), [key.moves for key in keys], h)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Stage:
    """Offline stage of a scene. `mesh` returns the mesh at shares of the range; the `tolerance`
    applies to the reduced-order model and to the bases of lines.
    """

    scene: Scene
    bodies: Range
    mesh: Callable[[tuple[float, ...]], Build]
    reference: Reference
    tolerance: float
    solver: str

    def geometry(self, at: tuple[float, ...]) -> Geometry:
        """Return the full body at shares of the range."""
        body, build = self.bodies.body(at), self.mesh(at)
        affine = free_bodies.affine_operators(body, build)
        P, points = _surface(self.scene, build)
        return Geometry(
            affine=affine, probes=_probes(self.scene, body, build),
            forces=_line_forces(self.scene, P, points)[1][:, affine.free],
            loads=meshed.spread(P, typical_spots(body, points)),
        )  # fmt: skip

    def training(self) -> list[tuple[float, ...]]:
        """Return shares (k,): corners and middle at assembled geometries, and one in between."""
        count = len(self.bodies.meshed)
        few = [
            free_bodies.nearest_geometry(self.bodies, each)
            for each in free_keys.training_shares(count, 0).tolist()
        ]
        between = [(0.3,) * count] if len(self.bodies.geometries) > 1 else []
        return list(dict.fromkeys([*few, *between]))

    def variant(self, at: tuple[float, ...], geometries: Mapping[Any, Any]) -> Variant:
        """Return the body at shares of the range, on an assembled geometry or its own."""
        body = self.bodies.body(at)
        shares = free_bodies.geometry_shares(self.bodies, body)
        nearest = list(geometries.values())[int(np.argmax(shares))]
        is_assembled = free_bodies.nearest_geometry(self.bodies, at) == at
        solids = free_bodies.solids_of(self.reference, body)
        return Variant(
            solids=replace(solids, materials=tuple(m.relaxing() for m in solids.materials)),
            shares=shares,
            geometry=nearest if is_assembled else partial(self.geometry, at),
        )


def _reduce(stage: _Stage, clock: Clock, report: Progress, build: Build) -> dict[str, Any]:
    """Reduce the body; return the cached fields of a `ParametricBody`."""
    bodies, scene = stage.bodies, stage.scene
    geometries: dict[Any, Callable[[], Geometry]] = {
        at: cached(partial(stage.geometry, at)) for at in bodies.geometries
    }
    with clock("assemble"):
        report("assemble", 0.0)
        frequencies, _ = _line_forces(scene, *_surface(scene, build))
        for geometry in geometries.values():
            geometry()
    variants = [stage.variant(at, geometries) for at in stage.training()]
    with clock("factorise and reduce"):
        model, error, factorisations = reduce_affine(
            list(geometries.values()), variants, frequencies, band=DEFAULT.band,
            tolerance=stage.tolerance, solver=stage.solver, progress=partial(report, "reduce"),
        )  # fmt: skip
    surface = []
    for mesh in map(stage.mesh, geometries):
        P, points = _surface(scene, mesh)
        surface.append((P[~fixed_dofs(mesh.mesh, mesh.constraints)].T @ model.basis, points))
    with clock("lines"):
        strong = _strong_lines(model, frequencies, variants)
        bases, error_of_lines = _line_bases(stage, model, frequencies, strong, report)
    effort = Effort(
        dofs=len(model.basis), reduced_dofs=model.basis.shape[1], solver=solver_name(stage.solver),
        estimate=error + error_of_lines, factorisations=factorisations,
    )  # fmt: skip
    forces, points = (np.stack(each) for each in zip(*surface, strict=True))
    return {
        "model": replace(model, basis=model.basis[:0]), "forces": forces, "points": points,
        "frequencies": frequencies[strong], "bases": bases, "effort": effort,
    }  # fmt: skip


def _strong_lines(
    model: AffineModel, frequencies: Floats, variants: Sequence[Variant],
    weak_line_ratio: float = 1e-3,
) -> Bools:  # fmt: skip
    """Return the mask (f,) of lines that are strong in any variant, and of the mean."""

    def strength(each: Variant) -> Floats:
        at = weights(model.terms, each.solids, frequencies)
        motion = steady_outputs(model, at, each.shares, range(len(frequencies)))
        return np.asarray(np.linalg.norm(motion, axis=1))

    strengths = np.array([strength(each) for each in variants])
    strongest = np.where(frequencies > 0, strengths, 0.0).max(axis=1, keepdims=True)
    return (frequencies == 0) | (strengths > weak_line_ratio * strongest).any(axis=0)


def _line_bases(
    stage: _Stage, model: AffineModel, frequencies: Floats, strong: Bools, report: Progress,
    inside: int = 128,
) -> tuple[tuple[AffineModel, ...], float]:  # fmt: skip
    """Return the bases of the strong lines for many bodies inside the range, and their error."""
    count = len(stage.bodies.meshed)
    bodies = [stage.bodies.body(at) for at in free_keys.training_shares(count, inside).tolist()]
    at_lines = [
        weights(model.terms, free_bodies.solids_of(stage.reference, body), frequencies[strong])
        for body in bodies
    ]
    return line_bases(
        replace(model, forces=model.forces[:, strong]), np.stack(at_lines),
        np.stack([free_bodies.geometry_shares(stage.bodies, body) for body in bodies]),
        stage.tolerance, partial(report, "lines"),
    )  # fmt: skip


def lines(prepared: ParametricBody, values: Mapping[str, float]) -> tuple[Floats, fem.Complex]:
    """Return the steady state for values of the free keys, at the strong lines of the scene's load:
    frequencies (f,) in Hz, and amplitudes (f, p c) of the components at the probes.
    """
    return lines_of(prepared, free_keys.with_values(prepared.scene.body, prepared.keys, values))


def lines_of(prepared: ParametricBody, body: Body) -> tuple[Floats, fem.Complex]:
    """Return the same for a body that differs from the scene's only in its free keys."""
    solids = free_bodies.solids_of(prepared.reference, body)
    at_lines = weights(prepared.model.terms, solids, prepared.frequencies)
    motion = steady_lines(
        prepared.bases, at_lines, free_bodies.geometry_shares(prepared.bodies, body)
    )
    s, quantity = 2j * np.pi * prepared.frequencies, prepared.scene.reading.record
    return prepared.frequencies, motion * meshed.line_factor(quantity, s, (), motion.shape[1])


@underflow_to_zero()
def answer(prepared: ParametricBody, values: Mapping[str, float]) -> Response:
    """Return the response from rest to the scene's Tacton, for values of the free keys."""
    return answer_of(at(prepared, values), prepared.scene)


def at(prepared: ParametricBody, values: Mapping[str, float]) -> ReducedBody:
    """Return the reduced body for values of the free keys; it serves any Tacton."""
    body = relaxing(
        free_keys.with_values(prepared.scene.body, prepared.keys, values), FIT_TOLERANCE
    )
    shares, scene = free_bodies.geometry_shares(prepared.bodies, body), prepared.scene
    model = prepared.model
    read, forces, points = (
        np.tensordot(shares, each, 1) for each in (model.outputs, prepared.forces, prepared.points)
    )
    small = operators_at(model, free_bodies.solids_of(prepared.reference, body), shares)
    return reduced_of(
        small, forces, points, prepared.effort,
        probes=scene.probe_points, read=read, reading=scene.reading, load=scene.load,
    )  # fmt: skip


def _probes(scene: Scene, body: Body, build: Build) -> sparse.csr_array:
    """Return the probe operator (p c, 3 n) of a mesh."""
    places = images(scene.probe_points, build.symmetry)
    return meshed.probe_rows(body, build, places, scene.reading)[0]


def _surface(scene: Scene, build: Build) -> tuple[sparse.csr_array, Floats]:
    """Return the load operator (3 n, c k) of a mesh, and the points (k, 3) of the load."""
    return even_part(*meshed.surface_load(build, scene.load), build.symmetry)


def _line_forces(scene: Scene, P: sparse.csr_array, points: Floats) -> tuple[Floats, fem.Complex]:
    """Return frequencies (f,) in Hz and nodal forces (f, 3 n) in N of the load's lines."""
    frequencies, pressures = meshed.load_lines_at(scene.loads, points, 1e-6)
    # Under the mean an unconstrained body would drift.
    chosen = (frequencies > 0) | scene.body.is_held
    return frequencies[chosen], (P @ pressures[chosen].T).T
