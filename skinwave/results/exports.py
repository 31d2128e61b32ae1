"""Results for other programs: tables, sound, and fields that ParaView opens."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshes.tetmesh import Floats
from simple_model import Response
from simple_model.load.sampling import step
from skinwave.results.files import folder_name
from skinwave.results.views import View, field_frames
from skinwave.system.plain_text import csv_table

PARAVIEW = [0, 1, 2, 3, 5, 4]  # its order of the components of a tensor
UNITS = {"displacement_m": "m", "strain": "1", "stress_pa": "Pa"}
FULL_SCALE = 32767
IN_NAMES = str.maketrans({"µ": "u", "/": "_", "²": "2", "³": "3"})  # of files


def write_probes(stem: Path, response: Response) -> None:
    """`stem`.csv, a column a probe with its place in mm and its unit in the header, and `stem`.npz
    with `t` s, `probes` m and, by the name of its quantity, the values (t, p) in its unit.
    `skinwave.measure.reading.read` takes both.
    """
    kind = response.quantity
    places = [f"({1e3 * x:g},{1e3 * y:g})" for x, y in response.probes]
    header = ["t [s]", *(f"{kind}{place} [{response.unit}]" for place in places)]
    table = waveform_table(header, [response.times, *response.values.T])
    stem.with_suffix(".csv").write_bytes(table)
    arrays = {"t": response.times, "probes": response.probes, kind: response.values}
    np.savez(stem.with_suffix(".npz"), **arrays)  # type: ignore[arg-type]


def waveform_table(header: Iterable[str], columns: Sequence[Floats]) -> bytes:
    """Columns (t,) as CSV to nine digits, below their names."""
    rows = zip(*columns, strict=True)
    return csv_table(header, ([f"{value:.9g}" for value in row] for row in rows))


def sampled(response: Response, probe: int) -> tuple[NDArray[np.int16], float]:
    """A probe's waveform about its mean in 16 bit, and what of it is the largest that they hold."""
    motion = response.values[:, probe] - response.values[:, probe].mean()
    largest = float(np.abs(motion).max())
    return np.round(motion / (largest or 1.0) * FULL_SCALE).astype(np.int16), largest


def write_sound(folder: Path, response: Response, probe: int) -> Path:
    """A probe's waveform about its mean as a WAV file (16 bit, mono), at its own rate of sampling.

    The largest value that the format holds is that of the waveform; the name says how much it is.
    """
    from scipy.io import wavfile

    samples, largest = sampled(response, probe)
    per = response.record.per_unit
    unit = response.record.shown.translate(IN_NAMES)
    x, y = 1e3 * response.probes[probe]
    path = folder / f"probe_{x:g}_{y:g}_mm_full_scale_{per * largest:.4g}_{unit}.wav"
    wavfile.write(path, round(1 / step(response.times)), samples)
    return path


def write_field(folder: Path, view: View) -> Path:
    """`column`.pvd and a file of each of `FIELD_FRAMES` frames through a period; the .pvd.

    Bodies are 10-node tetrahedra with `displacement_m` (n, 3) and, but for sheets, whose mesh has
    another thickness, `strain` and `stress_pa` (n, 6), tension positive, in ParaView's order of
    components, XX, YY, ZZ, XY, YZ, XZ; nodes between two materials are there for each. The point
    kernel is a surface with `pressure_pa`. All are about their mean; field data name their units.
    """
    frames = field_frames(len(view.times)) if view.tensors is None else view.tensors.frames
    names, stem = [], folder_name(view.column)  # which was read from a file
    for k, frame in enumerate(frames.tolist()):
        ending = "vtu" if len(view.tets) else "vtp"
        names.append(f"{stem}_{k:03d}.{ending}")
        _grid(view, frame, k).save(folder / names[-1])
    path = folder / f"{stem}.pvd"
    path.write_text(collection(names, [float(view.times[f]) for f in frames]), encoding="utf-8")
    return path


def _grid(view: View, frame: int, number: int) -> Any:
    """A frame of a view, which is the `number`-th of those that are written."""
    import pyvista as pv

    if not len(view.tets):
        surface = pv.PolyData.from_regular_faces(view.points, view.triangles)
        surface["pressure_pa"] = view.pushed[frame]
        return surface
    kept = view.tensors
    nodes, tets = (np.arange(len(view.points)), view.tets) if kept is None else (
        kept.nodes, kept.tets
    )  # fmt: skip
    kinds = {4: pv.CellType.TETRA, 10: pv.CellType.QUADRATIC_TETRA}
    cells = np.insert(tets, 0, tets.shape[1], axis=1).ravel()
    grid = pv.UnstructuredGrid(cells, np.full(len(tets), kinds[tets.shape[1]]), view.points[nodes])
    grid["displacement_m"] = view.motion[frame][nodes]
    if kept is not None:
        grid["strain"] = kept.strain[number][:, PARAVIEW]
        grid["stress_pa"] = kept.stress[number][:, PARAVIEW]
    units = {name: UNITS[name] for name in grid.point_data}
    grid.field_data["units"] = [f"{name}: {unit}" for name, unit in units.items()]
    return grid


def collection(names: Sequence[str], times: Sequence[float]) -> str:
    """ParaView collection: the file that belongs to each time in s."""
    rows = "".join(
        f'<DataSet timestep="{t:.9g}" group="" part="0" file="{name}"/>\n'
        for t, name in zip(times, names, strict=True)
    )
    return (
        '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n'
        f"<Collection>\n{rows}</Collection>\n</VTKFile>\n"
    )
