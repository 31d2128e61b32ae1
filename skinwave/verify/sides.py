"""Reflections from the absorbing sides of a body that stands for a laterally infinite one."""

from dataclasses import replace

import numpy as np

import fem
import meshes
from skinwave.bodies.absorbing_layer import layer_drag, layer_of
from skinwave.bodies.slab import slab_lines
from skinwave.scene.scene import Body
from skinwave.verify.case import Case, Plot, below
from skinwave.verify.statics import WIDTH

HERTZ = np.array([20.0, 51.0, 70.0, 80.0, 90.0, 100.0, 111.0, 140.0, 191.0, 271.0])
PROBES = np.arange(5) * 0.005  # m
H, SLAB = 2.5e-3, Body(width=0.05, height=0.05)


def layer_around_a_slab() -> Case:
    """Absorbing layer around a plane slab on a rigid base, whose first mode cuts on at 83 Hz."""
    infinite = _motion(replace(SLAB, width=1.6), layer=True)
    found = {name: _motion(SLAB, layer=name == "layer") for name in ("layer", "dashpots alone")}
    errors = {
        name: np.abs(u - infinite).max(axis=1) / np.abs(infinite).max(axis=1)
        for name, u in found.items()
    }
    return Case(
        title="An absorbing layer around a slab suppresses reflections",
        source="a body so wide that no reflections arrive; dashpots: Lysmer and Kuhlemeyer (1969)",
        mesh="plane slab 50 mm wide and 15 mm deep, cells of 2.5 mm, the layer 105 mm wide",
        checks=(
            below("largest error at any line, over the motion at the focus",
                  errors["layer"].max(), 0.02),
            below("at 20 and 51 Hz", errors["layer"][:2].max(), 0.001),
        ),
        plot=Plot(x="frequency, Hz", y="error over the motion at the focus", log=True,
                  lines={name: (HERTZ, error) for name, error in errors.items()}),
        note=f"With dashpots alone the error reaches {100 * errors['dashpots alone'].max():.0f} %.",
    )  # fmt: skip


def _motion(body: Body, *, layer: bool) -> fem.Complex:
    """Displacement (f, p) in metre under a line focus, in the half x > 0 of a plane slab."""
    x, _, z = slab_lines(body if layer else replace(body, sides="clamped"), H)
    mesh = meshes.half(meshes.extrude(x, [0, H], z), "x")
    ops = fem.assemble(
        mesh, body.solid, fixed={"bottom": "xyz", "mirror_x": "x", "front": "y", "back": "y"},
        absorbing="right", drag=layer_drag(body, layer_of(body), mesh) if layer else None,
    )  # fmt: skip
    x = fem.facet_points(mesh)[:, 0]
    force = fem.load_operator(mesh) @ np.exp(-(x**2) / (2 * WIDTH**2))
    S = fem.probe_operator(mesh, np.column_stack([PROBES, np.full(len(PROBES), H / 2)]))
    return np.array([S @ fem.harmonic(ops, force, f)[0] for f in HERTZ])
