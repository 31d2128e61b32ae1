"""A body from a surface or mesh in a file."""

import argparse
from pathlib import Path

from skinwave.commands.common import add_output, add_size, progress_of, summarise


def options(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line options."""
    parser.add_argument(
        "file", type=Path, metavar="FILE", help="surface (stl, ply, obj, off, glb, vtp) or mesh "
        "(vtu, msh, inp, vtk, vtkhdf, xdmf, med, bdf, mesh)",
    )  # fmt: skip
    parser.add_argument("--unit", default="m", help="of the file: m (default), cm, mm, um or in")
    parser.add_argument("--up", default="+z", help="axis that points to the device (default +z)")
    parser.add_argument(
        "--inner", type=Path, action="append", default=[], metavar="FILE",
        help="closed surface inside it, such as a bone's, a region by the name of its file; again "
        "for more",
    )  # fmt: skip
    parser.add_argument(
        "--clip", type=float, nargs=4, metavar=("XMIN", "XMAX", "YMIN", "YMAX"),
        help="keep this patch, mm from the middle of the palm",
    )  # fmt: skip
    parser.add_argument(
        "--keep", choices=["all", "largest"], default="all",
        help="largest: drop all but the largest of several separate pieces",
    )  # fmt: skip
    parser.add_argument(
        "--cap", action="store_true", help="close holes in a plane, such as an open wrist"
    )
    add_size(parser, default=4.0, help="element size, mm (4)")
    parser.add_argument("--timeout", type=float, default=600.0, metavar="S", help="of the mesher")
    add_output(parser, "FILE.vtu", "file to write")


def run(options: argparse.Namespace) -> int:
    """Run the command; the exit code."""
    import numpy as np

    from meshes import body_from_file, dihedral_angles, write
    from meshes.files.mesh_files import WRITTEN
    from skinwave.results.outputs import output_path

    out = options.out or Path(f"{options.file.stem}-mesh.vtu")
    if out.suffix.lower() not in WRITTEN:
        raise ValueError(f"{out} cannot be written; name a file that ends in .vtu or .msh")
    if not out.parent.is_dir():
        raise ValueError(f"{out.parent} is no folder; make it or choose another --out")
    said: list[str] = []
    with (
        output_path(
            out, overwrite=options.overwrite, inputs=[options.file, *options.inner]
        ) as aside,
        progress_of(options) as progress,
    ):
        mesh = body_from_file(
            options.file, options.h / 1e3,
            unit=options.unit, up=options.up, inner=options.inner, timeout=options.timeout,
            keep_largest=options.keep == "largest", cap=options.cap, say=said.append,
            progress=progress,
            clip=None if options.clip is None else [side / 1e3 for side in options.clip],
        )  # fmt: skip
        progress("writing", 0.9)
        write(aside, mesh)
    summary = {
        "out": str(out),
        "tetrahedra": len(mesh.tets),
        "points": len(mesh.points),
        "least_dihedral_angle": round(float(dihedral_angles(mesh).min()), 2),
        "facets": {name: len(facets) for name, facets in sorted(mesh.facets.items())},
        "regions": {
            mesh.region_names.get(r, str(r)): int((mesh.region == r).sum())
            for r in np.unique(mesh.region).tolist()
        },
        "said": said,
    }
    sets = ", ".join(f"{name} {len(facets):,}" for name, facets in sorted(mesh.facets.items()))
    summarise(options, summary, "\n".join([*said, f"facets: {sets}", f"wrote {out}"]))
    return 0
