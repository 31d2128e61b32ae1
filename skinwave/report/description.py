"""Sentences about a scene, the models that were run, and what these leave out."""

from collections.abc import Iterable, Sequence

import numpy as np

from simple_model import MovingPressure, Tacton
from simple_model.layers.material import Material
from simple_model.numbers import first_few, plural
from skinwave.bodies.supports import FRAME
from skinwave.models import named
from skinwave.report.figures import run_label
from skinwave.results.run import Run
from skinwave.scene.focus_file import focus_note
from skinwave.scene.scene import Body, Scene


def _spot(pressure: MovingPressure) -> str:
    spots = {
        "gaussian": "Gaussian focus", "main_lobe": "focus S = sinc²(D/D₀)",
        "array": "whole field of the array",
    }  # fmt: skip
    return focus_note(pressure) or spots.get(pressure.profile_name, "custom focal spot")


def model_paragraphs(runs: Sequence[Run]) -> list[str]:
    """Return a paragraph for each body and model, and notes that apply to all."""
    groups: dict[tuple[str, str], list[Run]] = {}
    for run in runs:
        groups.setdefault((run.body, run.model), []).append(run)
    on_bodies = [run for run in runs if run.is_motion]
    notes = dict.fromkeys(run.scene.pressure.law.note for run in on_bodies if run.is_am)
    by_device = any(run.scene.load.of_kind.is_of_device for run in on_bodies)
    uncertain = (
        "The pressure at the focus, and so every displacement, is known only to within a factor of "
        "2."
    )
    return [*map(_model_text, groups.values()), *filter(None, notes), *[uncertain] * by_device]


def unresolved_lines(runs: Iterable[Run], most: int = 4) -> list[str]:
    """Return a sentence for each duration of a Tacton that names `most` unresolved lines."""
    unresolved = {run.scene.tacton.duration: run.unresolved for run in runs if run.unresolved}
    return [
        f"A Tacton of {seconds:g} s is too short to resolve {plural(len(names), 'line')}: "
        f"{first_few(names, most)}. Use a longer Tacton."
        for seconds, names in unresolved.items()
    ]


def _model_text(runs: list[Run]) -> str:
    """Describe the model of one body, its load, the body, and what the model leaves out."""
    scene, model, name = runs[0].scene, named(runs[0].model), run_label(runs[0])
    acting, body = scene.load, scene.body
    drive = scene.pressure.law.name.replace("_", " ")
    load = f"drive law {drive}, {_spot(scene.pressure)}"
    if not acting.is_plain:
        load = f"{acting.words}; {load}" if acting.of_kind.is_of_device else acting.words
    text = f"{name[0].upper()}{name[1:]}: {model.words}; {load}."
    if not runs[0].is_motion:
        return text
    material, size = f"{material_text(body.solid)}{layers_text(body)}", size_text(body)
    infinite = " (taken as laterally infinite)" * model.is_infinite
    text += f" The body is a {size}{infinite}; {material}."
    if body.of_kind.is_plate:
        return f"{text} {_sheet_text(runs)}"
    left_out = ["layers"] * (len(body.strata) == 1) + ["curvature"] * body.of_kind.is_layer
    return f"{text} Left out: {' and '.join(left_out)}." if left_out else text


def _sheet_text(runs: list[Run]) -> str:
    """Describe mesh, air and linearity of a sheet."""
    body, model = runs[0].scene.body, named(runs[0].model)
    sentences = []
    if model.default_size:
        sentences.append(
            "The mesh is a thicker sheet of the same bending stiffness and mass per area."
        )
    moving = "Air on both sides moves with the sheet, and takes energy by friction and sound; "
    by_air = {
        "free": f"{moving}it flows around the edges.",
        "baffle": f"{moving}a wall around the sheet separates both sides.",
        False: "Left out: the air that moves with the sheet, which has a fifth to a third of the "
        "mass of office paper.",
    }
    sentences.append(by_air[body.air])
    if not model.is_nonlinear and all(run.is_motion for run in runs):
        sag = max(float(run.response.displacement.mean(axis=0).max()) for run in runs) / body.depth
        sentences.append(
            f"Stretching is left out: under its mean load this sheet deflects by up to {sag:.1f} "
            "times its thickness. Above half a thickness, a real sheet stiffens and its lowest "
            "modes lie higher."
        )
    return " ".join([*sentences, "Size and support of the measured sheet are not published."])


def path_text(tacton: Tacton) -> str:
    """Describe the paths of the foci."""
    path = tacton.trajectory
    if path.shape == "recorded":
        f_d, n = tacton.drawing_frequency, tacton.n_paths
        several = f"{n} paths, drawn {f_d:.3f} times per second"
        text = several if n > 1 else f"a path recorded for {1 / f_d:.4g} s"
        text += " with its own levels" * bool(path.levels)
    elif path.is_static:
        text = "at rest"
    else:
        size = 1e3 * (path.size or path.length)
        text = f"{path.shape} of {size:g} mm{' per period' * (not path.size)} at {path.speed:g} m/s"
        text += f", {path.sweep.replace('_', ' ')}" * (path.sweep != "there_and_back")
        text += f", f_d = {path.drawing_frequency:.1f} Hz"
    if any(path.centre):
        text += " about ({:g}, {:g}) mm".format(*(1e3 * x for x in path.centre))
    if len(tacton.foci) > 1:
        text += f", {len(tacton.foci)} foci {tacton.sharing.replace('_', ' ')}"
    return text


