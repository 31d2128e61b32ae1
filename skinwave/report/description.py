"""Description of the models and of what they leave out, in sentences true of the runs at hand."""

from collections.abc import Iterable, Sequence

import numpy as np

from simple_model import MovingPressure, Tacton
from simple_model.layers.material import Material
from skinwave.bodies.supports import FRAME
from skinwave.models import named
from skinwave.report.figures import answered
from skinwave.results.run import Run
from skinwave.scene.scene import Body, Scene

NAMED = 4  # lines that a sentence names
SPOTS = {
    "gaussian": "a Gaussian focus",
    "main_lobe": "a focus S = sinc²(D/D₀)",
    "array": "the array's whole field",
}
UNCERTAIN = (
    "The pressure at the focus is uncertain by a factor of 2, and all displacements with it."
)


def _spot(pressure: MovingPressure) -> str:
    return SPOTS.get(pressure.profile_name, "a focal spot of its own")


def modelled(runs: Sequence[Run]) -> list[str]:
    """A paragraph per body and model, and those true of all."""
    groups: dict[tuple[str, str], list[Run]] = {}
    for run in runs:
        groups.setdefault((run.body, run.model), []).append(run)
    on_bodies = [run for run in runs if run.is_motion]
    notes = dict.fromkeys(run.scene.pressure.law.note for run in on_bodies if run.is_am)
    by_device = any(run.scene.load.of_kind.is_of_device for run in on_bodies)
    said = [_modelled(group) for group in groups.values()]
    return [*said, *filter(None, notes), *[UNCERTAIN] * by_device]


def unresolved(runs: Iterable[Run]) -> list[str]:
    """Unresolved lines of Tactons that are too short, a sentence for each duration."""
    missing = {run.scene.tacton.duration: run.unresolved for run in runs if run.unresolved}
    return [
        f"{len(names)} line{'s' * (len(names) > 1)}, {', '.join(names[:NAMED])}"
        f"{', ...' * (len(names) > NAMED)}, cannot be resolved in {seconds:g} s and "
        f"{'are' if len(names) > 1 else 'is'} not reported; make the Tacton longer."
        for seconds, names in missing.items()
    ]


def _modelled(runs: list[Run]) -> str:
    """One body by one model."""
    scene, model, name = runs[0].scene, named(runs[0].model), answered(runs[0])
    acting, body = scene.load, scene.body
    drive = scene.pressure.law.name.replace("_", " ")
    load = f"drive law {drive}, {_spot(scene.pressure)}"
    if not acting.is_plain:
        load = f"{acting.words}; {load}" if acting.of_kind.is_of_device else acting.words
    text = f"{name[0].upper()}{name[1:]}: {model.words}; {load}."
    if not runs[0].is_motion:
        return text
    of, size = f"of {_material(body.solid)}{above(body)}", extent(body)
    depth_only = " of which the wavenumber integral takes only the depth," * model.is_infinite
    text += f" {size[0].upper()}{size[1:]},{depth_only} {of}."
    if body.of_kind.is_plate:
        return f"{text} {_sheet(runs)}"
    left_out = ["layers"] * (len(body.strata) == 1) + ["curvature"] * body.of_kind.is_layer
    return f"{text} Left out: {' and '.join(left_out)}." if left_out else text


def path_of(tacton: Tacton) -> str:
    """Paths of the foci."""
    path = tacton.trajectory
    if path.shape == "recorded":
        f_d, n = tacton.drawing_frequency, tacton.n_paths
        several = f"{n} paths, drawn {f_d:.3f} times a second"
        text = several if n > 1 else f"a path recorded for {1 / f_d:.4g} s"
        text += " with levels of its own" * bool(path.levels)
    elif path.is_static:
        text = "at rest"
    else:
        size = 1e3 * (path.size or path.length)
        text = f"{path.shape} of {size:g} mm{' a period' * (not path.size)} at {path.speed:g} m/s"
        text += f", {path.sweep.replace('_', ' ')}" * (path.sweep != "there_and_back")
        text += f", f_d = {path.drawing_frequency:.3f} Hz"
    if any(path.centre):
        text += " about ({:g}, {:g}) mm".format(*(1e3 * x for x in path.centre))
    if len(tacton.foci) > 1:
        text += f", {len(tacton.foci)} foci {tacton.sharing.replace('_', ' ')}"
    return text


def tones_of(tacton: Tacton) -> list[str]:
    """The sinusoids that modulate."""
    w1, w2 = tacton.superposition
    parts = [f"f_AM = {tacton.am_frequency:g} Hz"] if tacton.am_frequency * w1 else []
    parts += [f"f_AM2 = {tacton.second_am_frequency:g} Hz"] * bool(tacton.second_am_frequency * w2)
    if parts and w1 and w2:
        parts.append(f"weights {w1:g} and {w2:g}")
    parts += [f"f_e = {tacton.envelope_frequency:g} Hz"] * bool(tacton.envelope_frequency)
    return parts


