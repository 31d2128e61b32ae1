"""Installation check: what this machine has for this program, and how to add what it lacks."""

import os
import platform
from dataclasses import dataclass
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


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One finding; `cure` says how to improve it, if it can be."""

    what: str
    value: str
    cure: str = ""


def examine() -> list[Finding]:
    """Versions, solver, renderer, threads, cache and what is missing."""
    drawn, solvers, home = renderer(), fem.available(), cache.folder()
    return [
        *(Finding(what=name, value=value) for name, value in versions().items()),
        *(Finding(what=name, value=_version(name)) for name in DRAWING),
        Finding(what="machine", value=f"{platform.system()} {platform.machine()}"),
        Finding(what="solver", value=f"{solvers[0]} (of {', '.join(solvers)})"),
        Finding(
            what="renderer", value=drawn.said if drawn.found else "none",
            cure="" if drawn.found else drawn.said,
        ),
        Finding(what="threads", value=_threads()),
        Finding(what="cache", value=str(home) if home else "off, by SKINWAVE_CACHE"),
        *(_optional(*entry) for entry in OPTIONAL),
    ]  # fmt: skip


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


def _threads() -> str:
    """How many threads may be used, and what limits them."""
    limits = ", ".join(f"{name}={os.environ[name]}" for name in THREADS if name in os.environ)
    return f"{usable_cores()} processors" + (f", limited by {limits}" if limits else "")


def _optional(module: str, name: str, lost: str) -> Finding:
    # MKL is a library without a module: only its distribution tells.
    installed = _version(name)
    missing = installed == "not installed" and find_spec(module) is None
    return Finding(what=name, value=installed, cure=lost if missing else "")


def text(found: list[Finding]) -> str:
    """Findings as lines, each cure below what it is for, and how many there are."""
    width = max(len(each.what) for each in found)
    rows = []
    for each in found:
        rows.append(f"{each.what:<{width}}  {each.value}")
        rows += [f"{'':<{width}}  -> {each.cure}"] if each.cure else []
    missing = sum(bool(each.cure) for each in found)
    total = f"{missing} of {len(found)} could be better" if missing else "nothing is missing"
    return "\n".join([*rows, total])
