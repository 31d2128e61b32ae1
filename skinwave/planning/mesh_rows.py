"""Rows of a plan that say which mesh it takes, and why."""

from skinwave.models.prepared import reduction_tolerance
from skinwave.models.reduction import BAND
from skinwave.models.symmetry import axes_of_probes, mirrored_axes
from skinwave.planning.extent import coat_rows, left_out
from skinwave.planning.records import PlanRow
from skinwave.planning.refinement import Convergence, Refined
from skinwave.scene.scene import Scene


def element_rows(
    scene: Scene, tolerance: float, axes: str, found: Refined, highest: float, h: float | None
) -> list[PlanRow]:
    """Rows of symmetry, mesh, layers, reduction, neglected physics and cost.

    Parameters
    ----------
    scene : Scene
    tolerance : relative error that is asked for
    axes : across which the load is its own mirror image
    found : Refined
    highest : Hz, of the lines that count
    h : metre, element size, if it was asked for

    Returns
    -------
    PlanRow for each
    """
    effort = found.prepared.effort
    kept = "" if "factorise and reduce" in effort.seconds else ", which is cached"
    return [
        _symmetry_row(scene, axes),
        _size_row(found, tolerance, h),
        *coat_rows(scene.body, found.h),
        PlanRow(
            what="reduction",
            value=f"{effort.reduced_dofs} dofs, {effort.estimate:.0e} up to {BAND:.0f} Hz",
            reason=f"asked for {reduction_tolerance(tolerance):.1g}: it costs little",
        ),
        *left_out(scene, highest),
        PlanRow(
            what="cost",
            value=f"{sum(effort.seconds.values()):.1f} s, {effort.peak_memory / 2**30:.1f} GiB",
            reason=f"the last mesh{kept}; 0.05 s for each further Tacton on the same body",
        ),
    ]


def _symmetry_row(scene: Scene, axes: str) -> PlanRow:
    """Row of the part that symmetry of the load, and the places of probes, leave to be modelled."""
    among = mirrored_axes(scene.body, scene.reading, scene.load)
    seen = [a for a in axes_of_probes(scene.probe_points, among) if a not in axes]
    reasons = []
    if axes:
        reasons.append(f"the load is its own mirror image across {' and '.join(axes)} = 0")
    if seen:
        reasons.append(
            f"probes at {' = '.join(seen)} = 0 see the even part of the motion across it alone"
        )
    return PlanRow(
        what="symmetry",
        value=("none", "half", "a quarter")[len(axes) + len(seen)],
        reason="; ".join(reasons) or "all of the body is modelled",
    )


def _size_row(found: Refined, tolerance: float, h: float | None) -> PlanRow:
    return PlanRow(
        what="element size",
        value=f"{1e3 * found.h:.2f} mm, {found.prepared.effort.dofs:,} dofs",
        reason=f"{_why_size(found, tolerance, h)}: those of "
        f"{1e3 * found.compared:.2f} mm differ by so much that an error of "
        f"{100 * found.error:.2g} % is left"
        if found.convergence is not Convergence.SINGLE_MESH
        else "the file's own, without another to compare it with",
    )


def _why_size(found: Refined, tolerance: float, h: float | None) -> str:
    if h:
        return "as asked"
    if found.convergence is not Convergence.REACHED:
        return "the finest that is tried"
    return f"refined until less than {100 * tolerance:g} % is left"
