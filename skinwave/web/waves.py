"""Response of a body to a Tacton, quickly enough to follow a slider.

Slab: the wavenumber integral of an infinite one. A table of g(r, w) for a height carries every
path (`slabs`); a probe's motion from rest is then a sum over harmonics of the path, as in
`simple_model.flat_body`, and a line's motion of the whole area

    u_f(x) = sum_k g(|x - X_k|, f) w_k(f),   w_k(f) = 1/K sum_n c_fn exp(-2 pi i n a_k)

over K knots X_k of the path. Other bodies: finite elements, reduced to the pressure along the path
and read everywhere; another path needs another reduction, other controls none. Once a slider of its
materials is moved, it is reduced for all of a range (`free_bodies`).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import fft, sparse

import fem
from meshes.tetmesh import Floats, Ints
from simple_model import MovingPressure, Response, sensation_level
from simple_model.load_spectrum import foci_harmonics, load_lines
from simple_model.path_cells import harmonics, path_fourier, path_samples, unsampled
from simple_model.prony import FIT_TOLERANCE
from simple_model.response import step
from skinwave.bodies.build import Build, build, operators
from skinwave.bodies.sizes import default_size
from skinwave.effort import Clock, Progress, silent
from skinwave.models.affine_scenes import has_affine_operators
from skinwave.models.laws import relaxing
from skinwave.models.loads import probe_rows, surface_load, surface_motion
from skinwave.models.prepared import in_motion, sample_times
from skinwave.models.reduction import (
    BAND,
    ReducedBody,
    ReducedResponse,
    from_rest,
    read_at,
    reduce_body,
    respond,
    select_lines,
)
from skinwave.planning.assessment import sentences
from skinwave.planning.warnings import NONLINEAR
from skinwave.scene import Body, Scene
from skinwave.simulation import compute
from skinwave.web.free_bodies import FreeBody, covers, free_body, reduced_at
from skinwave.web.levels import level_of
from skinwave.web.model import (
    FAINTEST_LEVEL,
    SIDE,
    Answer,
    AreaMap,
    answer_of,
    at_any_speed,
    borderline,
    mean_level,
    places,
)
from skinwave.web.moving import Shape, moving_of, skin_of, slab_shape
from skinwave.web.slabs import FURTHEST, HIGHEST, Table, is_tabulated, lowest, tabulate, wavenumbers

TAIL = 0.4  # s that motion may last after the Tacton
# What a warning says instead of the name of a model, of which a page has linear ones alone.
ON_PAGE = "save the scene and compute it with the model {}, which a page has not"
FINER = 8  # places of a map's table in each interval of the table
FAINTEST = 1e-4  # of the largest harmonic of the path
MAPPED = 60  # lines that a map is made of, the strongest
TOLERANCE = 0.02  # of a reduction
MANY = 264  # knots, of which every second spans the same pressures
NOWHERE = 1e-6  # of the largest pressure: where it is less, there is none
# As in `skinwave.steps`; a body that is cached begins with the third.
STEPS = {"mesh": 0.05, "assemble": 0.05, "factorise": 0.15, "reduce": 0.7, "read the surface": 0.05}
SHEET_CELLS = 40  # along the shorter side of a large sheet, at most
KEPT = 2  # reductions, tables and meshes each: some 20 to 40 MB a reduction


@dataclass(frozen=True, kw_only=True, eq=False)
class Reduced:
    """A body reduced to the pressure along one path: displacement `read` (q, r) of the places
    `within` (SIDE^2,) the area, and the `basis` (3 n, r) of all nodes of `made`, of which the
    `nodes` (n,) are seen as `shape`.
    """

    body: ReducedBody
    read: Floats
    within: NDArray[np.bool_]
    made: Build
    shape: Shape
    nodes: Ints
    basis: NDArray[np.float32]


class BodyResponses:
    """Responses of bodies; caches what the next one can use."""

    def __init__(self) -> None:
        self._kept: dict[str, dict[Any, Any]] = {
            "known": {}, "beside": {}, "table": {}, "body": {}, "reduced": {}, "free": {}
        }  # fmt: skip

    def __call__(
        self, scene: Scene, progress: Progress, moving: bool = False, base: Body | None = None
    ) -> Answer:
        """The response in a scene of one probe, with the motion of the whole body if `moving`; the
        `base` is its body of other materials, before these were moved. Raises what `simulate` does.
        """
        if is_tabulated(scene.body):
            gaussian_only(scene.pressure)
            height = scene.pressure.height
            wide = scene.body, lowest(height)
            known = self._keep("known", wide, lambda: wavenumbers(*wide, progress))
            table = self._keep("table", (scene.body, height), lambda: tabulate(known, height))
            return warned_of(scene, flat_answer(table, scene, moving))
        reduce = partial(self._reduce, scene, progress)
        if base and base != scene.body and has_affine_operators(base) and covers(base, scene.body):
            reduce = partial(self._of_materials, scene, base, progress)
        body = self._keep("reduced", _reduction(scene), reduce)
        return warned_of(scene, reduced_answer(body, scene, moving))

    def level(self, scene: Scene) -> float:
        """Level of a scene's probe as `levels.level_of`; nan where it would take another reduction,
        or the probe reads something else than the threshold is of.
        """
        if not (scene.body.is_skin and scene.reading.is_plain):
            return float("nan")
        if is_tabulated(scene.body):
            try:
                lines = flat_lines(self._table_beside(scene), scene)
            except ArithmeticError:  # no grid of wavenumbers is fine enough
                return float("nan")
        else:
            body = self._kept["reduced"].get(_reduction(scene))
            if body is None:
                return float("nan")
            lines = reduced_lines_at(body, scene)
        return level_of(scene, *lines)

    def _table_beside(self, scene: Scene) -> Table:
        """Table of a scene's height, beside those of moves, which stay cached."""
        height = scene.pressure.height
        if (kept := self._kept["table"].get((scene.body, height))) is not None:
            return kept
        wide = scene.body, lowest(height)
        known = self._kept["known"].get(wide)
        if known is None:
            known = self._keep("beside", wide, lambda: wavenumbers(*wide, silent))
        return tabulate(known, height)

    def _reduce(self, scene: Scene, progress: Progress) -> Reduced:
        clock = Clock()
        made, ops = self._keep("body", scene.body, lambda: _assembled(scene.body, progress))
        with clock("reduce"):
            found = reduced_to_path(made, ops, scene.body, scene.pressure, progress)
        effort = replace(found.body.effort, seconds=clock.seconds)
        return replace(found, body=replace(found.body, effort=effort))

    def _of_materials(self, scene: Scene, base: Body, progress: Progress) -> Reduced:
        """The body of a scene by one that is reduced for all materials of a range, if it is."""
        key = _reduction(replace(scene, body=base))
        found = self._keep("free", key, lambda: self._free(scene, base, progress))
        return of_materials(found, scene.body) if found else self._reduce(scene, progress)

    def _free(
        self, scene: Scene, base: Body, progress: Progress
    ) -> tuple[FreeBody, Reduced] | None:
        """Body for all materials of a range, and what it has with each of them; None if the range
        is too wide for one reduced-order model.
        """
        clock = Clock()
        made, _ = self._keep("body", base, lambda: _assembled(base, progress))
        with clock("reduce"):
            P, points, spots = pushed(made, scene.pressure)
            forces = P @ spots.T
            subspace = fem.load_subspace(forces, TOLERANCE / 5)
            try:
                found = free_body(base, made, (P, points), subspace, forces, progress)
            except (ValueError, fem.Diverged):
                return None
        progress("read the surface", 1.0)
        found = replace(found, effort=replace(found.effort, seconds=clock.seconds))
        own = seen_of(made, base, reduced_at(found, base), found.basis)
        return replace(found, basis=found.basis[:0]), own

    def _keep(self, kind: str, key: Any, make: Callable[[], Any]) -> Any:
        kept = self._kept[kind]
        found = kept.pop(key) if key in kept else make()
        kept[key] = found  # the newest is last
        while len(kept) > KEPT:
            del kept[next(iter(kept))]
        return found


