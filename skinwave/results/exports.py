"""Results for other programs: tables, sound, and fields that ParaView opens."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from simple_model import Response
from simple_model.load.sampling import step
from skinwave.results.files import folder_name
from skinwave.results.outputs import output_file
from skinwave.results.views import View, field_frames
from skinwave.system.table import Table

PARAVIEW_ORDER = [0, 1, 2, 3, 5, 4]  # of the components of a tensor


def write_probes(stem: Path, response: Response) -> None:
    """Write `stem`.csv, with a column for each probe, and `stem`.npz, with times `t` in s, `probes`
    in m and values (t, p) under the name of their quantity, in its SI unit.
    """
    kind = response.quantity
    places = [f"({1e3 * x:g},{1e3 * y:g})" for x, y in response.probes]
    header = ["t [s]", *(f"{kind}{place} [{response.unit}]" for place in places)]
    table = Table(header, np.column_stack([response.times, response.values]).tolist(), stored=9)
    stem.with_suffix(".csv").write_bytes(table.to_csv())
    arrays = {"t": response.times, "probes": response.probes, kind: response.values}
    np.savez(stem.with_suffix(".npz"), **arrays)  # type: ignore[arg-type]


def write_sound(folder: Path, response: Response, probe: int) -> Path:
    """Write a probe's waveform about its mean as a WAV file (16 bit, mono) and return its path.
    Full scale is the largest value of the waveform, which the file name states.
    """
    from scipy.io import wavfile

    motion = response.values[:, probe] - response.values[:, probe].mean()
    largest = float(np.abs(motion).max())
    samples = np.round(motion / (largest or 1.0) * 32767).astype(np.int16)
    plain_letters = str.maketrans({"µ": "u", "/": "_", "²": "2", "³": "3"})  # for file names
    unit = response.record.shown.translate(plain_letters)
    x, y = 1e3 * response.probes[probe]
    scale = f"{response.record.per_unit * largest:.4g}_{unit}"
    path = folder / f"probe_{x:g}_{y:g}_mm_full_scale_{scale}.wav"
    wavfile.write(path, round(1 / step(response.times)), samples)
    return path


def write_field(folder: Path, view: View) -> Path:
    """Write `column`.pvd with the `field_frames` of a period, and return its path.

    Bodies are 10-node tetrahedra with `displacement_m` (n, 3). Solid bodies also have `strain` and
    `stress_pa` (n, 6), tension positive, in the order XX, YY, ZZ, XY, YZ, XZ; a node between two
    materials is written once for each. The point kernel is a surface with `pressure_pa`. All values
    are about their mean; the field data `units` names the units.
    """
    frames = field_frames(len(view.times)) if view.tensors is None else view.tensors.frames
    grids = (_grid(view, frame, k) for k, frame in enumerate(frames.tolist()))
    path = folder / f"{folder_name(view.column)}.pvd"
    write_collection(path, grids, view.times[frames].tolist(), "vtu" if len(view.tets) else "vtp")
    return path


def _grid(view: View, frame: int, number: int) -> Any:
    """Return a frame of a view, the `number`-th written one, for pyvista."""
    import pyvista as pv

    if not len(view.tets):
        surface = pv.PolyData.from_regular_faces(view.points, view.triangles)
        surface["pressure_pa"] = view.inward[frame]
        return surface
    tensors, nodes, tets = view.tensors, np.arange(len(view.points)), view.tets
    if tensors is not None:
        nodes, tets = tensors.nodes, tensors.tets
    grid = pv.UnstructuredGrid({pv.CellType.QUADRATIC_TETRA: tets}, view.points[nodes])
    grid["displacement_m"] = view.motion[frame][nodes]
    if tensors is not None:
        grid["strain"] = tensors.strain[number][:, PARAVIEW_ORDER]
        grid["stress_pa"] = tensors.stress[number][:, PARAVIEW_ORDER]
    units = {"displacement_m": "m", "strain": "1", "stress_pa": "Pa"}
    grid.field_data["units"] = [f"{name}: {units[name]}" for name in grid.point_data]
    return grid


def write_collection(
    path: Path, grids: Iterable[Any], times: Sequence[float], suffix: str = "vtu",
    *, overwrite: bool = False,
) -> None:  # fmt: skip
    """Write a ParaView collection, and beside it a file of each grid of pyvista, at times in s.
    Raises a ValueError if a file exists and `overwrite` is False.
    """
    names = [f"{folder_name(path.stem)}_{k:04d}.{suffix}" for k in range(len(times))]
    check_new([path, *(path.parent / name for name in names)], overwrite)
    for name, grid in zip(names, grids, strict=True):
        grid.save(path.parent / name)
    rows = "".join(
        f'<DataSet timestep="{t:.9g}" group="" part="0" file="{name}"/>\n'
        for t, name in zip(times, names, strict=True)
    )
    text = (
        '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n'
        f"<Collection>\n{rows}</Collection>\n</VTKFile>\n"
    )
    with output_file(path, overwrite=overwrite) as file:
        file.write(text.encode())


def check_new(paths: Sequence[Path], overwrite: bool) -> None:
    """Raise a ValueError if a file exists and `overwrite` is False."""
    existing = [path for path in paths if path.exists()]
    if existing and not overwrite:
        raise ValueError(f"{existing[0]} exists. Give another name or overwrite=True")
