"""Assumptions of the published model, and a scene with some of them dropped.

The paper's model (Lim, Seifi and Park, CHI EA '24, section 2) is a round focal spot without side
lobes, whose pressure follows the command and stimulates only where it acts, on a flat skin in which
nothing propagates. Each name in `ASSUMPTIONS` turns one of these off.
"""

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from meshes import Palm
from simple_model import Material, MovingPressure, PronyTerm, Trajectory
from simple_model.layers.material import PRESETS
from simple_model.load.drive import PUBLISHED, usual_drive
from skinwave.models.limits import takes
from skinwave.models.plate_modes import FROM_REST, STRETCHED
from skinwave.planning.estimates import response_spectrum
from skinwave.scene.scene import BODIES, FLAT, Body, Layer, Scene, solid_of

ASSUMPTIONS = {
    "linear drive": "the force follows the square of the sound's amplitude",
    "sinc^2 profile": "the focal spot is a Gaussian of the same half width",
    "no propagation": "waves run through an infinite flat body under the same load",
    "little loss": "the material has its full damping",
    "viscous loss": "the damping is that of a standard linear solid, equal to the viscous one only "
    "at the strongest line",
    "laterally-infinite": "the body has its own size and side conditions, and is meshed with "
    "finite elements",
    "alike in all directions": "the sheet has the stiffness and tension of each direction",
    "vacuum": "the air moves with the sheet",
    "main lobe only": "the focus has the side lobes of the array",
    "continuous path": "the focus jumps at the device's rate",
    "one material": "skin is layered",
    "flat": "the palm is curved, and its layers are merged into one of their mean stiffness",
    "small deflection": "the sheet stretches as it bends",
}
ELEMENTS = {
    "laterally-infinite", "alike in all directions", "continuous path", "one material", "flat",
    "small deflection",
}  # fmt: skip
DEVICE_RATES = (20_000.0, 40_000.0)  # Hz at which devices move their focus
LOSS_LEFT = 0.1  # of the material's own: an undamped resonance is unbounded
RELAXATION_TIME = PRESETS["palm-zener"].prony[0].time
LEAST_LASTING = 0.5  # long-term share of a modulus, at the least, where part of it is made to relax
LAYERS = (
    Layer(thickness=0.3e-3, material="epidermis"),
    Layer(thickness=1.0e-3, material="dermis"),
    Layer(thickness=3.0e-3, material="fat"),
)


def droppable(scene: Scene) -> tuple[str, ...]:
    """Assumptions that can be dropped for a scene, in the order of the model hierarchy; a
    ValueError without a body.
    """
    body, path = scene.body, scene.tacton.trajectory
    if not body.of_kind.discretise:
        raise ValueError("a scene without a body keeps every assumption; give it one")
    sheet, slab, solid = body.of_kind.is_plate, body.of_kind.is_layer, body.solid
    kept = {
        "little loss": slab and solid.has_loss,
        "viscous loss": slab and solid.fast_modulus > 0,
        "alike in all directions": sheet and as_alike(body) != body,
        "vacuum": sheet and body.mounting.is_frame,
        "continuous path": path.shape in ("line", "circle", "triangle", "square")
        and not path.is_static,
        "one material": slab
        and (bool(body.layers) or sum(x.thickness for x in LAYERS) < body.depth),
        # The palm that stands for a hand has mounds, which a thin body has no room for.
        "flat": slab and body.placement == FLAT and Palm.thenar_height < body.depth < np.inf,
        "small deflection": sheet and takes(STRETCHED, scene),
    }
    return tuple(name for name in ASSUMPTIONS if kept.get(name, True))


def side_step(scene: Scene) -> tuple[str, ...]:
    """Assumptions dropped in a side step of the hierarchy, with a second damping law; () without
    viscosity. Finite elements take many times as long with it, because fast waves lose little:
    where the scene does not have that law, it is tried on the wavenumber integral only.
    """
    names = droppable(scene)
    if "viscous loss" in names or not scene.body.of_kind.is_layer or not scene.body.solid.viscosity:
        return ()
    return (*names[: names.index("little loss") + 1], "viscous loss")


