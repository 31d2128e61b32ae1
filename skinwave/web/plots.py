"""Curves that a page draws: what a canvas needs of each plot, as plain lists.

A plot has a `title`, its axes `x`, `y` and, where something moves, `y2`, each with what it `said`
and its `range`, curves in `data`, and `names` over lines. A curve's `role` gives it its colour,
which is the page's own. Zooming is forgotten when `kept` changes.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from meshes.tetmesh import Floats
from simple_model import MovingPressure, threshold
from simple_model.quantities import DISPLACEMENT, Quantity
from simple_model.response import step
from simple_model.threshold import BAND, HIGHEST, LOWEST, pressure_threshold
from skinwave.measurements import Measurement
from skinwave.pictures.styles import LABELS
from skinwave.web import measured
from skinwave.web.bands import Bands
from skinwave.web.drawings import written
from skinwave.web.levels import Levels
from skinwave.web.model import Answer, commanded_curve, peaks, thinned

DIGITS = 5  # of the largest number of a curve that are sent
STALE = 0.2  # opacity of a response that is not that of the controls
NAMED = 6  # lines with a name in the plot
SPANS = {"first 60 ms": (0.0, 0.06), "first 20 ms": (0.0, 0.02), "last 60 ms": (-0.06, 0.0),
         "all": (0.0, np.inf)}  # fmt: skip
BESIDE = 2.5  # of the largest of the curves: what is seen of a band
ROOM = 1.4  # of the tallest line of a spectrum, for names above it
APART = 10.0  # times that A and B differ to be drawn each over its largest
RELATIVE = ", each over its largest"  # of what an axis says then
DYNAMIC = 80.0  # dB below the tallest line that are seen
KERNEL = f"{LABELS['point-kernel']}, Pa"
PlotlyFigure = dict[str, Any]


@dataclass(frozen=True, kw_only=True, eq=False)
class Curves:
    """Responses in one plot: the `kernel` under the load of the `waves`, which are of other
    controls while `stale`; the kernel as `published`; those that are `pinned`; the `bands` of the
    waves or, without any, of the kernel; `levels` over a control; and what was `measured`. With
    what is pinned, of the `pinned_body`, waves have the name of their `body`.
    """

    kernel: Answer
    waves: Answer | None = None
    published: Answer | None = None
    pinned: Sequence[Answer] = ()
    bands: Bands | None = None
    stale: bool = False
    levels: Levels | None = None
    measured: Measurement | None = None
    body: str = ""
    pinned_body: str = ""

    @property
    def pinned_waves(self) -> Answer | None:
        """Waves that are pinned, if any are."""
        return next((a for a in self.pinned if a.response.record.of_body), None)


def numbers(values: Floats) -> list[float]:
    """Values (n,) as they are sent: to `DIGITS` digits of the largest."""
    largest = float(np.abs(values).max(initial=0.0))
    if largest == 0 or not np.isfinite(largest):
        return values.tolist()
    digits = DIGITS - 1 - int(np.floor(np.log10(largest)))
    return np.round(values, digits).tolist()


def span_of(name: str, duration: float) -> tuple[float, float]:
    """Start and end in s of what is shown of a Tacton that lasts `duration` s."""
    start, end = SPANS[name]
    if start < 0:
        return max(0.0, duration + start), duration
    return start, min(end, duration)


def commanded_plot(pressure: MovingPressure, start: float, end: float) -> PlotlyFigure:
    """The commanded signal between two times in s: with its carrier or, where that cannot be
    resolved, its envelope.
    """
    found = commanded_curve(pressure, start, end)
    t = 1e3 * found.times
    curve = {"role": "kernel", "axis": "y", "x0": float(t[0]), "dx": float(t[1] - t[0])}
    name = "carrier" if found.carrier else "envelope" if found.least is None else "largest"
    data = [curve | {"name": name, "y": numbers(100 * found.largest),
                     "mirrored": not found.carrier}]  # fmt: skip
    if found.carrier:
        shown = "with its 40 kHz carrier"
    elif found.least is None:
        shown = "envelope of the carrier; zoom in to see it"
    else:
        shown = "largest and least amplitude; zoom in to see it"
        least = numbers(100 * found.least)
        data.append(curve | {"name": "least", "y": least, "mirrored": True, "role": "published"})
    law = pressure.law.name.replace("_", " ")
    return {
        "title": f"Commanded signal, {law}, {shown}", "data": data,
        "x": {"said": "time, ms", "range": [1e3 * max(0.0, start),
                                            1e3 * min(end, pressure.tacton.duration)]},
        "y": {"said": "% of full drive", "range": [-108.0, 108.0]},
        "asks": True,
    }  # fmt: skip


def waveform_plot(curves: Curves, span: tuple[float, float]) -> PlotlyFigure:
    """Pressure by the point kernel and displacement of the body at the selected point, between two
    times in s.
    """
    data = []
    if (bands := curves.bands) is not None and bands.times.size:
        within = (bands.times >= span[0]) & (bands.times <= span[1] + 0.5 * step(bands.times))
        data = [_band(curves, 1e3 * bands.times[within], bands.waveform[:, within])]
    for answer, style in _styled(curves):
        times = answer.response.times
        shown = (times >= span[0]) & (times <= span[1] + 0.5 * step(times))
        t, y = thinned(times[shown], answer.response.values[shown, 0])
        data.append({"x": numbers(1e3 * t), "y": numbers(_in_unit(answer) * y), **style})
    data += _measured(curves, measured.waveform, 1e3, span)
    data, second, _ = _apart(data, curves)
    return {
        "title": "Waveform at the point", "data": data, "kept": f"{span}", "legend": True,
        "x": {"said": "time, ms", "range": [1e3 * float(end) for end in span]},
        **_axes(data, second),
    }  # fmt: skip


def spectrum_plot(
    curves: Curves, highest: float = 600.0, *, with_threshold: bool = True
) -> PlotlyFigure:
    """The spectra at the selected point, their lines named, and the detection threshold, which is
    that of a displacement of the surface.
    """
    data, waves = [], curves.waves
    if (bands := curves.bands) is not None and bands.times.size:
        within = bands.frequencies <= highest
        data = [_band(curves, bands.frequencies[within], bands.spectrum[:, within])]
    for answer, style in _styled(curves):
        shown = answer.frequencies <= highest
        f, a = thinned(answer.frequencies[shown], answer.spectrum[shown])
        data.append({"x": numbers(f), "y": numbers(_in_unit(answer) * a), **style})
    data += _measured(curves, measured.spectrum, 1.0, (0.0, highest))
    if with_threshold:
        data.append(_threshold_curve(highest, of_waves=waves is not None))
    named = waves if waves is not None and not curves.stale else curves.kernel
    data, second, one = _apart(data, curves)
    tallest = _tallest(curves, highest, with_threshold)
    return {
        "title": "Spectrum at the point", "data": data, "kept": f"{highest}", "legend": True,
        "x": {"said": "frequency, Hz", "range": [0.0, float(highest)]},
        "names": _names(named, highest, one if named is waves else 1.0),
        **_axes(data, second, tallest and tallest / one, ROOM),
    }  # fmt: skip


def in_decibel(plot: PlotlyFigure) -> PlotlyFigure:
    """A spectrum with both its axes in dB re their units, over the same range."""
    spans, factors = {}, {"y": "Pa"} | ({"y2": plot["y2"]["said"].rpartition(", ")[2]}
                                       if "y2" in plot else {})  # fmt: skip
    for axis, unit in factors.items():
        top = 20 * np.log10(max(plot[axis]["range"][1] / ROOM, 1e-30))
        words = plot[axis]["said"].rpartition(", ")[0]
        relative = plot[axis]["said"].endswith(RELATIVE)
        spans[axis] = {"said": f"{words}{RELATIVE}, dB" if relative else f"{words}, dB re 1 {unit}",
                       "range": [top - DYNAMIC, top + 0.2 * DYNAMIC]}  # fmt: skip

    def level(axis: str, values: list[float]) -> list[float]:
        least = 10 ** (spans[axis]["range"][0] / 20)
        return np.round(20 * np.log10(np.maximum(np.abs(values), least)), 2).tolist()

    data = [curve | {key: level(curve["axis"], curve[key]) for key in ("y", "low") if key in curve}
            for curve in plot["data"]]  # fmt: skip
    names = [name | {"y": level(name["axis"], [name["y"]])[0]} for name in plot["names"]]
    return plot | {"data": data, "names": names, "kept": f"{plot['kept']} dB"} | spans


def _band(curves: Curves, x: Floats, ends: Floats) -> dict[str, Any]:
    """Band between two ends (2, n), with every peak of either."""
    answer = curves.waves or curves.kernel
    of_body = answer.response.record.of_body
    kept = np.union1d(peaks(ends[0]), peaks(ends[1]))
    low, high = _in_unit(answer) * ends[:, kept]
    return {
        "role": "waves" if of_body else "kernel", "axis": "y2" if of_body else "y",
        "name": "5 to 95 %", "x": numbers(x[kept]), "low": numbers(low), "y": numbers(high),
    }  # fmt: skip


def _measured(
    curves: Curves,
    read: Callable[[Measurement, int], tuple[Floats, Floats]],
    per: float,
    ends: tuple[float, float],
) -> list[dict[str, Any]]:
    """Curve of what was measured nearest the point, if it is of the quantity that is shown."""
    found = curves.measured
    if found is None or measured.refusal(found, _asked(curves)):
        return []
    place = measured.nearest(found, curves.kernel.response.probes[0, :2])
    x, y = read(found, place)
    within = (x >= ends[0]) & (x <= ends[1])
    if not within.any():
        return []
    x, y = thinned(x[within], y[within])
    name = measured.named(found, place)
    return [{"role": "measured", "axis": "y2", "name": name, "width": 1.1,
             "x": numbers(per * x), "y": numbers(_asked(curves).per_unit * y)}]  # fmt: skip


def _asked(curves: Curves) -> Quantity:
    """The quantity on the axis of waves."""
    return curves.waves.response.record if curves.waves else DISPLACEMENT


def _second(curves: Curves) -> str:
    """Words of the axis of waves."""
    return f"{_asked(curves).words}, {_asked(curves).shown}"


def _in_unit(answer: Answer) -> float:
    return answer.response.record.per_unit


def _apart(data: list[dict[str, Any]], curves: Curves) -> tuple[list[dict[str, Any]], str, float]:
    """Curves, what is said of the axis of waves, and what 1 on it is of those that are shown: A and
    B each over its largest if these differ by more than `APART` times or are not of one quantity.
    """
    words, pinned = _second(curves), curves.pinned_waves
    if pinned is None or curves.waves is None:
        return data, words, 1.0
    units = {role: answer.response.record.shown
             for role, answer in (("waves", curves.waves), ("pinned", pinned))}  # fmt: skip
    largest = {
        role: max((abs(value) for curve in data if curve["axis"] == "y2" and curve["role"] == role
                   and "low" not in curve for value in curve["y"]), default=0.0)
        for role in units
    }  # fmt: skip
    low, high = sorted(largest.values())
    if not low or (high <= APART * low and len(set(units.values())) == 1):
        return data, words, 1.0

    def over_largest(curve: dict[str, Any]) -> dict[str, Any]:
        if curve["axis"] != "y2":
            return curve
        role = "pinned" if curve["role"] == "pinned" else "waves"
        one, unit = largest[role], units[role]
        scaled = {key: numbers(np.array(curve[key]) / one) for key in ("y", "low") if key in curve}
        name = curve.get("name", "").replace(f", {unit}", f", 1 = {one:.3g} {unit}")
        return curve | scaled | {"name": name}

    return [over_largest(curve) for curve in data], f"waves{RELATIVE}", largest["waves"]


def _styled(curves: Curves) -> list[tuple[Answer, dict[str, Any]]]:
    """Curves with their styles in the order of the legend: kernels, waves, all pinned ones as A."""
    shown = "B: " if curves.pinned else ""
    found: list[tuple[Answer, dict[str, Any]]] = []
    if curves.published is not None:
        name = f"{LABELS['point-kernel-published']}, Pa"
        found.append((curves.published, {"role": "published", "name": name, "width": 0.8}))
    found.append((curves.kernel, {"role": "kernel", "name": shown + KERNEL}))
    if curves.waves is not None:
        body = curves.body if curves.pinned else ""
        style = {"role": "waves", "name": shown + waves_name(curves.waves, curves.stale, body),
                 "opacity": STALE if curves.stale else 1.0}  # fmt: skip
        found.append((curves.waves, style))
    for answer in curves.pinned:
        of_kernel = not answer.response.record.of_body
        name = KERNEL if of_kernel else waves_name(answer, body=curves.pinned_body)
        style = {"role": "pinned", "name": f"A: {name}", "dash": "dot" if of_kernel else "dash"}
        found.append((answer, style))
    return [(a, style | {"axis": "y2" if a.response.record.of_body else "y"}) for a, style in found]


def waves_name(answer: Answer, stale: bool = False, body: str = "") -> str:
    """The name of waves, or of their body, in every legend, with their unit."""
    return f"{body or 'waves'} ({answer.response.model}), {answer.response.record.shown}" + (
        " — being computed" if stale else ""
    )


def _threshold_curve(highest: float, *, of_waves: bool) -> dict[str, Any]:
    """Detection threshold of displacement or, without waves, of the kernel's pressure."""
    f = np.geomspace(LOWEST, min(HIGHEST, highest), 80)
    name = f"threshold (±{BAND:g} dB)" if of_waves else "threshold on skin, from AM at 200 Hz"
    return {
        "role": "threshold", "name": name, "dash": "dash", "axis": "y2" if of_waves else "y",
        "x": numbers(f), "y": numbers(1e6 * threshold(f) if of_waves else pressure_threshold(f)),
    }  # fmt: skip


