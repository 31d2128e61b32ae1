"""Assumptions of the published model, and a scene with some of them dropped.

The paper's model (Lim, Seifi and Park, CHI EA '24, section 2) is a round focal spot without side
lobes. Its pressure follows the command and acts only where it is applied, on flat skin in which
nothing propagates. Each name in `ASSUMPTIONS` drops one of these.

One chain serves all bodies. Waves first propagate in an infinite flat body with the depth, base and
regions under the focus. The assumption of little loss is dropped there, because elements of a body
with little loss need several times as many moments as a reduction allows.
"""

from collections.abc import Collection, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from meshes import Palm
from simple_model import Material, MovingPressure, PronyTerm, Trajectory
from simple_model.layers.material import PRESETS
from simple_model.load.drive import PUBLISHED, usual_drive
from skinwave.bodies.flattened import flatten
from skinwave.bodies.sizes import default_size
from skinwave.models import point_kernel
from skinwave.models.flat_body import FLAT_BODY
from skinwave.models.limits import takes
from skinwave.models.linear_elements import finite_depth
from skinwave.models.plate_modes import STRETCHED
from skinwave.planning.estimates import response_spectrum
from skinwave.planning.plan import model_with_sides
from skinwave.scene.scene import BODIES, FLAT, Body, Layer, Scene, solid_of

ASSUMPTIONS = {
    "linear drive": "the force follows the square of the sound's amplitude",
    "sinc^2 profile": "the focal spot is a Gaussian of the same half width",
    "no propagation": "waves propagate in an infinite flat body under the same load",
    "little loss": "the material has its full damping",
    "viscous loss": "the material is a standard linear solid, whose damping equals the viscous one "
    "only at the strongest line",
    "laterally-infinite": "the body has its own shape, size and supports",
    "one material": "the body has layers",
    "alike in all directions": "stiffness and tension of the sheet differ by direction",
    "vacuum": "the air moves with the sheet and damps it",
    "baffle": "the air flows around the edges of the sheet",
    "main lobe only": "the focus has the side lobes of the array",
    "continuous path": "the focus jumps at the device's rate",
    "rigid base": "the body rests on springs",
    "flat": "the palm is curved, and one layer has the mean stiffness of all layers",
    "small deflection": "the sheet stretches as it bends",
}
DEVICE_RATES = (20_000.0, 40_000.0)  # Hz at which devices move their focus
LITTLE_LOSS = 0.1  # of the loss of material and edges: an undamped resonance has no bound
LAYERS = (
    Layer(thickness=0.3e-3, material="epidermis"),
    Layer(thickness=1.0e-3, material="dermis"),
    Layer(thickness=3.0e-3, material="fat"),
)


def droppable(scene: Scene) -> tuple[str, ...]:
    """Return the assumptions that can be dropped for a scene, in the order of the hierarchy.

    Raises a ValueError if the scene has no body.
    """
    body, path = scene.body, scene.tacton.trajectory
    if not body.of_kind.discretise:
        raise ValueError(
            "no assumption can be dropped without a body. Give the scene one under [body]"
        )
    sheet, slab = body.of_kind.is_plate, body.of_kind.is_layer
    is_flat = slab and body.placement == FLAT
    is_infinite = body.sides == "absorbing" and (sheet or is_flat)
    conditions = {
        "little loss": any(solid.has_loss for solid in body.solids),
        "viscous loss": any(solid.fast_modulus > 0 for solid in body.solids),
        "laterally-infinite": not (is_infinite or (is_flat and body.depth == np.inf)),
        "one material": bool(body.layers)
        or (slab and sum(x.thickness for x in LAYERS) < body.depth < np.inf),
        "alike in all directions": sheet and isotropic_sheet(body) != body,
        "vacuum": sheet and bool(body.air or body.mounting.is_frame),
        "baffle": sheet and body.air != "baffle" and body.mounting.is_frame,
        "continuous path": path.shape in ("line", "circle", "triangle", "square")
        and not path.is_static,
        "rigid base": body.base == "elastic",
        # A thin body has no room for the mounds of the palm.
        "flat": is_flat and Palm.thenar_height < body.depth < np.inf,
        "small deflection": sheet and takes(STRETCHED, scene),
    }
    return tuple(name for name in ASSUMPTIONS if conditions.get(name, True))


def side_step(scene: Scene) -> tuple[str, ...]:
    """Return the assumptions dropped in a side step with a second damping law, or ().

    With this law fast waves lose little energy, and finite elements take many times as long. Only
    the infinite flat body is therefore computed with it, unless it is the law of the scene.
    """
    names = droppable(scene)
    if "viscous loss" in names or not scene.body.is_solid or not scene.body.solid.viscosity:
        return ()
    return (*names[: names.index("little loss") + 1], "viscous loss")


