"""What a page draws: curves for plotly as plain lists, maps as small pictures and paths in mm."""

import base64
from collections.abc import Sequence
from functools import cache
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshes.tetmesh import Floats
from simple_model import Tacton, threshold
from simple_model.response import step
from simple_model.tacton import level
from simple_model.threshold import BAND, HIGHEST, LOWEST, PRESSURE
from skinwave.web.model import Answer, Map, commanded_curve, thinned

# Okabe and Ito's colours, told apart by every kind of colour vision; on dark their lighter ones.
KERNEL, WAVES, PINNED, FELT = "#0072B2", "#D55E00", "#8a8a8a", "#CC4FA0"
KERNEL_DARK, WAVES_DARK = "#56B4E9", "#E69F00"
DIGITS = 5  # of the largest number of a curve that are sent
STALE = 0.2  # opacity of an answer that is not that of the controls
NAMED = 6  # lines with a name in the plot
SPANS = {"first 60 ms": (0.0, 0.06), "first 20 ms": (0.0, 0.02), "last 60 ms": (-0.06, 0.0),
         "all": (0.0, np.inf)}  # fmt: skip
Plot = dict[str, Any]


def numbers(values: Floats) -> list[float]:
    """Values (n,) as they are sent: to `DIGITS` digits of the largest."""
    largest = float(np.abs(values).max(initial=0.0))
    if largest == 0 or not np.isfinite(largest):
        return [float(v) for v in values]
    digits = DIGITS - 1 - int(np.floor(np.log10(largest)))
    return [float(v) for v in np.round(values, digits)]


def span_of(name: str, duration: float) -> tuple[float, float]:
    """Start and end in s of what is shown of a Tacton that lasts `duration` s."""
    start, end = SPANS[name]
    if start < 0:
        return max(0.0, duration + start), duration
    return start, min(end, duration)


def commanded_plot(tacton: Tacton, start: float, end: float, dark: bool) -> Plot:
    """The commanded Tacton between two times in s, with its carrier if that can be resolved."""
    t, p, resolved = commanded_curve(tacton, start, end)
    colour, y = _colours(dark)[0], numbers(100 * p)
    steps = {"x0": 1e3 * float(t[0]), "dx": 1e3 * float(t[1] - t[0])}
    data = [_curve([], y, colour, "carrier" if resolved else "envelope") | steps]
    del data[0]["x"]
    if not resolved:
        low = data[0] | {"y": [-v for v in y]}
        data.append(low | {"fill": "tonexty", "fillcolor": _faded(colour, 0.35)})
    shown = "with its 40 kHz carrier" if resolved else "envelope of the carrier; zoom in to see it"
    return {
        "data": data,
        "layout": _layout(f"Commanded Tacton, {shown}", "time, ms", "% of full drive", dark)
        | {"showlegend": False},
    }


def waveform_plot(
    kernel: Answer, waves: Answer | None, pinned: Sequence[Answer], span: tuple[float, float],
    dark: bool, *, stale: bool = False,
) -> Plot:  # fmt: skip
    """Pressure by the point kernel and displacement of the body at the selected point."""
    data = []
    for answer, style in _styled(kernel, waves, pinned, dark, stale):
        times = answer.response.times
        shown = (times >= span[0]) & (times <= span[1] + 0.5 * step(times))
        t, y = thinned(times[shown], answer.response.displacement[shown, 0])
        data.append(_curve(numbers(1e3 * t), numbers(_in_unit(answer) * y), **style))
    layout = _layout("Waveform at the point", "time, ms", "pressure, Pa", dark)
    layout |= {"uirevision": f"{span}"} | _second_axis(waves, pinned, dark)
    _aligned(layout, data)
    return {"data": data, "layout": layout}


def spectrum_plot(
    kernel: Answer, waves: Answer | None, pinned: Sequence[Answer], dark: bool, *,
    stale: bool = False, highest: float = 600.0,
) -> Plot:  # fmt: skip
    """The spectra at the selected point, their lines named, and what is felt of them."""
    data = []
    for answer, style in _styled(kernel, waves, pinned, dark, stale):
        shown = answer.frequencies <= highest
        f, a = thinned(answer.frequencies[shown], answer.spectrum[shown])
        data.append(_curve(numbers(f), numbers(_in_unit(answer) * a), **style))
    named = waves if waves is not None and not stale else kernel
    layout = _layout("Spectrum at the point", "frequency, Hz", "pressure, Pa", dark)
    axis = _second_axis(waves, pinned, dark)
    if waves is not None:
        data.append(_threshold_curve(waves, highest))
    else:
        data.append(_just_felt(kernel, highest))
    layout |= {"annotations": _names(named, highest, dark), "uirevision": "spectrum"}
    layout["xaxis"] |= {"range": [0, highest]}
    layout |= axis
    _aligned(layout, data, _tallest(waves, highest))
    return {"data": data, "layout": layout}