def _reduction(scene: Scene) -> tuple[Any, ...]:
    """Key of a reduced body: all that it depends on."""
    tacton, pressure = scene.tacton, scene.pressure
    places_only = at_any_speed(tacton.trajectory), tacton.n_paths
    return scene.body, places_only, pressure.height, pressure.profile


def warned_of(scene: Scene, answer: Answer) -> Answer:
    """The response with the warnings of the command line, except those that need a second mesh."""
    response = answer.response
    if is_tabulated(scene.body) and scene.body.sides == "absorbing":
        return answer  # an infinite slab, whose sides reflect nothing
    found = sentences(scene, response, h=default_size(scene.body))
    for model in NONLINEAR:
        cure = f"use --model {model}"
        found = tuple(sentence.replace(cure, ON_PAGE.format(model)) for sentence in found)
    effort = replace(response.effort, warnings=found)
    return replace(answer, response=replace(response, effort=effort))


def gaussian_only(pressure: MovingPressure) -> None:
    """Refuse a focal profile for which there is no table, any but a Gaussian.

    Raises
    ------
    ValueError
        If the focus is another.
    """
    if pressure.profile != "gaussian":
        raise ValueError(
            f"focus profile '{pressure.profile_name}' has no wavenumber integral on a slab; choose "
            "'gaussian', which has the same half width and force"
        )


