"""Samples of a moving load in equal cells of time, accurate at its jumps.

The transform of a load that is smooth except for jumps follows from its samples v at the middles of
cells of length h,

    int q(t) exp(-i w t) dt = h sum_i v_i exp(-i w t_i)

if the samples near a jump d have its moments. A jump at e cells from the middle of cell 0 sets

    v_-1 += (p + s) d,   v_0 = (1/2 + e) q_before + (1/2 - e) q_after - 2 s d,   v_1 += (s - p) d

with p = e^2/4 - 1/24 and s = -e^3/6. The error is (w h)^4/100 of the jump.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from math import lcm

import numpy as np
from scipy import fft, sparse

from simple_model.load.focus import REACH, spot_detail
from simple_model.load.pressure import MovingPressure
from simple_model.load.tacton import tones
from simple_model.load.trajectory import LEAST_JUMP, SAME_PHASE, Trajectory, differ
from simple_model.typing import Complex, Floats, Ints

HIGHEST = 10_000.0  # Hz: higher lines of jumps, pulses and recordings move bodies by 0.1 %
SAMPLE_RATE = 2.5 * HIGHEST  # Hz, of a load with jumps
KNOTS_PER_WIDTH = 8  # of the focal spot: corners are accurate to 1e-4
AT_ONCE = 2**22  # values transformed at a time, about 100 MB


@dataclass(frozen=True, kw_only=True, eq=False)
class PathCells:
    """One repetition of a load in k equal cells, `frequency` times a second.

    Cell by cell, the load is the matrix `cells` (k, q) times the effect of a focus of unit pressure
    at `positions` (q, 2) in m. It is one focus of unit pressure that runs once along the path or,
    if `of_tacton`, the whole load in Pa: if there is a rhythm or a signal, or if the Tacton is too
    short for a path that jumps.
    """

    positions: Floats
    cells: sparse.csr_array
    frequency: float
    of_tacton: bool


@lru_cache(maxsize=4)
def path_cells(pressure: MovingPressure) -> PathCells:
    """Return the cells of the path of a load, or of the whole Tacton."""
    tacton = pressure.tacton
    of_tacton = tacton.is_sampled or is_cut_short(pressure)
    if of_tacton:
        count = max(2, int(np.ceil(_rate(pressure) * tacton.duration)))
        jumps = jump_times(pressure, 0.0, tacton.duration)
        if not _ends_as_it_begins(pressure):
            jumps = np.append(jumps, 0.0)
        times, shares = cells(jumps, 0.0, tacton.duration / count, count)
        whole, gain, frequency = pressure, pressure.gain(times), 1 / tacton.duration
    else:
        frequency = tacton.trajectory.drawing_frequency
        jumps, count = jump_phases(pressure), _count(pressure)
        phases, shares = cells(jumps, 0.0, 1 / count, count)
        times, gain = phases / (frequency or 1.0), np.ones(len(phases))
        whole = replace(pressure, tacton=replace(tacton, foci=(0.0,)))
    if tacton.trajectory.is_static and not of_tacton:  # foci that rest have places of their own
        at, n = tacton.trajectory.at_phase(np.mod(tacton.foci, 1.0)), len(tacton.foci)
        return PathCells(
            positions=at, cells=sparse.csr_array(np.full((1, n), 1 / n)), frequency=frequency,
            of_tacton=False,
        )  # fmt: skip
    positions, mixed = sampled_load(whole, times, gain)
    mixed = (shares @ mixed).tocsr()
    return PathCells(positions=positions, cells=mixed, frequency=frequency, of_tacton=of_tacton)


def _ends_as_it_begins(pressure: MovingPressure) -> bool:
    """Whether the load repeats without a jump after the Tacton."""
    tacton = pressure.tacton
    ends = tacton.duration * np.array([SAME_PHASE, 1 - SAME_PHASE])
    begins, stops = pressure.gain(ends)
    path = tacton.trajectory
    each = [np.mod(path.phase(ends) + ahead, 1.0) for ahead in tacton.foci]
    places = [np.column_stack([path.at_phase(p), path.level_at_phase(p)]) for p in each]
    moved = any(differ(place[:1], place[1:]).any() for place in places)
    return not moved and bool(
        abs(begins - stops) <= LEAST_JUMP[1] * abs(pressure.gain_at(np.ones(1))).max()
    )


def sampled_load(
    pressure: MovingPressure, times: Floats, factors: Floats
) -> tuple[Floats, sparse.csr_array]:
    """Sample the load of all foci at times (m,) in s, with factors (m,) in Pa.

    Returns positions (q, 2) in m and the matrix (m, q) in Pa that combines foci of unit pressure
    there.
    """
    tacton = pressure.tacton
    path, detail = tacton.trajectory, spot_detail(pressure.height, pressure.profile)
    each = [np.mod(path.phase(times) + ahead, 1.0) for ahead in tacton.foci]
    parts = [along_path(path, phases, detail) for phases in each]
    mixed = [
        sparse.diags_array(factors * pressure.weight(phases)) @ mixing
        for phases, (_, mixing) in zip(each, parts, strict=True)
    ]
    positions, first, which = np.unique(
        np.vstack([at for at, _ in parts]), axis=0, return_index=True, return_inverse=True
    )
    order = np.argsort(first)  # along the path
    ranks = np.argsort(order)[which.ravel()]
    merged = sparse.csr_array((np.ones(len(ranks)), (np.arange(len(ranks)), ranks)))
    return positions[order], (sparse.hstack(mixed) @ merged).tocsr()


def path_samples(pressure: MovingPressure) -> Floats:
    """Positions (q, 2) in m that make up a load; one if the focus is static."""
    return path_cells(pressure).positions


def path_fourier(
    pressure: MovingPressure, values: Floats | Complex, orders: Ints | None = None, few: int = 16
) -> Complex:
    """Fourier coefficients (..., n) of the effect of a load, for given orders (n,) or all.

    `values` (..., q) are the effects of a focus of unit pressure at each of `path_samples`. Index
    -n is harmonic -n. For fewer positions than `few`, the load is transformed, not the values.
    """
    mixing = path_cells(pressure).cells
    k, shape, rows = mixing.shape[0], values.shape[:-1], values.reshape(-1, values.shape[-1])
    wanted = np.arange(k) if orders is None else orders
    shift = np.exp(-1j * np.pi * np.fft.fftfreq(k)[wanted]) / k
    if mixing.shape[1] < min(len(rows), few):
        return np.asarray(values @ (fft.fft(mixing.toarray(), axis=0)[wanted].T * shift))
    blocks = np.array_split(rows, max(1, len(rows) * k // AT_ONCE))
    transformed = [fft.fft((mixing @ block.T).T, axis=-1)[:, wanted] * shift for block in blocks]
    return np.asarray(np.concatenate(transformed).reshape(*shape, len(wanted)))


def harmonics(pressure: MovingPressure) -> Ints:
    """Orders of the harmonics of `path_fourier` that the cells of the path resolve, ascending."""
    k = path_cells(pressure).cells.shape[0]
    return np.arange(-((k - 1) // 2), (k + 1) // 2)


def cells(jumps: Floats, start: float, width: float, count: int) -> tuple[Floats, sparse.csr_array]:
    """Times (m,) in s of the samples of `count` periodic cells, and their shares (count, m) in the
    cells.

    The cells begin at `start` and have the length `width`, in s; `jumps` (j,) in s are within them.
    """
    at = np.unique(np.mod(np.round((jumps - start) / width, 9), count))
    bounds = np.union1d(np.arange(count + 1), at)
    middles, lengths = (bounds[1:] + bounds[:-1]) / 2, np.diff(bounds)
    rows, columns, shares = [middles.astype(int)], [np.arange(len(middles))], [lengths]
    cell, after = np.minimum(at.astype(int), count - 1), np.searchsorted(middles, at)
    e = at - cell - 0.5
    p, s = e**2 / 4 - 1 / 24, -(e**3) / 6
    for row, share in ((cell - 1, s + p), (cell, -2 * s), (cell + 1, s - p)):
        for sign, piece in ((1, after), (-1, after - 1)):
            rows.append(row % count)
            columns.append(piece % len(middles))
            shares.append(sign * share)
    table = (np.concatenate(shares), (np.concatenate(rows), np.concatenate(columns)))
    return start + width * middles, sparse.csr_array(table, shape=(count, len(middles)))


def jump_phases(pressure: MovingPressure) -> Floats:
    """Fractions (j,) of the period at which a focus jumps in position or level.

    Moves shorter than a cell count as jumps at their ends; with a heading, turns count too.
    """
    path = pressure.tacton.trajectory
    bounds, lengths = path.parts
    if pressure.heading:
        return np.union1d(path.jumps, path.turns)
    if path.shape != "recorded":
        return path.jumps
    brief = np.diff(bounds) * path.times[-1] < 1 / SAMPLE_RATE
    brief &= lengths > spot_detail(pressure.height, pressure.profile) / 2
    return np.unique(np.mod(np.concatenate([path.jumps, bounds[:-1][brief], bounds[1:][brief]]), 1))


def jump_times(pressure: MovingPressure, start: float, end: float) -> Floats:
    """Times (j,) in s, from start to end, at which the load jumps somewhere."""
    tacton, phases = pressure.tacton, jump_phases(pressure)
    f_d = tacton.trajectory.drawing_frequency
    parts = [np.empty(0)]
    for ahead in tacton.foci if f_d and len(phases) else ():
        turns = np.arange(np.floor(f_d * start), np.ceil(f_d * end) + 2)
        parts.append((turns[:, None] + phases - ahead).ravel() / f_d)
    if tacton.rhythm and len(edges := tacton.rhythm.edges):
        period = tacton.rhythm.period
        turns = np.arange(np.floor(start / period), np.ceil(end / period) + 1)
        parts.append((turns[:, None] * period + edges).ravel())
    times = np.unique(np.concatenate(parts))
    return times[(times >= start) & (times <= end)]


def along_path(
    path: Trajectory, phases: Floats, detail: float, nodes_per_detail: float = 16
) -> tuple[Floats, sparse.csr_array]:
    """Positions (q, 2) in m on a path, and the matrix (m, q) that interpolates to phases (m,),
    accurate to 1e-6.

    Cubics interpolate along each part of the path that has more phases than nodes.
    """
    bounds, lengths = path.parts
    part = np.clip(np.searchsorted(bounds, phases, side="right") - 1, 0, len(lengths) - 1)
    nodes = np.ceil(nodes_per_detail * lengths / detail).astype(int) + 4
    dense = (np.bincount(part, minlength=len(lengths)) > nodes) & (lengths > 0)
    own = np.flatnonzero(~dense[part])
    positions, q = [path.at_phase(phases[own])], len(own)
    rows, columns, shares = [own], [np.arange(q)], [np.ones(q)]
    for k in np.flatnonzero(dense).tolist():
        mine = np.flatnonzero(part == k)
        at = path.within_part(k, np.linspace(0, 1, nodes[k]))
        u = (phases[mine] - bounds[k]) / (bounds[k + 1] - bounds[k]) * (nodes[k] - 1)
        base = np.clip(np.floor(u).astype(int) - 1, 0, nodes[k] - 4)
        x = u - base
        cardinal = (
            -(x - 1) * (x - 2) * (x - 3) / 6, x * (x - 2) * (x - 3) / 2,
            -x * (x - 1) * (x - 3) / 2, x * (x - 1) * (x - 2) / 6,
        )  # fmt: skip
        for j, share in enumerate(cardinal):
            rows.append(mine)
            columns.append(q + base + j)
            shares.append(share)
        positions.append(at)
        q += nodes[k]
    table = (np.concatenate(shares), (np.concatenate(rows), np.concatenate(columns)))
    return np.vstack(positions), sparse.csr_array(table, shape=(len(phases), q))


def is_abrupt(pressure: MovingPressure) -> bool:
    """Whether a load jumps or has levels, so that its lines decay slowly.

    Closed paths that are joined do not jump.
    """
    tacton, jumps = pressure.tacton, jump_phases(pressure)
    n, path = tacton.n_paths, tacton.trajectory
    within = np.abs(jumps * n - np.round(jumps * n)) > SAME_PHASE
    if path.levels or within.any() or (len(jumps) and (n == 1 or pressure.heading)):
        return True
    begins, ends = path.limits_at(np.arange(n) / n)[1], path.limits_at(np.arange(1, n + 1) / n)[0]
    return bool(len(jumps) and differ(begins, ends).any())


def is_cut_short(pressure: MovingPressure) -> bool:
    """Whether a path that jumps takes longer than the Tacton."""
    f_d, duration = pressure.tacton.trajectory.drawing_frequency, pressure.tacton.duration
    return 0 < f_d * duration < 1 - SAME_PHASE and is_abrupt(pressure)


def without_sampled_parts(pressure: MovingPressure) -> MovingPressure:
    """The load without rhythm and signal."""
    return replace(pressure, tacton=replace(pressure.tacton, rhythm=None, signal=None))


def highest_passing(pressure: MovingPressure) -> float:
    """Highest line in Hz, above 1e-7 of all, of a moving focus; at most `HIGHEST` if recorded."""
    detail = spot_detail(pressure.height, pressure.profile)
    highest = REACH / (2 * np.pi) * _top_speed(pressure.tacton.trajectory) / detail
    return min(highest, HIGHEST) if pressure.tacton.trajectory.shape == "recorded" else highest


def _count(pressure: MovingPressure, fewest: int = 132) -> int:
    """Number of cells of a path, for harmonics below half of the `fewest`; one if the focus is
    static.
    """
    path, n = pressure.tacton.trajectory, pressure.tacton.n_paths
    detail = spot_detail(pressure.height, pressure.profile)
    if path.is_static:
        return 1
    enough, whole = KNOTS_PER_WIDTH * path.length / detail, 12
    lines = SAMPLE_RATE / path.drawing_frequency
    if path.shape == "recorded":
        speeds, seconds = _moves(path)
        even = np.ptp(seconds) < 1e-9 * path.times[-1]
        whole = lcm(len(seconds), n) if even else 12 * n
        if not is_abrupt(pressure):
            enough = min(KNOTS_PER_WIDTH * float(speeds.max()) * path.times[-1] / detail, lines)
    if is_abrupt(pressure):
        return int(fft.next_fast_len(int(np.ceil(max(enough, lines, fewest)))))
    return whole * int(np.ceil(max(enough, fewest) / whole))


def _rate(pressure: MovingPressure) -> float:
    """Samples per second for a rhythm or signal, so that no line folds back below `HIGHEST`."""
    tacton, degree = pressure.tacton, pressure.law.degree
    made = highest_passing(pressure) + (degree or KNOTS_PER_WIDTH) * sum(tones(tacton))
    made += tacton.signal.rate if tacton.signal else 0.0
    return max(40_000.0, HIGHEST + made)  # periods in milliseconds are whole cells


def _top_speed(path: Trajectory, brief: float = 0.01) -> float:
    """Largest speed of a focus in m/s; a recording moves faster for at most the fraction `brief` of
    its time.
    """
    if path.shape != "recorded":
        return path.drawing_frequency * path.length * (np.pi / 2 if path.is_eased else 1.0)
    speeds, seconds = _moves(path)
    order = np.argsort(speeds)
    passed = np.cumsum(seconds[order])
    at = np.searchsorted(passed, (1 - brief) * passed[-1])
    return float(speeds[order[min(at, len(order) - 1)]])


def _moves(path: Trajectory) -> tuple[Floats, Floats]:
    """Speeds (k,) in m/s and times (k,) in s of the moves of a recording, without its jumps."""
    steps = np.diff(path.times)
    moves = steps > 0
    lengths = np.linalg.norm(np.diff(path.outline, axis=0), axis=1)
    return lengths[moves] / steps[moves], steps[moves]
