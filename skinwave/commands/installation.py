"""Check of the installation: what this machine has, and how to install missing packages."""

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec

import fem
from meshes import cache
from skinwave.report.renderer import renderer
from skinwave.system.effort import THREADS, usable_cores, versions

MISSING = "not installed"


def examine() -> list[dict[str, str]]:
    """Return (what, value, cure) of versions, solver, renderer, threads, cache and optional
    packages; the cure is empty if none is needed.
    """
    drawing, solvers, home = renderer(), fem.available(), cache.folder()
    limits = ", ".join(f"{name}={os.environ[name]}" for name in THREADS if name in os.environ)
    found = [
        *versions().items(),
        *((name, _version(name)) for name in ("matplotlib", "pyvista", "vtk", "pillow")),
        ("machine", f"{platform.system()} {platform.machine()}"),
        ("solver", f"{solvers[0]} (of {', '.join(solvers)})"),
        (
            "renderer",
            drawing.detail if drawing.is_available else "none",
            "" if drawing.is_available else drawing.detail,
        ),
        ("threads", f"{usable_cores()} processors" + (f", limited by {limits}" if limits else "")),
        ("cache", str(home) if home else "off, by SKINWAVE_CACHE"),
    ]
    optional = (  # module, distribution, what it adds and how to install it
        ("mkl", "mkl", "fastest solver on x86-64: pip install mkl"),
        ("imageio_ffmpeg", "imageio-ffmpeg", "MP4 films: pip install imageio imageio-ffmpeg"),
    )
    for module, name, cure in optional:
        installed = _version(name)  # MKL is a library without a module
        is_missing = installed == MISSING and find_spec(module) is None
        found.append((name, installed, cure if is_missing else ""))
    return [dict(zip(("what", "value", "cure"), (*each, ""), strict=False)) for each in found]


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return MISSING


def text(found: list[dict[str, str]]) -> str:
    """Return findings as lines, each with its cure below it, and a line with their number."""
    width = max(len(each["what"]) for each in found)
    rows = []
    for each in found:
        rows.append(f"{each['what']:<{width}}  {each['value']}")
        rows += [f"{'':<{width}}  -> {each['cure']}"] if each["cure"] else []
    count = sum(bool(each["cure"]) for each in found)
    total = f"{count} of {len(found)} can be improved" if count else "nothing is missing"
    return "\n".join([*rows, total])