def levels_of(tacton: Tacton) -> list[str]:
    """Amplitude, rhythm and sampled signal, where there are any."""
    parts = [f"{100 * tacton.amplitude:g} % of full drive"] * (tacton.amplitude != 1)
    if tacton.rhythm:
        rhythm, count = tacton.rhythm, len(tacton.rhythm.pulses)
        text = f"{count} pulse{'s' * (count > 1)} in {1e3 * rhythm.period:g} ms"
        parts.append(text + f" with ramps of {1e3 * rhythm.ramp:g} ms" * (rhythm.ramp > 0))
    if tacton.signal:
        parts.append(f"a sampled {tacton.signal.role}")
    return parts


def extent(body: Body) -> str:
    """Kind, size and boundary conditions of a body."""
    size = body.of_kind.words(body)
    if body.mounting != FRAME:
        return f"{size}, {body.mounting.words}"
    return f"{size}, base {body.base}, sides {body.sides}" if body.of_kind.discretise else size


def above(body: Body) -> str:
    """The layers of a body, and how it lies under the device."""
    layers = [
        f"{1e3 * layer.thickness:g} mm of {_material(layer.material)}" for layer in body.layers
    ]
    text = f"; on it, from the surface down: {', '.join(layers)}" if layers else ""
    for name, material in body.regions:
        text += f"; its region {name} of {_material(material)}"
    place = body.placement
    if place.is_tilted:
        x, y = np.degrees([place.tilt_x, place.tilt_y])
        text += f"; tilted by {x:g}° about x and {y:g}° about y"
    if any(place.offset) or place.lift:
        moved = ", ".join(f"{1e3 * x:g}" for x in (*place.offset, place.lift))
        text += f"; moved by ({moved}) mm"
    return text


def _material(solid: Material | str) -> str:
    if isinstance(solid, str):
        return solid
    text = f"density {solid.density:g} kg/m³, "
    if (along := solid.orthotropy) is None:
        text += f"shear modulus {solid.shear_modulus / 1e3:.4g} kPa, "
        text += f"Poisson's ratio {solid.poisson:g}, "
    else:
        text += (
            f"Young's moduli {along.young_x / 1e9:.3g} and {along.young_y / 1e9:.3g} GPa along x "
            f"and y, shear modulus {along.plane_stress[2, 2] / 1e9:.3g} GPa, Poisson's ratio "
            f"{along.poisson_xy:g}, "
        )
    if solid.law is not None:
        return text + getattr(solid.law, "words", "a complex modulus of its own")
    text += f"viscosity {solid.viscosity:g} Pa s"
    if solid.loss_factor:
        text += f", loss factor {solid.loss_factor:g}"
    for term in solid.prony:
        text += (
            f", a Maxwell branch of {term.modulus / 1e3:.4g} kPa with relaxation time "
            f"{1e3 * term.time:g} ms"
        )
    return text


def _sheet(runs: list[Run]) -> str:
    text, model = "", named(runs[0].model)
    if model.default_size:
        text += "The mesh is a thicker sheet of the same bending stiffness and mass per area. "
    text += (
        "Air moves along on both sides. Left out: its flow around the edge, and sound radiation"
        if runs[0].scene.body.air
        else "Left out: the air that moves along, a fifth to a third of the mass of office paper"
    )
    if not model.is_nonlinear and all(run.is_motion for run in runs):
        depth = runs[0].scene.body.depth
        sag = max(float(run.response.displacement.mean(axis=0).max()) for run in runs) / depth
        text += (
            f"; and stretching: under its mean load this sheet sags by up to {sag:.1f} times its "
            "thickness, and beyond about half a thickness a real one stiffens and its lowest "
            "modes lie higher"
        )
    return f"{text}. Neither size nor support of the sheet that was measured is published."


def asked_rows(scene: Scene) -> list[list[str]]:
    """What a scene asks for, in rows of a table."""
    tacton, pressure, body = scene.tacton, scene.pressure, scene.body
    depth = pressure.depth_of_modulation
    of_depth = f", depth of modulation {depth:g}" if pressure.law.uses_depth else ""
    drive = f"{pressure.drive}{of_depth}, {_spot(pressure)}, {pressure.peak_pressure:g} Pa at "
    drive += f"full drive, {1e3 * pressure.height:g} mm above the array"
    return [
        ["focus", path_of(tacton)],
        ["amplitude modulation", ", ".join(tones_of(tacton)) or "none"],
        ["amplitude", ", ".join(levels_of(tacton)) or "100 % of full drive"],
        ["load", drive if scene.load.is_plain else scene.load.words],
        ["body", extent(body) + above(body)],
        ["duration", f"{tacton.duration:g} s"],
        ["probes", ", ".join(f"({1e3 * x:g}, {1e3 * y:g})" for x, y in scene.probes) + " mm"],
        ["they read", scene.reading.words],
    ]


def without_kernel(scene: Scene) -> str:
    """That the point kernel has no such quantity."""
    return f"the point kernel has no {scene.reading.words}, and predicts a pressure alone"


def other_quantity(scene: Scene) -> list[str]:
    """Sentences for a page of a scene whose probes read something else than the displacement of
    the surface.
    """
    if scene.reading.is_plain:
        return []
    return [
        f"Probes read {scene.reading.words}, in {scene.reading.record.shown}; "
        f"{without_kernel(scene)}: its columns are in Pa, and that of the quantity in lines.csv is "
        "empty. Pictures of the surface but for maps of the quantity show its motion; claims and "
        "sensation levels, which are of displacement, are left out of bodies."
    ]