def can_be_alone(name: str, names: Collection[str], scene: Scene) -> bool:
    """Whether all assumptions but one can be dropped: the array's field has no profile of its own,
    and an infinite body of elements is one with absorbing sides, if it has none anyway and is
    constrained elsewhere.
    """
    if name == "sinc^2 profile":
        return "main lobe only" not in names
    if name != "laterally-infinite":
        return True
    body = scene.body
    if not body.of_kind.is_layer or "flat" in names:
        return False
    infinite = replace(body, sides="absorbing")
    return infinite != body and infinite.is_held


def relaxed(
    scene: Scene,
    dropped: Collection[str],
    *,
    update_rate: float = DEVICE_RATES[0],
    points: int | None = None,
) -> tuple[Scene, str]:
    """Scene without the dropped assumptions, and the model that computes it; update rate and points
    are of the device, as `held` takes them. What is assumed of the load is the same with and
    without propagation.
    """
    spot = "gaussian" if "sinc^2 profile" in dropped else "main_lobe"
    own = usual_drive(scene.pressure.drive, MovingPressure.drive)
    profile = "array" if "main lobe only" in dropped else spot
    drive = own if "linear drive" in dropped else PUBLISHED
    pressure = replace(scene.pressure, profile=profile, drive=drive)
    if "continuous path" in dropped:
        path = held(scene.tacton.trajectory, update_rate, points)
        pressure = replace(pressure, tacton=replace(scene.tacton, trajectory=path))
    if "no propagation" not in dropped:
        kernel = "point-kernel" if dropped else "point-kernel-published"
        return replace(scene, pressure=pressure, body=BODIES["none"]), kernel
    body = _body(scene, dropped)
    # Wavenumber integrals are those of a Gaussian in a homogeneous, flat and infinite body.
    elements = pressure.profile != "gaussian" or not ELEMENTS.isdisjoint(dropped)
    model = "fem" if elements else "flat-body"
    if elements and body.of_kind.is_layer and "laterally-infinite" not in dropped:
        body = replace(body, sides="absorbing")
    changed = replace(scene, pressure=pressure, body=body)
    if "small deflection" in dropped:
        model = STRETCHED.name
    elif elements and takes(FROM_REST, changed):
        model = FROM_REST.name
    return changed, model


def held(
    path: Trajectory, update_rate: float = DEVICE_RATES[0], points: int | None = None
) -> Trajectory:
    """Path as a device draws it that moves its focus at an update rate in Hz, one of
    `DEVICE_RATES`: points equally spaced along it, the focus at rest on each, as many as the device
    can set, rate / f_d, if not given. A ValueError if no device has the rate or so many points.
    """
    check_rate(update_rate)
    period = 1 / path.drawing_frequency
    most = max(2, round(update_rate * period))
    count = most if points is None else points
    if not 2 <= count <= most:
        raise ValueError(
            f"points = {count} on the path must be 2 to {most}, which is what {update_rate:g} Hz "
            f"can set {path.drawing_frequency:g} times a second; give as many"
        )
    phases = np.arange(count) / count
    places = path.at_phase(phases)
    closed = np.vstack([places, places[:1]])
    points_held = tuple(map(tuple, closed.tolist()))
    times = tuple((period * np.append(phases, 1.0)).tolist())
    return Trajectory(shape="recorded", points=points_held, times=times, hold=True)


def check_rate(update_rate: float) -> None:
    """Refuse a rate in Hz that no device has."""
    if update_rate not in DEVICE_RATES:
        raise ValueError(
            f"update_rate = {update_rate / 1e3:g} kHz is no device's; take "
            f"{' or '.join(f'{rate / 1e3:g}' for rate in DEVICE_RATES)}"
        )


def _body(scene: Scene, dropped: Collection[str]) -> Body:
    body = scene.body
    if body.of_kind.is_plate and "alike in all directions" not in dropped:
        body = as_alike(body)
    solid, line = body.solid, strongest_line(scene)
    law = as_relaxing if "viscous loss" in dropped else as_viscous

    def made(solid: Material) -> Material:
        """A tissue as the assumptions have it."""
        solid = law(solid, 2 * np.pi * line)
        return solid if "little loss" in dropped else with_little_loss(solid, 2 * np.pi * line)

    if body.of_kind.is_layer:
        solid = made(solid)
    changes: dict[str, object] = {
        "material": solid if solid != body.solid else body.material,
        "air": "vacuum" in dropped,
    }
    if "one material" in dropped:
        layers = tuple(
            replace(layer, material=made(solid_of(layer.material)))
            for layer in body.layers or LAYERS
        )
        changes["layers"] = (as_one(layers),) if "flat" in dropped else layers
    elif body.of_kind.is_layer:
        changes["layers"] = ()
    if "flat" in dropped:
        width = min(body.width, BODIES["palm"].width)
        changes |= {"kind": "palm", "width": width}
    return replace(body, **changes)  # type: ignore[arg-type]


