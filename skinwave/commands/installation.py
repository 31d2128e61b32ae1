"""Installation check: what this machine has for this program, and how to add what it lacks."""

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec

import fem
from meshes import cache
from skinwave.report.renderer import renderer
from skinwave.system.effort import THREADS, usable_cores, versions

DRAWING = ("matplotlib", "pyvista", "vtk", "pillow")
# module, distribution, what is missing without it
OPTIONAL = (
    ("mkl", "mkl", "the fastest solver: pip install mkl (x86-64)"),
    ("imageio_ffmpeg", "imageio-ffmpeg", "MP4 films: pip install imageio imageio-ffmpeg"),
)
MISSING = "not installed"


def examine() -> list[dict[str, str]]:
    """Findings: what, its value, and the cure if it can be better; of versions, solver, renderer,
    threads, cache and optional packages.
    """
    drawn, solvers, home = renderer(), fem.available(), cache.folder()
    limits = ", ".join(f"{name}={os.environ[name]}" for name in THREADS if name in os.environ)
    found = [
        *versions().items(),
        *((name, _version(name)) for name in DRAWING),
        ("machine", f"{platform.system()} {platform.machine()}"),
        ("solver", f"{solvers[0]} (of {', '.join(solvers)})"),
        ("renderer", drawn.said if drawn.found else "none", "" if drawn.found else drawn.said),
        ("threads", f"{usable_cores()} processors" + (f", limited by {limits}" if limits else "")),
        ("cache", str(home) if home else "off, by SKINWAVE_CACHE"),
    ]
    for module, name, lost in OPTIONAL:
        installed = _version(name)  # of MKL, a library without a module, only this tells
        missing = installed == MISSING and find_spec(module) is None
        found.append((name, installed, lost if missing else ""))
    return [dict(zip(("what", "value", "cure"), (*each, ""), strict=False)) for each in found]


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return MISSING


def text(found: list[dict[str, str]]) -> str:
    """Findings as lines, each cure below what it is for, and how many there are."""
    width = max(len(each["what"]) for each in found)
    rows = []
    for each in found:
        rows.append(f"{each['what']:<{width}}  {each['value']}")
        rows += [f"{'':<{width}}  -> {each['cure']}"] if each["cure"] else []
    missing = sum(bool(each["cure"]) for each in found)
    total = f"{missing} of {len(found)} could be better" if missing else "nothing is missing"
    return "\n".join([*rows, total])