def picture(found: Map) -> str:
    """RMS of a map as the address of a PNG, from dark (none) to light (its largest)."""
    from PIL import Image

    largest = float(np.nanmax(found.rms, initial=0.0)) or 1.0
    relative = np.nan_to_num(found.rms / largest)
    image = np.dstack([_shades()[np.round(255 * relative).astype(int)],
                       np.where(np.isnan(found.rms), 0, 255)])  # fmt: skip
    buffer = BytesIO()
    Image.fromarray(image[::-1].astype(np.uint8)).save(buffer, format="png")
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()


def drawn(lines: Sequence[Floats]) -> str:
    """Lines (k, 2) in metre as a path of an SVG in mm, y upwards; at most 200 points of each."""
    lines = [line[:: max(1, len(line) // 200)] for line in lines]
    return "".join(
        "M" + "L".join(f"{1e3 * x:.2f},{-1e3 * y:.2f}" for x, y in line) for line in lines
    )


def timeline(tacton: Tacton) -> str:
    """The level of a rhythm over a Tacton as points of a line, 100 wide and 26 high."""
    if tacton.rhythm is None:
        return ""
    t = np.linspace(0, tacton.duration, 800)
    high = np.broadcast_to(level(tacton, t), t.shape)
    return " ".join(
        f"{100 * x / tacton.duration:.2f},{24 - 22 * y:.2f}" for x, y in zip(t, high, strict=True)
    )


def shown_value(value: float, unit: str) -> str:
    """A value as a text with its unit, Pa or m in micrometre."""
    return f"{value:.3g} Pa" if unit == "Pa" else f"{1e6 * value:.3g} µm"


def rows(kernel: Answer, waves: Answer | None) -> list[dict[str, str]]:
    """The named lines as a table: frequency, amplitudes and level above threshold."""
    by_wave = {line.name: line for line in waves.lines} if waves else {}
    by_kernel = {line.name: line for line in kernel.lines}
    names = dict.fromkeys([line.name for line in (waves.lines if waves else ())]
                          + [line.name for line in kernel.lines])  # fmt: skip
    found = []
    for name in list(names)[:12]:
        line = by_wave.get(name) or by_kernel[name]
        pa, um = by_kernel.get(name), by_wave.get(name)
        level = um.sensation if um else None
        found.append({
            "name": written(name),
            "frequency": f"{line.frequency:.1f}",
            "pressure": f"{pa.amplitude:.3g}" if pa else "",
            "displacement": f"{1e6 * um.amplitude:.3g}" if um else "",
            "level": "" if level is None or not np.isfinite(level) else f"{level:+.0f}",
        })  # fmt: skip
    return found


def written(name: str) -> str:
    """A line's name with its subscripts, such as 2f_d-f_AM, as HTML."""
    for tone in ("AM2", "AM", "d", "e", "r"):
        name = name.replace(f"f_{tone}", f"f<sub>{tone}</sub>")
    return name


@cache
def _shades() -> NDArray[np.float64]:
    """Colours (256, 3) from least to most, told apart by every kind of colour vision."""
    from matplotlib import colormaps

    return np.asarray(np.round(255 * colormaps["cividis"](np.arange(256))[:, :3]))


def _colours(dark: bool) -> tuple[str, str]:
    return (KERNEL_DARK, WAVES_DARK) if dark else (KERNEL, WAVES)


def _faded(colour: str, opacity: float) -> str:
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return f"rgba({red},{green},{blue},{opacity})"


def _in_unit(answer: Answer) -> float:
    return 1e6 if answer.response.unit == "m" else 1.0


def _styled(
    kernel: Answer, waves: Answer | None, pinned: Sequence[Answer], dark: bool, stale: bool
) -> list[tuple[Answer, dict[str, Any]]]:
    """What is drawn, the pinned first, each with its style."""
    colours = _colours(dark)
    found: list[tuple[Answer, dict[str, Any]]] = []
    for answer in pinned:
        name = "pinned kernel" if answer.response.unit == "Pa" else "pinned waves"
        found.append((answer, {"colour": PINNED, "name": name, "dash": "dot"}))
    found.append((kernel, {"colour": colours[0], "name": "point kernel, Pa"}))
    if waves is not None:
        name = f"waves ({waves.response.model}), µm" + (" — being computed" if stale else "")
        found.append(
            (waves, {"colour": colours[1], "name": name, "opacity": STALE if stale else 1.0})
        )
    return [(a, style | ({"axis": "y2"} if a.response.unit == "m" else {})) for a, style in found]


def _curve(
    x: list[float], y: list[float], colour: str, name: str, *, dash: str = "solid",
    axis: str = "y", opacity: float = 1.0,
) -> dict[str, Any]:  # fmt: skip
    return {
        "type": "scatter", "mode": "lines", "x": x, "y": y, "name": name, "yaxis": axis,
        "opacity": opacity, "line": {"color": colour, "width": 1.4, "dash": dash},
    }  # fmt: skip


def _threshold_curve(waves: Answer, highest: float) -> dict[str, Any]:
    f = np.geomspace(LOWEST, min(HIGHEST, highest), 80)
    curve = 1e6 * threshold(f)
    drawn = _curve(numbers(f), numbers(curve), FELT, f"threshold (±{BAND:g} dB)", axis="y2")
    drawn["line"]["dash"] = "dash"
    return drawn


def _tallest(waves: Answer | None, highest: float) -> float | None:
    """What the axis of displacement has to reach: the lines, and the least of the threshold."""
    if waves is None:
        return None
    f = np.linspace(50, highest, 60)
    shown = waves.spectrum[waves.frequencies <= highest]
    return 1e6 * max(1.25 * float(shown.max()), 1.5 * float(threshold(f).min()))


def _just_felt(kernel: Answer, highest: float) -> dict[str, Any]:
    drawn = _curve([0.0, highest], [PRESSURE, PRESSURE], FELT, "just felt with AM at 200 Hz")
    drawn["line"]["dash"] = "dash"
    return drawn


def _names(answer: Answer, highest: float, dark: bool) -> list[dict[str, Any]]:
    """Names over the strongest lines; with the level above threshold if there is one."""
    shown: list[Any] = []
    for line in answer.lines:
        far = all(abs(line.frequency - other.frequency) > 0.08 * highest for other in shown)
        if len(shown) < NAMED and line.frequency <= highest and far:
            shown.append(line)
    axis = "y2" if answer.response.unit == "m" else "y"
    return [
        {
            "x": round(line.frequency, 2), "y": float(f"{_in_unit(answer) * line.amplitude:.4g}"),
            "yref": axis, "showarrow": False, "yshift": 16, "font": {"size": 10},
            "bgcolor": _paper(dark),
            "text": written(line.name) + (
                f"<br>{line.sensation:+.0f} dB" if line.sensation is not None
                and np.isfinite(line.sensation) else ""
            ),
        }
        for line in shown
    ]  # fmt: skip


def _paper(dark: bool) -> str:
    return "rgba(18,18,18,0.7)" if dark else "rgba(255,255,255,0.7)"


def _aligned(layout: Plot, data: Sequence[Plot], most: float | None = None) -> None:
    """Ranges with one zero for both axes; `most` is the largest that the second has to show."""
    ends = {}
    for name, axis in (("y", "yaxis"), ("y2", "yaxis2")):
        values = [v for curve in data if curve["yaxis"] == name for v in curve["y"]]
        high, low = max([*values, 0.0]), min([*values, 0.0])
        if axis in layout and values:
            ends[axis] = (high if most is None or name == "y" else most, -low)
    below = max((low / high if high else 1.0) for high, low in ends.values())
    for axis, (high, low) in ends.items():
        top = 1.08 * max(high, low / below if below else high) or 1.0
        layout[axis] |= {"range": [-max(below, 0.03) * top, top]}


def _layout(title: str, x: str, y: str, dark: bool) -> dict[str, Any]:
    ink, grid = ("#e6e6e6", "#444") if dark else ("#222", "#ddd")
    axis = {"gridcolor": grid, "zerolinecolor": grid, "automargin": False}
    return {
        "title": {"text": title, "font": {"size": 12}, "x": 0.01, "y": 0.98, "yanchor": "top"},
        "margin": {"l": 58, "r": 58, "t": 26, "b": 34},
        "font": {"size": 11, "color": ink, "family": "Roboto, sans-serif"},
        "paper_bgcolor": "rgba(0,0,0,0)", "plot_bgcolor": "rgba(0,0,0,0)",
        "xaxis": axis | {"title": {"text": x, "standoff": 2}},
        "yaxis": axis | {"title": {"text": y, "standoff": 2}},
        "legend": {"orientation": "h", "x": 1, "xanchor": "right", "y": 1.0, "yanchor": "bottom",
                   "bgcolor": "rgba(0,0,0,0)", "font": {"size": 10}},
        "showlegend": True, "autosize": True, "hovermode": "closest",
    }  # fmt: skip


def _second_axis(waves: Answer | None, pinned: Sequence[Answer], dark: bool) -> dict[str, Any]:
    """The axis of displacement on the right, where something moves."""
    if waves is None and not any(answer.response.unit == "m" for answer in pinned):
        return {}
    return {
        "yaxis2": {
            "title": {"text": "displacement, µm", "standoff": 2}, "overlaying": "y",
            "side": "right", "showgrid": False, "zeroline": False,
            "color": _colours(dark)[1],
        }
    }  # fmt: skip
