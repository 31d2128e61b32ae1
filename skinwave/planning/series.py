"""Prony series that stand in for modulus laws: how far off a response is by them."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from simple_model import MovingPressure
from simple_model.layers.flat_body import steady_lines
from simple_model.layers.material import Material
from simple_model.load.spectrum import load_lines
from skinwave.bodies.analytic import compliance
from skinwave.models import named
from skinwave.models.laws import STRONG, own_laws, relaxing, series_tolerance
from skinwave.models.prepared import Prepared
from skinwave.planning.records import PlanRow
from skinwave.planning.sensitivity import sensitivity
from skinwave.planning.warnings import over_tolerance
from skinwave.scene.scene import Scene

if TYPE_CHECKING:
    from skinwave.planning.records import Plan


def with_series(found: "Plan", scene: Scene, tolerance: float) -> "Plan":
    """Plan whose error counts the Prony series that its model takes for modulus laws, with a reason
    for each.

    Parameters
    ----------
    found : Plan, without them
    scene : Scene, with the body that is modelled
    tolerance : relative error that is asked for

    Returns
    -------
    Plan
    """
    solids = own_laws(scene.body)
    if not solids or not named(found.model).takes_series(scene.body):
        return found
    allowed = series_tolerance(tolerance)
    error = series_error(scene, found.model, tolerance, found.prepared)
    rows = tuple(
        PlanRow(
            what="modulus law",
            value=solid.series(allowed).words,
            reason=f"{found.model} takes it for the law; the motion of the probes is "
            f"{100 * error:.2g} % off by it",
        )
        for solid in solids
    )
    said = over_tolerance(
        f"the {rows[0].value},", error, tolerance,
        "flat-body-harmonic or fem-harmonic, which take the law itself, are",
    )  # fmt: skip
    return replace(
        found, error=found.error + error, rows=(*found.rows, *rows),
        warnings=(*found.warnings, *said),
    )  # fmt: skip


def series_error(
    scene: Scene, model: str, tolerance: float, prepared: Prepared | None = None
) -> float:
    """Relative error of the probes' motion by Prony series in place of modulus laws.

    Parameters
    ----------
    scene : Scene
    model : name of the model
    tolerance : relative error that is asked for
    prepared : Prepared, of the body and the probes of the scene on any mesh, if there is one

    Returns
    -------
    float; 0 if the model takes the laws themselves
    """
    solids, known, allowed = own_laws(scene.body), named(model), series_tolerance(tolerance)
    if not solids or not known.takes_series(scene.body):
        return 0.0
    worst = max(_deviation(solid, scene.pressure, allowed) for solid in solids)
    if known.is_infinite:
        return _moved(scene, allowed, worst)
    # A modulus that is off by d shifts natural frequencies by d / 2; at rest motion goes by d.
    return worst * max(1.0, sensitivity(scene, prepared).value / 2)


def _deviation(solid: Material, pressure: MovingPressure, allowed: float) -> float:
    """Largest relative deviation of a series from its law in its band and at the load's lines."""
    series, f = solid.series(allowed), load_lines(pressure, STRONG).frequencies
    w = 2 * np.pi * f[f >= series.band[0]]
    law = solid.complex_modulus(w)
    return max(series.error, float((np.abs(series(w) - law) / np.abs(law)).max(initial=0.0)))


def _moved(scene: Scene, allowed: float, otherwise: float) -> float:
    """Relative change of the probes' steady motion by the series, in an infinite body."""
    if scene.tacton.trajectory.shape == "recorded":
        return otherwise
    own, series = (
        steady_lines(compliance(body), scene.pressure, scene.probe_points, threshold=STRONG / 10)[1]
        for body in (scene.body, relaxing(scene.body, allowed))
    )
    size = np.maximum(np.linalg.norm(own, axis=0), 1e-300)
    return float((np.linalg.norm(series - own, axis=0) / size).max())
