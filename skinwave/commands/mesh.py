"""Make a tetrahedral body from a file with a surface or a mesh."""

import argparse
from pathlib import Path

from skinwave.commands.common import add_options, add_output, progress_of, summarise


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    add = parser.add_argument
    add(
        "file", type=Path, metavar="FILE", help="surface (stl, ply, obj, off, glb, vtp) or mesh "
        "(vtu, msh, inp, vtk, vtkhdf, xdmf, med, bdf, mesh)",
    )  # fmt: skip
    add_options(parser, "--unit", "--up")
    add(
        "--inner", type=Path, action="append", default=[], metavar="FILE",
        help="closed surface inside the body, such as a bone, which becomes a region with the name "
        "of its file; may be repeated",
    )  # fmt: skip
    add(
        "--clip", type=float, nargs=4, metavar=("XMIN", "XMAX", "YMIN", "YMAX"),
        help="keep only this patch, in mm from the middle of the palm",
    )  # fmt: skip
    add(
        "--keep", choices=["all", "largest"], default="all",
        help="pieces to keep if the file has several: all (default) or the largest",
    )  # fmt: skip
    add("--cap", action="store_true", help="close plane holes, such as an open wrist")
    add(
        "--element-size", dest="h", type=float, default=4.0, metavar="MM",
        help="element size in mm (default: 4)",
    )  # fmt: skip
    add(
        "--timeout", type=float, default=600.0, metavar="S",
        help="time limit of the mesher in s (default: 600)",
    )  # fmt: skip
    add_output(parser, "FILE", "file to write, .vtu or .msh")


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit code."""
    import numpy as np

    from meshes import body_from_file, dihedral_angles, write
    from meshes.files.mesh_files import WRITTEN
    from skinwave.results.outputs import output_path

    out = options.out or Path(f"{options.file.stem}-mesh.vtu")
    if out.suffix.lower() not in WRITTEN:
        raise ValueError(f"{out} is not a mesh file; give a name that ends in .vtu or .msh")
    if not out.parent.is_dir():
        raise ValueError(f"folder {out.parent} does not exist; create it or change --out")
    notes: list[str] = []
    inputs = [options.file, *options.inner]
    with (
        output_path(out, overwrite=options.overwrite, inputs=inputs) as aside,
        progress_of(options) as progress,
    ):
        mesh = body_from_file(
            options.file, options.h / 1e3,
            unit=options.unit, up=options.up, inner=options.inner, timeout=options.timeout,
            keep_largest=options.keep == "largest", cap=options.cap, say=notes.append,
            progress=progress,
            clip=None if options.clip is None else [side / 1e3 for side in options.clip],
        )  # fmt: skip
        progress("writing", 0.9)
        write(aside, mesh)
    facets = {name: len(found) for name, found in sorted(mesh.facets.items())}
    summary = {
        "out": str(out), "tetrahedra": len(mesh.tets), "points": len(mesh.points),
        "least_dihedral_angle": round(float(dihedral_angles(mesh).min()), 2), "facets": facets,
        "regions": {
            mesh.region_names.get(r, str(r)): int((mesh.region == r).sum())
            for r in np.unique(mesh.region).tolist()
        },
        "said": notes,
    }  # fmt: skip
    sets = ", ".join(f"{name} {count:,}" for name, count in facets.items())
    return summarise(options, summary, [*notes, f"facets: {sets}", f"wrote {out}"])