def _tallest(curves: Curves, highest: float, with_threshold: bool) -> float | None:
    """Least range of the axis of waves: the lines with their bands, and the minimum of the
    threshold.
    """
    waves, bands = curves.waves, curves.bands
    if waves is None:
        return None
    f = np.linspace(50, highest, 60)
    shown = waves.spectrum[waves.frequencies <= highest]
    least = 1.3 * float(threshold(f).min()) if with_threshold else 0.0
    most = float(shown.max())
    if bands is not None:
        upper = bands.spectrum[1:, bands.frequencies <= highest]
        most = max(most, min(BESIDE * most, float(upper.max(initial=0.0))))
    return _in_unit(waves) * max(most, least)


def _names(answer: Answer, highest: float, one: float = 1.0) -> list[dict[str, Any]]:
    """Names over the strongest lines, where `one` is 1 on their axis; with the level above
    threshold if there is one.
    """
    per = _in_unit(answer) / one
    shown: list[Any] = []
    for line in answer.lines:
        far = all(abs(line.frequency - other.frequency) > 0.08 * highest for other in shown)
        if len(shown) < NAMED and line.frequency <= highest and far:
            shown.append(line)
    return [
        {
            "x": round(line.frequency, 2), "y": float(f"{per * line.amplitude:.4g}"),
            "axis": "y2" if answer.response.record.of_body else "y",
            "said": [written(line.name)] + (
                [f"{line.sensation:+.0f} dB"] if line.sensation is not None
                and np.isfinite(line.sensation) else []
            ),
        }
        for line in shown
    ]  # fmt: skip


def _axes(
    data: Sequence[PlotlyFigure], second: str, most: float | None = None, room: float = 1.08
) -> dict[str, Any]:
    """Both axes with one zero; `second` is what the second shows and `most` the largest that it has
    to show, `room` what there is above the largest, over it.
    """
    said = {"y": "pressure, Pa", "y2": second}
    ends = {}
    for name in said:
        own = [curve for curve in data if curve["axis"] == name]
        values = [v for curve in own if "low" not in curve for v in curve["y"]]
        limit = BESIDE * max(map(abs, values), default=0.0)
        values += [min(max(v, -limit), limit) for curve in own if "low" in curve
                   for v in (*curve["low"], *curve["y"])]  # fmt: skip
        if values:
            high = max([*values, 0.0]) if most is None or name == "y" else most
            ends[name] = (high, -min([*values, 0.0]))
    below = max((low / high if high else 1.0) for high, low in ends.values())
    axes = {}
    for name, (high, low) in ends.items():
        top = room * max(high, low / below if below else high) or 1.0
        axes[name] = {"said": said[name], "range": [-max(below, 0.03) * top, top]}
    return axes