def flat_answer(table: Table, scene: Scene, moving: bool = False) -> Answer:
    """Motion from rest of a scene's probe, and RMS motion of the area."""
    from scipy.interpolate import CubicSpline  # which takes long to import

    pressure = scene.pressure
    response = _at_point(table, scene) if scene.reading.is_plain else compute(scene, "flat-body")
    steady = _steady(pressure)
    f, w = path_amplitudes(steady)
    away = np.linalg.norm(places()[:, None] - path_samples(steady), axis=2)
    fine = np.linspace(0, FURTHEST, FINER * len(table.distances))
    index = np.rint(away / fine[1]).astype(np.intp)
    of_lines = CubicSpline(table.distances, table.along_frequencies(f), axis=1)(fine)
    of_lines, carried = of_lines.astype(np.complex64), np.empty(index.shape, np.complex64)
    # Silence has no lines, and moves nothing: the shape is not left to what there is.
    motion = np.zeros((len(f), SIDE**2), np.complex128)
    for line, g, weights in zip(motion, of_lines, w, strict=True):
        line[:] = np.take(g, index, out=carried, mode="clip") @ weights  # without a check of each
    seen = None
    if moving:
        shape = slab_shape(scene.body, places())
        upwards = np.zeros((len(f), len(shape.points)), np.complex128)
        upwards[:, : SIDE**2] = -motion
        seen = moving_of(shape, pressure, f, upwards)
    return answer_of(scene, response, motion_map(scene, f, motion), seen)


def flat_lines(table: Table, scene: Scene) -> tuple[Floats, fem.Complex]:
    """Frequencies (f,) in Hz and steady lines (f,) in metre of a scene's probe."""
    from scipy.interpolate import CubicSpline  # which takes long to import

    steady = _steady(scene.pressure)
    f, w = path_amplitudes(steady)
    away = np.linalg.norm(scene.probe_points[0, :2] - path_samples(steady), axis=1)
    g = table.along_distances(away)
    return f, (CubicSpline(table.frequencies, g, axis=0)(f) * w).sum(axis=1)


def _at_point(table: Table, scene: Scene) -> Response:
    """Displacement of the surface at a scene's probe."""
    times, probes = sample_times(scene), scene.probe_points
    return Response(
        model="flat-body", times=times, probes=probes,
        values=flat_motion(table, scene.pressure, probes[0], times)[:, None],
    )  # fmt: skip


