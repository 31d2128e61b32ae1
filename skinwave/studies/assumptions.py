"""What the published model assumes, and a scene with some of these assumptions dropped.

The paper's model (Lim, Seifi and Park, CHI EA '24, section 2) is a round spot without side lobes
that pushes as hard as it is commanded to and is felt where it is, on a flat skin in which nothing
propagates. Each name in `ASSUMPTIONS` turns one of these off.
"""

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from simple_model import Trajectory
from skinwave.models.speeds import air_mass
from skinwave.planning.estimates import motion_lines
from skinwave.scene import BODIES, FLAT, Body, Layer, Relief, Scene, solid_of

ASSUMPTIONS = {
    "linear drive": "the force follows the square of the sound's amplitude",
    "no propagation": "waves run through an endless flat body",
    "little loss": "the material loses as much as it does",
    "endless": "the body has its own size and sides",
    "vacuum": "the air moves with the sheet",
    "main lobe only": "the focus has the side lobes of the array",
    "continuous path": "the focus jumps at the device's rate",
    "one material": "skin has layers",
    "flat": "the palm is curved, and its layers are one of their mean stiffness",
    "small deflection": "the sheet stretches as it bends",
}
DEVICE_RATE = 20_000.0  # Hz at which a device moves its focus; 40 kHz is twice as smooth
LOSS_LEFT = 0.1  # of the material's own: with none at all a resonance has no limit
LAYERS = (
    Layer(thickness=0.3e-3, material="epidermis"),
    Layer(thickness=1.0e-3, material="dermis"),
    Layer(thickness=3.0e-3, material="fat"),
)


def ladder(scene: Scene) -> tuple[str, ...]:
    """The assumptions that can be dropped for a scene, in the order of the ladder.

    Raises
    ------
    ValueError
        If the scene has no body.
    """
    body, path = scene.body, scene.tacton.trajectory
    if body.kind == "none":
        raise ValueError("a scene without a body keeps every assumption; give it one")
    sheet, slab = body.kind == "sheet", body.kind == "slab"
    kept = {
        "little loss": slab and body.solid.viscosity + body.solid.loss_factor > 0,
        "vacuum": sheet,
        "continuous path": path.shape in ("line", "circle", "triangle", "square")
        and not path.is_static,
        "one material": slab and sum(x.thickness for x in LAYERS) < body.depth,
        "flat": slab and body.placement == FLAT,
        "small deflection": sheet and body.sides == "clamped",
    }
    return tuple(name for name in ASSUMPTIONS if kept.get(name, True))


def relaxed(scene: Scene, dropped: Collection[str]) -> tuple[Scene, str]:
    """A scene without the dropped assumptions, and the model that answers it."""
    waves = "no propagation" in dropped
    elements = {"endless", "main lobe only", "continuous path", "one material", "flat",
                "small deflection"} & set(dropped)  # fmt: skip
    spot = "gaussian" if waves else "main_lobe"
    own = scene.pressure.drive if scene.pressure.drive != "linear" else "pressure_squared"
    pressure = replace(
        scene.pressure,
        focus="array" if "main lobe only" in dropped else spot,
        drive=own if "linear drive" in dropped else "linear",
    )
    if "continuous path" in dropped:
        path = held(scene.tacton.trajectory)
        pressure = replace(pressure, tacton=replace(scene.tacton, trajectory=path))
    if not waves:
        return replace(scene, pressure=pressure, body=BODIES["none"]), "point-kernel"
    body = _body(scene, dropped)
    model = "fem" if elements else "flat-body"
    if "small deflection" in dropped:
        model = "fem-nonlinear"
    return replace(scene, pressure=pressure, body=body), model


def held(path: Trajectory) -> Trajectory:
    """A path as a device draws it: a whole number of points, each held until the next."""
    period = 1 / path.drawing_frequency
    count = max(2, round(DEVICE_RATE * period))
    phases = np.arange(count) / count
    points = path.at_phase(phases)
    closed = np.vstack([points, points[:1]])
    return Trajectory(
        shape="recorded",
        points=tuple(map(tuple, closed.tolist())),
        times=tuple((period * np.append(phases, 1.0)).tolist()),
        hold=True,
    )


def _body(scene: Scene, dropped: Collection[str]) -> Body:
    body = scene.body
    solid = body.solid
    if body.kind == "slab" and "little loss" not in dropped:
        solid = replace(
            solid, viscosity=LOSS_LEFT * solid.viscosity, loss_factor=LOSS_LEFT * solid.loss_factor
        )
    if "vacuum" in dropped:
        solid = replace(solid, density=solid.density + _air_mass(scene) / body.depth)
    changes: dict[str, object] = {"material": solid if solid != body.solid else body.material}
    if "one material" in dropped:
        layers = body.layers or LAYERS
        changes["layers"] = (as_one(layers),) if "flat" in dropped else layers
    elif body.kind == "slab":
        changes["layers"] = ()
    if "flat" in dropped:
        rim = min(Relief().edge_radius, 0.45 * body.depth)
        width = min(body.width, BODIES["palm"].width)
        changes |= {"kind": "palm", "width": width, "relief": Relief(edge_radius=rim)}
    return replace(body, **changes)  # type: ignore[arg-type]


def as_one(layers: Sequence[Layer]) -> Layer:
    """A layer as thick as all and of their mean stiffness, for elements that follow none."""
    thickness = sum(layer.thickness for layer in layers)
    solids = [solid_of(layer.material) for layer in layers]

    def mean(name: str) -> float:
        parts = zip(layers, solids, strict=True)
        return sum(layer.thickness * getattr(solid, name) for layer, solid in parts) / thickness

    names = ("density", "shear_modulus", "viscosity", "loss_factor")
    material = replace(solids[0], **{name: mean(name) for name in names})
    return Layer(thickness=thickness, material=material)


def _air_mass(scene: Scene) -> float:
    """Mass of the air that moves with a sheet at the strongest moving line, kg/m2.

    It differs from line to line; elements have one mass for all.
    """
    frequencies, shares = motion_lines(scene, 0.05)
    moving = frequencies > 0
    if not moving.any():
        return 0.0
    strongest = frequencies[moving][np.argmax(shares[moving].max(axis=1))]
    return air_mass(scene.body, float(strongest))