def as_alike(body: Body) -> Body:
    """A flat sheet of the mean stiffness and tension of its directions."""
    held, tension = body.mounting, body.mounting.mean_tension
    mean = replace(held, tension_x=tension, tension_y=tension, curl_x=0.0, curl_y=0.0)
    found = replace(body, mounting=mean)
    if body.solid.orthotropy is not None:
        found = replace(found, material=replace(body.solid, orthotropy=None))
    return found


def as_one(layers: Sequence[Layer]) -> Layer:
    """One layer as thick as all and of their mean stiffness, for a mesh without interfaces."""
    thickness = sum(layer.thickness for layer in layers)
    solids = [solid_of(layer.material).relaxing() for layer in layers]

    def mean(name: str) -> float:
        parts = zip(layers, solids, strict=True)
        return sum(layer.thickness * getattr(solid, name) for layer, solid in parts) / thickness

    names = ("density", "shear_modulus", "viscosity", "loss_factor")
    moduli: dict[float, float] = {}
    for layer, solid in zip(layers, solids, strict=True):
        for term in solid.prony:
            time = float(f"{term.time:.9g}")  # times that differ by round-off are one
            moduli[time] = moduli.get(time, 0.0) + layer.thickness / thickness * term.modulus
    prony = tuple(PronyTerm(modulus=modulus, time=time) for time, modulus in moduli.items())
    means: dict[str, Any] = {name: mean(name) for name in names}
    return Layer(
        thickness=thickness, material=Material(poisson=solids[0].poisson, prony=prony, **means)
    )


def with_little_loss(solid: Material, w: float) -> Material:
    """A tenth of the damping, and the same storage modulus at w in rad/s."""
    if solid.law is not None or solid.loss_factor:
        less = solid.scaled(loss=LOSS_LEFT)
        storage = [float(m.complex_modulus(w).real) for m in (solid, less)]
        return less.scaled(modulus=storage[0] / storage[1])
    stiffer = (1 - LOSS_LEFT) * float(solid.relaxing_modulus(w).real)
    less = solid.scaled(loss=LOSS_LEFT)
    return replace(less, shear_modulus=solid.shear_modulus + stiffer)


def as_relaxing(solid: Material, w: float) -> Material:
    """Standard linear solid with the complex modulus at w in rad/s of a Kelvin-Voigt solid. Its
    relaxation time is that of the preset, or shorter where the long-term modulus would otherwise
    fall below half of the static one.
    """
    loss = w * solid.viscosity
    if not loss or solid.fast_modulus:  # nothing to fit, or fitted already
        return solid
    solid = solid.without_loss_factor()
    time = min(RELAXATION_TIME, (1 - LEAST_LASTING) * solid.shear_modulus / loss / w)
    turned = w * time
    term = PronyTerm(modulus=loss * (1 + turned**2) / turned, time=time)
    others = max(solid.viscosity - loss / w, 0.0)  # of the loss factor
    return replace(
        solid, shear_modulus=solid.shear_modulus - loss * turned, viscosity=others,
        prony=(term, *solid.prony),
    )  # fmt: skip


def as_viscous(solid: Material, w: float) -> Material:
    """Kelvin-Voigt solid with the complex modulus at w in rad/s of a generalised Maxwell solid."""
    if not w or not solid.fast_modulus:
        return solid
    relaxing = complex(solid.relaxing_modulus(w))
    lasting = replace(solid, prony=()).without_loss_factor()
    return replace(
        lasting, shear_modulus=lasting.shear_modulus + relaxing.real,
        viscosity=lasting.viscosity + relaxing.imag / w,
    )  # fmt: skip


def strongest_line(scene: Scene) -> float:
    """Line in Hz that moves the probes most, at which damping laws are matched; 0 if none does."""
    frequencies, shares = response_spectrum(scene, 0.05)
    moving = frequencies > 0
    if not moving.any():
        return 0.0
    return float(frequencies[moving][np.argmax(shares[moving].max(axis=1))])