def can_be_alone(name: str, names: Collection[str], scene: Scene, h: float | None = None) -> bool:
    """Whether an assumption can be the only one that is made.

    The profile cannot if side lobes are among the steps, because the array has its own profile.
    Little loss can in a sheet or a slab on bone; reductions of other bodies have too few moments.
    An infinite body of elements needs a constraint other than its sides.
    """
    body = scene.body
    on_bone = body.of_kind.is_layer and body.base == "clamped" and body.depth < np.inf
    if name == "sinc^2 profile":
        return "main lobe only" not in names
    if name == "little loss":
        return body.of_kind.is_plate or (on_bone and "flat" not in names)
    if name != "laterally-infinite":
        return True
    return body.is_solid and "flat" not in names and infinite(scene, body, h).is_held


def element_size(scene: Scene, h: float | None = None) -> float:
    """Return the element size in m of all steps with elements."""
    larger = 1.25  # element size over the default one, at a third of the time
    return h or larger * default_size(scene.body)


def infinite(scene: Scene, body: Body, h: float | None = None) -> Body:
    """Return the infinite flat body with the strata of another body under the scene's focus."""
    path = scene.tacton.trajectory
    places = np.vstack([path.position(np.zeros(1)), path.outline, scene.probe_points])
    return flatten(body, places, element_size(scene, h))


def without(
    scene: Scene,
    dropped: Collection[str],
    *,
    path: Trajectory | None = None,
    h: float | None = None,
) -> tuple[Scene, str]:
    """Return a scene without the dropped assumptions, and the name of a model for it.

    The model of an infinite body has no reflections from the sides, that of any other has them.
    `path` is that of the device, by default `device_path`; h in m is that of `element_size`.
    Assumptions on the load are the same with and without propagation.
    """
    spot = "gaussian" if "sinc^2 profile" in dropped else "main_lobe"
    own = usual_drive(scene.pressure.drive, MovingPressure.drive)
    profile = "array" if "main lobe only" in dropped else spot
    drive = own if "linear drive" in dropped else PUBLISHED
    pressure = replace(scene.pressure, profile=profile, drive=drive)
    if "continuous path" in dropped:
        path = path or device_path(scene.tacton.trajectory)
        pressure = replace(pressure, tacton=replace(scene.tacton, trajectory=path))
    if "no propagation" not in dropped:
        kernel = point_kernel.SAME_LOAD if dropped else point_kernel.PUBLISHED
        return replace(scene, pressure=pressure, body=BODIES["none"]), kernel.name
    changed = replace(scene, pressure=pressure, body=_body(scene, dropped, h))
    if "small deflection" in dropped:
        return changed, STRETCHED.name
    if "laterally-infinite" not in dropped and takes(FLAT_BODY, changed):
        return changed, FLAT_BODY.name
    return changed, model_with_sides(changed)[0].name


def device_path(
    path: Trajectory, update_rate: float = DEVICE_RATES[0], points: int | None = None
) -> Trajectory:
    """Return the path of a device that moves its focus at an update rate in Hz.

    The focus rests on equally spaced points, by default as many as the device can set, rate / f_d.
    Raises a ValueError if no device has this rate or can set this number of points.
    """
    check_rate(update_rate)
    period = 1 / path.drawing_frequency
    most = max(2, round(update_rate * period))
    count = most if points is None else points
    if not 2 <= count <= most:
        raise ValueError(
            f"points = {count} must be 2 to {most}: a device with {update_rate:g} Hz cannot set "
            f"more on a path that is drawn {path.drawing_frequency:g} times per second"
        )
    phases = np.arange(count) / count
    places = path.at_phase(phases).tolist()
    stops = tuple(map(tuple, [*places, places[0]]))
    times = tuple((period * np.append(phases, 1.0)).tolist())
    return Trajectory(shape="recorded", points=stops, times=times, hold=True)


def check_rate(update_rate: float) -> None:
    """Raise a ValueError if no device has an update rate in Hz."""
    if update_rate not in DEVICE_RATES:
        raise ValueError(
            f"update_rate = {update_rate / 1e3:g} kHz must be "
            f"{' or '.join(f'{rate / 1e3:g}' for rate in DEVICE_RATES)} kHz"
        )


def _body(scene: Scene, dropped: Collection[str], h: float | None) -> Body:
    body, w = scene.body, 2 * np.pi * strongest_line(scene, h)
    if body.depth == np.inf:  # elements need the part of a half-space around the focus
        depth = finite_depth(body.interfaces[-2])
        body = replace(body, depth=depth, base="absorbing", sides="absorbing")
    if body.of_kind.is_plate and "alike in all directions" not in dropped:
        body = isotropic_sheet(body)
    layers = body.layers or LAYERS * body.of_kind.is_layer
    body = replace(body, layers=layers if "one material" in dropped else ())
    if body.base == "elastic" and "rigid base" not in dropped:
        body = replace(body, base="clamped", base_stiffness=0.0)
    if "laterally-infinite" not in dropped:
        body = infinite(scene, body, h)
    law = as_relaxing if "viscous loss" in dropped else as_viscous

    def assumed(material: str | Material) -> str | Material:
        own = solid_of(material)
        solid = law(own, w)
        solid = solid if "little loss" in dropped else with_little_loss(solid, w)
        return material if solid == own else solid

    layers = tuple(replace(layer, material=assumed(layer.material)) for layer in body.layers)
    regions = tuple((name, assumed(material)) for name, material in body.regions)
    changes: dict[str, object] = {
        "material": assumed(body.material), "layers": layers, "regions": regions,
    }  # fmt: skip
    if body.of_kind.is_plate:
        open_air = "baffle" in dropped or not body.mounting.is_frame
        changes["air"] = "vacuum" in dropped and ("free" if open_air else "baffle")
        share = 1.0 if "little loss" in dropped else LITTLE_LOSS
        edge_loss = share * body.mounting.edge_loss
        changes["mounting"] = replace(body.mounting, edge_loss=edge_loss)
    if "flat" in dropped:
        width = min(body.width, BODIES["palm"].width)
        merged = (merged_layer(layers),) if layers else ()
        changes |= {"kind": "palm", "width": width, "layers": merged}
    return replace(body, **changes)  # type: ignore[arg-type]