def tone_texts(tacton: Tacton) -> list[str]:
    """Describe the sinusoids that modulate the amplitude."""
    w1, w2 = tacton.superposition
    parts = [f"f_AM = {tacton.am_frequency:g} Hz"] if tacton.am_frequency * w1 else []
    parts += [f"f_AM2 = {tacton.second_am_frequency:g} Hz"] * bool(tacton.second_am_frequency * w2)
    if parts and w1 and w2:
        parts.append(f"weights {w1:g} and {w2:g}")
    parts += [f"f_e = {tacton.envelope_frequency:g} Hz"] * bool(tacton.envelope_frequency)
    return parts


def level_texts(tacton: Tacton) -> list[str]:
    """Describe amplitude, rhythm and sampled signal, if present."""
    parts = [f"{100 * tacton.amplitude:g} % of full drive"] * (tacton.amplitude != 1)
    if tacton.rhythm:
        rhythm = tacton.rhythm
        text = f"{plural(len(rhythm.pulses), 'pulse')} in {1e3 * rhythm.period:g} ms"
        parts.append(text + f" with ramps of {1e3 * rhythm.ramp:g} ms" * (rhythm.ramp > 0))
    if tacton.signal:
        parts.append(f"a sampled {tacton.signal.role}")
    return parts


def size_text(body: Body) -> str:
    """Describe kind, size and boundary conditions of a body."""
    size = body.of_kind.words(body)
    if body.mounting != FRAME:
        return f"{size}, {body.mounting.words}"
    return f"{size}, base {body.base}, sides {body.sides}" if body.of_kind.discretise else size


def layers_text(body: Body) -> str:
    """Describe the layers of a body, and its placement under the device."""
    layers = [
        f"{1e3 * layer.thickness:g} mm of {material_text(layer.material)}" for layer in body.layers
    ]
    text = f"; layers from the surface down: {', '.join(layers)}" if layers else ""
    for name, material in body.regions:
        text += f"; region {name} of {material_text(material)}"
    place = body.placement
    if place.is_tilted:
        x, y = np.degrees([place.tilt_x, place.tilt_y])
        text += f"; tilted by {x:g}° about x and {y:g}° about y"
    if any(place.offset) or place.lift:
        offset = ", ".join(f"{1e3 * x:g}" for x in (*place.offset, place.lift))
        text += f"; moved by ({offset}) mm"
    return text


def material_text(solid: Material | str) -> str:
    """Describe a material by its constants or its name."""
    if isinstance(solid, str):
        return solid
    parts = [f"density {solid.density:g} kg/m³"]
    if (along := solid.orthotropy) is None:
        parts += [f"shear modulus {solid.shear_modulus / 1e3:.4g} kPa"]
        parts += [f"Poisson's ratio {solid.poisson:g}"]
    else:
        young = f"{along.young_x / 1e9:.3g} and {along.young_y / 1e9:.3g} GPa along x and y"
        shear = f"shear modulus {along.plane_stress[2, 2] / 1e9:.3g} GPa"
        parts += [f"Young's moduli {young}", shear, f"Poisson's ratio {along.poisson_xy:g}"]
    if solid.law is not None:
        return ", ".join([*parts, getattr(solid.law, "words", "custom complex modulus")])
    is_lossy = bool(solid.loss_factor)
    parts += [f"viscosity {solid.viscosity:g} Pa s"] * bool(solid.viscosity or not is_lossy)
    parts += [f"loss factor {solid.loss_factor:g}"] * is_lossy
    for term in solid.prony:
        branch = f"Maxwell branch of {term.modulus / 1e3:.4g} kPa"
        parts.append(f"{branch} with relaxation time {1e3 * term.time:g} ms")
    return ", ".join(parts)


def scene_rows(scene: Scene) -> list[list[str]]:
    """Return the contents of a scene as rows of a table."""
    tacton, pressure, body = scene.tacton, scene.pressure, scene.body
    depth = pressure.depth_of_modulation
    modulation = f", depth of modulation {depth:g}" if pressure.law.uses_depth else ""
    drive = f"{pressure.law.name.replace('_', ' ')}{modulation}, {_spot(pressure)}, "
    drive += f"{pressure.peak_pressure:g} Pa at full drive, {1e3 * pressure.height:g} mm above the "
    drive += "array"
    return [
        ["focus", path_text(tacton)],
        ["amplitude modulation", ", ".join(tone_texts(tacton)) or "none"],
        ["amplitude", ", ".join(level_texts(tacton)) or "100 % of full drive"],
        ["load", drive if scene.load.is_plain else scene.load.words],
        ["body", size_text(body) + layers_text(body)],
        ["duration", f"{tacton.duration:g} s"],
        ["probes", ", ".join(f"({1e3 * x:g}, {1e3 * y:g})" for x, y in scene.probes) + " mm"],
        ["quantity at the probes", scene.reading.words],
    ]


def no_kernel_text(scene: Scene) -> str:
    """Say that the point kernel does not compute the probes' quantity."""
    return f"the point kernel computes only a pressure, not {scene.reading.words}"


def quantity_notes(scene: Scene) -> list[str]:
    """Return notes for a page of a scene whose probes do not read the surface displacement."""
    if scene.reading.is_plain:
        return []
    return [
        f"Probes read {scene.reading.words}, in {scene.reading.record.shown}, but "
        f"{no_kernel_text(scene)}. The columns of the kernel are in Pa, and lines.csv has none of "
        "its values in that quantity. Pictures show the motion of the surface, except for maps of "
        "the quantity. Bodies have no claims and sensation levels, which need displacement."
    ]