def flat_motion(table: Table, pressure: MovingPressure, probe: Floats, times: Floats) -> Floats:
    """Motion (t,) in metre of a probe (2,) from rest at times (t,) in s."""
    from scipy.interpolate import CubicSpline  # which takes long to import

    dt, n = step(times), len(times)
    padded = fft.next_fast_len(n + round(TAIL / dt), real=True)
    t = np.arange(padded) * dt
    f = np.fft.rfftfreq(padded, dt)
    f = f[f <= HIGHEST]
    gain = pressure.gain(t, over=dt) * (np.arange(padded) < n)
    gain[0] /= 2  # as in `flat_body`
    path = unsampled(pressure)
    away = np.linalg.norm(probe - path_samples(path), axis=1)
    h, orders = path_fourier(path, table.along_distances(away)), harmonics(path)
    h[:, orders] *= foci_harmonics(path, orders)
    orders = orders[np.abs(h[:, orders]).max(axis=0) > FAINTEST * np.abs(h).max()]
    h = CubicSpline(table.frequencies, h[:, orders], axis=0)(f)
    turn = np.exp(2j * np.pi * pressure.tacton.trajectory.drawing_frequency * t)
    u = np.zeros(padded // 2 + 1, np.complex128)
    for column, order in zip(h.T, orders, strict=True):
        driven = fft.fft(gain * turn**order)[: len(f)]
        u[: len(f)] += column * driven
    return np.asarray(fft.irfft(u, padded)[:n])


def path_amplitudes(pressure: MovingPressure) -> tuple[Floats, fem.Complex]:
    """Frequencies (f,) in Hz of the strongest lines, and their w (f, k) in Pa at the knots."""
    found = load_lines(pressure, 1e-3)
    heard = (found.frequencies > 1e-6) & (found.frequencies <= BAND)
    knots = len(path_samples(pressure))
    f, which = np.unique(np.round(found.frequencies[heard], 9), return_inverse=True)
    waves = path_fourier(pressure, np.eye(knots), found.harmonics[heard]).T
    w = np.zeros((len(f), knots), np.complex128)
    np.add.at(w, which, found.coefficients[heard, None] * waves)
    strength = np.zeros(len(f))
    np.maximum.at(strength, which, found.strengths[heard])
    strongest = np.sort(np.argsort(-strength)[:MAPPED])
    return f[strongest], w[strongest]


def motion_map(scene: Scene, frequencies: Floats, motion: fem.Complex) -> AreaMap:
    """The map of lines (f,) in Hz whose complex amplitudes (f, SIDE^2) in metre are known, of a
    rhythm while a pulse is on; and the contour where the line with the highest sensation level, of
    a rhythm with its pauses as in the table of lines, is at the threshold, which a sheet has not.
    """
    amplitudes = np.abs(motion)
    levels = sensation_level(mean_level(scene.pressure) * amplitudes, frequencies[:, None])
    shown = levels if scene.body.is_skin else levels[:0]
    level = shown.max(axis=0, initial=FAINTEST_LEVEL)
    rms = np.sqrt((amplitudes**2).sum(axis=0) / 2).reshape(SIDE, SIDE)
    level = np.where(np.isnan(rms), np.nan, level.reshape(SIDE, SIDE))
    return AreaMap(rms=rms, level=level, threshold=borderline(level, 0.0))


def _steady(pressure: MovingPressure) -> MovingPressure:
    """The same pressure while a pulse of its rhythm is on."""
    return replace(pressure, tacton=replace(pressure.tacton, rhythm=None))


def _assembled(body: Body, progress: Progress) -> tuple[Any, Any]:
    progress("mesh", 0.0)
    size, body = body.of_kind.interactive_size, relaxing(body, FIT_TOLERANCE)
    if body.of_kind.is_plate:
        size = max(size, min(body.width, body.height) / SHEET_CELLS)
    made = build(body, size if body.of_kind.is_plate else min(size, body.depth))
    progress("assemble", 0.0)
    return made, operators(made)


def reduced_to_path(
    made: Any, ops: Any, body: Body, pressure: MovingPressure, progress: Progress
) -> Reduced:
    """A meshed and assembled body, reduced to a pressure's path."""
    progress("factorise", 0.0)
    P, points, spots = pushed(made, pressure)
    subspace = sparse.csr_array(fem.load_subspace(P @ spots.T, TOLERANCE / 5).T)
    reduced, model = reduce_body(
        body, made, ops, subspace, TOLERANCE, surface=(P, points), report=progress
    )
    progress("read the surface", 1.0)
    return seen_of(made, body, reduced, model.basis)


def pushed(made: Any, pressure: MovingPressure) -> tuple[Any, Floats, Floats]:
    """Load operator (3 n, k), points (k, 3) in metre and unit pressures (j, k) along a path, where
    it pushes a meshed body.
    """
    P, points = surface_load(made)
    knots = path_samples(pressure)
    spots = pressure.spot(points, knots[:: 1 if len(knots) < MANY else 2])
    near = spots.max(axis=0) > NOWHERE * spots.max()  # of a large body most is never pushed
    # As columns: taken out of coordinates they take longer than the factorisation.
    return P.tocsc()[:, near], points[near], spots[:, near]


def seen_of(made: Any, body: Body, reduced: ReducedBody, basis: Floats) -> Reduced:
    """A reduced body with what a page shows of it, in the basis (3 n, r) of its coordinates."""
    inwards = (1 - 1e-6) * places()  # a body may end where the area does
    within = fem.on_surface(made.mesh, inwards)
    read = surface_motion(body, made, inwards[within]) @ basis
    shape, nodes = skin_of(made, body)
    return Reduced(
        body=reduced, read=read, within=within, made=made, shape=shape, nodes=nodes,
        basis=basis.astype(np.float32, order="C"),
    )  # fmt: skip


def of_materials(found: tuple[FreeBody, Reduced], body: Body) -> Reduced:
    """A body of other materials within the range of one."""
    whole, own = found
    made = replace(own.made, material=dict(enumerate(relaxing(body, FIT_TOLERANCE).solids)))
    return replace(own, body=reduced_at(whole, body), made=made)


def _at_nodes(rows: sparse.csr_array, basis: NDArray[np.float32]) -> Floats:
    """Product of sparse rows (k, 3 n) with a basis (3 n, r), of which they take next to nothing."""
    used = np.unique(rows.indices)
    return np.asarray(rows[:, used] @ basis[used])


def _at_probe(body: Reduced, scene: Scene, motion: ReducedResponse) -> Response:
    """The quantity that a scene's probe reads, from rest."""
    times, asked = sample_times(scene), scene.reading.asked
    rows, solids = probe_rows(scene.body, body.made, scene.probe_points, scene.reading)
    components = in_motion(read_at(motion, _at_nodes(rows, body.basis)), asked, solids)
    return Response(
        model="fem", times=times, probes=scene.probe_points, quantity=asked.name,
        values=asked.waveforms(from_rest(components, times), 1), effort=body.body.effort,
    )  # fmt: skip


def reduced_lines_at(body: Reduced, scene: Scene) -> tuple[Floats, fem.Complex]:
    """Frequencies (f,) in Hz and steady lines (f,) in metre of a scene's probe."""
    motion = respond(body.body, _steady(scene.pressure))
    rows, _ = probe_rows(scene.body, body.made, scene.probe_points, scene.reading)
    return motion.frequencies, (motion.lines @ _at_nodes(rows, body.basis).T)[:, 0]


def reduced_answer(body: Reduced, scene: Scene, moving: bool = False) -> Answer:
    """Quantity of a scene's probe from rest, and RMS motion of the area."""
    motion = respond(body.body, scene.pressure)
    response = _at_probe(body, scene, motion)
    if scene.tacton.rhythm:
        motion = respond(body.body, _steady(scene.pressure))
    f = motion.frequencies
    heard = select_lines(motion, (f > 1e-6) & (f <= BAND))
    area = np.full((len(heard.lines), SIDE**2), np.nan, np.complex128)
    area[:, body.within] = heard.lines @ body.read.T
    seen = None
    if moving:
        upwards = heard.lines @ body.basis[3 * body.nodes + 2].T
        seen = moving_of(body.shape, scene.pressure, heard.frequencies, upwards)
    return answer_of(scene, response, motion_map(scene, heard.frequencies, area), seen)