def isotropic_sheet(body: Body) -> Body:
    """Return a sheet with stiffness and tension averaged over its directions."""
    tension = body.mounting.mean_tension
    mean = replace(body, mounting=replace(body.mounting, tension_x=tension, tension_y=tension))
    if body.solid.orthotropy is None:
        return mean
    return replace(mean, material=replace(body.solid, orthotropy=None))


def merged_layer(layers: Sequence[Layer]) -> Layer:
    """Return one layer with the total thickness and the mean stiffness of several layers."""
    thickness = sum(layer.thickness for layer in layers)
    shares = [layer.thickness / thickness for layer in layers]
    solids = [solid_of(layer.material).relaxing() for layer in layers]
    moduli: dict[float, float] = {}
    for share, solid in zip(shares, solids, strict=True):
        for term in solid.prony:
            time = float(f"{term.time:.9g}")  # merges times that differ by round-off
            moduli[time] = moduli.get(time, 0.0) + share * term.modulus
    prony = tuple(PronyTerm(modulus=modulus, time=time) for time, modulus in moduli.items())
    means: dict[str, Any] = {
        name: float(np.dot(shares, [getattr(solid, name) for solid in solids]))
        for name in ("density", "shear_modulus", "viscosity", "loss_factor")
    }
    return Layer(
        thickness=thickness, material=Material(poisson=solids[0].poisson, prony=prony, **means)
    )


def with_little_loss(solid: Material, w: float) -> Material:
    """Return a material with a tenth of the damping and the same storage modulus at w in rad/s."""
    less = solid.scaled(loss=LITTLE_LOSS)
    if solid.law is not None or solid.loss_factor:
        own, other = (float(m.complex_modulus(w).real) for m in (solid, less))
        return less.scaled(modulus=own / other)
    stiffer = (1 - LITTLE_LOSS) * float(solid.relaxing_modulus(w).real)
    return replace(less, shear_modulus=solid.shear_modulus + stiffer)


def as_relaxing(solid: Material, w: float) -> Material:
    """Return a standard linear solid with the modulus of a Kelvin-Voigt solid at w in rad/s.

    Its relaxation time is that of the preset, or shorter so that the long-term modulus is at least
    half of the static one.
    """
    loss = w * solid.viscosity
    if not loss or solid.fast_modulus:  # nothing to fit, or already relaxing
        return solid
    solid = solid.without_loss_factor()
    relaxation_time = PRESETS["palm-zener"].prony[0].time
    least_long_term = 0.5  # share of the static modulus that does not relax
    time = min(relaxation_time, (1 - least_long_term) * solid.shear_modulus / loss / w)
    turned = w * time
    term = PronyTerm(modulus=loss * (1 + turned**2) / turned, time=time)
    others = max(solid.viscosity - loss / w, 0.0)  # of the loss factor
    return replace(
        solid, shear_modulus=solid.shear_modulus - loss * turned, viscosity=others,
        prony=(term, *solid.prony),
    )  # fmt: skip


def as_viscous(solid: Material, w: float) -> Material:
    """Return the Kelvin-Voigt solid with the complex modulus of a relaxing solid at w in rad/s."""
    if not w or not solid.fast_modulus:
        return solid
    if solid.law is not None:
        modulus = complex(solid.complex_modulus(w))
        return replace(solid, law=None, shear_modulus=modulus.real, viscosity=modulus.imag / w)
    relaxing = complex(solid.relaxing_modulus(w))
    lasting = replace(solid, prony=()).without_loss_factor()
    return replace(
        lasting, shear_modulus=lasting.shear_modulus + relaxing.real,
        viscosity=lasting.viscosity + relaxing.imag / w,
    )  # fmt: skip


@lru_cache(maxsize=8)
def strongest_line(scene: Scene, h: float | None = None) -> float:
    """Return the line in Hz that moves the probes of the infinite flat body most, or 0.

    Damping laws agree there. h is that of `element_size`.
    """
    flat = replace(scene, body=infinite(scene, scene.body, h))
    frequencies, shares = response_spectrum(flat, 0.05)
    moving = frequencies > 0
    if not moving.any():
        return 0.0
    return float(frequencies[moving][np.argmax(shares[moving].max(axis=1))])
