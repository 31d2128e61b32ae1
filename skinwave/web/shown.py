"""Keys of a page's state that its plots, maps and tables show, from the responses of models."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from simple_model import MovingPressure, Tacton, named_lines, published
from simple_model.line_names import line_names
from simple_model.numbers import stated_error
from simple_model.quantities import DISPLACEMENT
from skinwave.pictures.styles import LABELS
from skinwave.propagation import share_outside
from skinwave.scene import Body, Scene
from skinwave.web import drawings, guided, insets, measured, model, moving, plots
from skinwave.web.controls import CHOICES, KEYS, NAMES, OWN_BODY, Values, said
from skinwave.web.level_view import LEVELS, level_plot
from skinwave.web.levels import above_threshold, has_threshold
from skinwave.web.model import Answer
from skinwave.web.plots import Curves

NAMED = 3  # lines that a sentence names
PRESENT = 1e-2  # of the strongest line of a load: one that is named
PHASES = 100  # of a drawing period, at which foci can be seen
HIGHEST = (300, 600, 1000)  # Hz of the spectrum
THIRD = ("spectrum", "dispersion", *LEVELS)  # what the third plot shows


def body_named(name: str) -> str:
    """Name of a body in sentences and legends."""
    return LABELS.get(name, name.replace("-", " "))


def bodies(own: Body | None) -> list[str]:
    """The bodies that can be chosen; `own` is one from a file."""
    return [name for name in CHOICES["body"] if name != OWN_BODY or own]


def first(own: Body | None) -> dict[str, Any]:
    """The state apart from the controls before there is a response."""
    return {
        "errors": {}, "typed": {}, "problem": "", "stale": False, "waves_stale": False,
        "busy": "", "done": 0, "left": "",
        "hold": False, "held_frequency": 0.0, "drawing_frequency": 0.0,
        "phase": 0, "pulse": 0, "rhythm_span": 0,
        "span": next(iter(plots.SPANS)), "highest": HIGHEST[1], "third": THIRD[0],
        "dark": False, "solid": True, "decibel": False, "against": False, "helped": "",
        "measured_file": None, "measured_said": "", "pinned_path": "", "hue": 0,
        "summary": [], "uncertainty": [], "warnings": [], "expected": "", "published": False,
        "pinned": False, "pinned_query": "", "differs": [],
        "query": "", "undoable": False, "redoable": False,
        "about": False, "draft": {}, "drawer": None, "opened": None, "bodies": bodies(own),
        "body_layers": [],
        "path": "", "influenced": "", "own_speeds": "", "foci_track": [], "rows": [],
        "unresolved": "", "lines_unit": "µm",
        "kernel_map": _map(None), "wave_map": _map(None), "pinned_map": _map(None),
        "insets": {}, "levels_of": "", "layers_open": False,
        "body_shape": {}, "body_motion": {},
    }  # fmt: skip


def plotted(state: Any, scene: Scene, curves: Curves) -> None:
    """Plots of responses."""
    span = plots.span_of(state.span, scene.tacton.duration)
    state.update({
        "waveform_plot": plots.waveform_plot(curves, span),
        "spectrum_plot": third_plot(state, scene, curves),
        "levels_of": curves.levels.of if curves.levels else "",
    })  # fmt: skip


def answers(state: Any, scene: Scene, curves: Curves) -> None:
    """Maps, table and sentences of responses."""
    kernel, waves, stale, tacton = curves.kernel, curves.waves, curves.stale, scene.tacton
    bands, pinned = curves.bands, curves.pinned_waves
    state.update({
        "foci_track": foci_track(tacton),
        "lines_unit": scene.reading.asked.shown,
        "path": drawings.drawn(model.drawn_paths(tacton)),
        "influenced": drawings.drawn(model.influenced(tacton, scene.pressure.height)),
        "kernel_map": _map(kernel, "Kernel, same load"),
        "wave_map": _of_waves(curves, bool(state.against)),
        "pinned_map": _map(pinned, f"A: {curves.pinned_body}"),
        "insets": insets.beside(scene),
        "own_speeds": drawings.speeds(tacton) if tacton.trajectory.shape == "recorded" else "",
        "rows": drawings.rows(kernel, None if stale else waves, bands.levels if bands else {},
                              pinned),
        "uncertainty": list(bands.sentences) if bands else [],
        "measured_said": _measured(curves),
        "unresolved": unresolved(
            len(model.unresolved_lines(scene, kernel.response)), tacton.duration
        ),
    })  # fmt: skip
    told = [kernel] if waves is None or stale else [kernel, waves]
    state.summary = [*summary(scene, told), *beside_pinned(curves)]
    state.update({"warnings": warnings(told), "expected": expected(told[-1])})
    seen = waves.moving if waves else None
    if seen is not None and not stale:
        state.update({
            "body_shape": moving.sent_shape(seen),
            "body_motion": moving.sent_motion(seen, scene.pressure),
        })  # fmt: skip
    elif seen is None and state.body_motion:
        state.update({"body_shape": {}, "body_motion": {}})


def third_plot(state: Any, scene: Scene, curves: Curves) -> plots.PlotlyFigure:
    """The spectrum, or the dispersion curves of the body if it has any and they are chosen."""
    if state.third == THIRD[1] and guided.has_curves(scene.body):
        try:
            return guided.dispersion_plot(scene, state.highest)
        except ValueError as error:  # a body that is too deep, say
            state.problem = str(error)
    if state.third in LEVELS and curves.levels is not None:
        return level_plot(curves.levels, None if curves.stale else curves.waves)
    found = plots.spectrum_plot(curves, state.highest, with_threshold=has_threshold(scene))
    return plots.in_decibel(found) if state.decibel else found


def summary(scene: Scene, answers: Sequence[Answer]) -> list[str]:
    """Sentences on what is above threshold, on the effect of propagation, if a body's
    response follows the kernel's, and on that of drive law and focus.
    """
    here = [sentence] if (sentence := above_threshold(scene, answers)) else []
    new = added_names(scene.pressure)[:NAMED]
    said = f"adds {', '.join(new)}, which the published load lacks" if new else "adds no component"
    load = f"{scene.pressure.drive}, {scene.pressure.profile_name}"
    drive = f"The load (drive law and focus: {load}), not propagation, {said}."
    kernel, waves = answers[0], answers[-1]
    if waves is kernel or not np.nansum(waves.map.rms):
        return [*here, drive]
    share = 100 * share_outside(*(model.on_grid(each.map.rms, scene) for each in (kernel, waves)))
    return [
        *here,
        f"Waves carry {share:.0f} % of the mean-square motion to where the point "
        "kernel, under the same load, predicts less than a tenth of its largest.",
        drive,
    ]


def beside_pinned(curves: Curves) -> list[str]:
    """Sentence on the strongest lines of what is pinned, A, and of what is shown, B."""
    a, b = curves.pinned_waves, curves.waves
    if a is None or b is None or curves.stale:
        return []
    each = [f"{_strongest(a)} of A, {curves.pinned_body}", f"{_strongest(b)} of B, {curves.body}"]
    return [f"Strongest line at the point: {'; '.join(each)}."]


def _strongest(answer: Answer) -> str:
    record = answer.response.record
    line = next((line for line in answer.lines if line.frequency > 0), None)
    if line is None:
        return f"0 {record.shown}"
    size = f"{record.per_unit * line.amplitude:.3g} {record.shown}"
    return f"{size} at {line.frequency:.0f} Hz ({line.name})"


def added_names(pressure: MovingPressure) -> list[str]:
    """Lines of a load that it lacks as published, the strongest first: what drive law and focus
    add.
    """
    before, found = named_lines(published(pressure)), line_names(pressure, PRESENT)
    names = [found.names[k] for k in np.argsort(-found.strengths, kind="stable")]
    return [name for name in names if name not in before]


def warnings(answers: Sequence[Answer]) -> list[str]:
    """Warnings of responses, each sentence once."""
    return list(dict.fromkeys(s for answer in answers for s in answer.response.effort.warnings))


def expected(answer: Answer) -> str:
    """Expected relative error of a response, in words, if it has one."""
    error = getattr(answer.response, "expected_error", np.nan)
    return f"Expected numerical error: {stated_error(error)}" if error > 0 else ""


def differs(pinned: Values, values: Values) -> list[dict[str, str]]:
    """Table of the differences between two sets of values: A is pinned, B is shown."""
    return [
        {"name": NAMES[key], "a": said(key, pinned[key]), "b": said(key, values[key])}
        for key in KEYS
        if pinned[key] != values[key]
    ]


def unresolved(count: int, duration: float) -> str:
    """Unresolved lines, which the table leaves out, of a Tacton of this duration in s."""
    if not count:
        return ""
    lines = f"{count} line{'s' * (count > 1)}"
    return f"{lines} cannot be resolved in {duration:g} s; make the Tacton longer."


def commanded(state: Any, scene: Scene, zoom: tuple[float, float] | None) -> None:
    """The commanded Tacton between two times in s, or in the span that is chosen."""
    between = zoom or plots.span_of(state.span, scene.tacton.duration)
    state.commanded_plot = plots.commanded_plot(scene.pressure, *between)


def foci_track(tacton: Tacton) -> list[list[list[float]]]:
    """Places of the foci at each per cent of a drawing period, x and -y in mm as on a map."""
    parts = np.arange(PHASES) / PHASES / tacton.n_paths
    at = [tacton.trajectory.at_phase((parts + phase) % 1) for phase in tacton.foci]
    return np.round(np.stack(at, axis=1) * [1e3, -1e3], 2).tolist()


def _measured(curves: Curves) -> str:
    """Sentence on what is shown of a measurement, or why nothing is."""
    found, waves = curves.measured, curves.waves
    if found is None:
        return ""
    refused = measured.refusal(found, waves.response.record if waves else DISPLACEMENT)
    place = measured.nearest(found, curves.kernel.response.probes[0, :2])
    times = "from its first sample" if len(found.times) else "as a spectrum alone"
    said = refused or f"{measured.named(found, place)}: of {len(found.places)} places, {times}."
    return " ".join([said, *found.remarks])


def _of_waves(curves: Curves, against: bool) -> dict[str, Any]:
    """Map of the waves or, `against` the kernel, of by how many dB they are above it, each re its
    own largest.
    """
    waves = curves.waves
    found = _map(waves, f"B: {curves.body}" if curves.pinned else "Waves")
    if waves is None or not against:
        return found
    ends = [f"{end:+.0f} dB" if end else "0" for end in (-drawings.DEEPEST, 0, drawings.DEEPEST)]
    return found | {
        "picture": drawings.difference(waves.map, curves.kernel.map), "ends": ends,
        "said": "RMS re largest, less the kernel's", "signed": True,
    }  # fmt: skip


def _map(answer: Answer | None, title: str = "") -> dict[str, Any]:
    """Map with its `title`, what it `said`, and whether its colours are `signed`."""
    words = {"title": title, "signed": False}
    if answer is None:
        return words | {"picture": "", "threshold": "", "ends": [], "said": ""}
    found, unit = answer.map, "m" if answer.response.record.of_body else "Pa"
    return words | {
        "said": "RMS displacement, µm" if unit == "m" else "RMS pressure, Pa",
        "picture": drawings.picture(found),
        "threshold": drawings.drawn(found.threshold),
        "ends": drawings.ends(float(np.nanmax(found.rms, initial=0.0)), unit),
    }
