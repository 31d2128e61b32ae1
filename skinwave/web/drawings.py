"""Drawings of a page other than curves: maps as small pictures, paths in mm, table of lines."""

import base64
from collections.abc import Mapping, Sequence
from functools import cache
from io import BytesIO

import numpy as np
from numpy.typing import NDArray

from meshes.tetmesh import Floats
from simple_model import Tacton
from simple_model.joined import parted
from skinwave.web.model import Answer, AreaMap, LineAtPoint

MOST_ROWS, MOST_PINNED = 12, 4  # of a table of lines, and of those that A alone has
DEEPEST = 30.0  # dB, of differences
LEAST = 10 ** (-DEEPEST / 20)  # of the largest: what is less counts as that
NO_BANDS: Mapping[str, tuple[float, float]] = {}
# Of 255; red into the body and blue out of it, as in the pictures of a report. Also in body.js.
INTO, OUT, STILL = (
    np.array(c) for c in ((178.5, 22.95, 43.35), (33.15, 102.0, 170.85), (247.35,) * 3)
)


def picture(found: AreaMap) -> str:
    """RMS of a map as the address of a PNG, from dark (none) to light (its largest)."""
    largest = float(np.nanmax(found.rms, initial=0.0)) or 1.0
    relative = np.nan_to_num(found.rms / largest)
    return _png(shades()[np.round(255 * relative).astype(int)], np.isnan(found.rms))


def difference(found: AreaMap, reference: AreaMap) -> str:
    """Difference of the RMS levels of two maps, each re its own largest, as the address of a PNG:
    blue where the first is less, red where it is more, by `DEEPEST` dB.
    """
    levels = [20 * np.log10(np.maximum(each.rms / (np.nanmax(each.rms, initial=0.0) or 1.0), LEAST))
              for each in (found, reference)]  # fmt: skip
    part = np.clip(np.nan_to_num(levels[0] - levels[1]) / DEEPEST, -1, 1)
    return _png(signed_shade(part, root=False), np.isnan(found.rms))


def _png(colours: Floats, outside: NDArray[np.bool_]) -> str:
    """Colours (y, x, 3) of 0..255, transparent where it is outside, as the address of a PNG."""
    from PIL import Image

    image = np.dstack([colours, np.where(outside, 0, 255)])
    buffer = BytesIO()
    Image.fromarray(image[::-1].astype(np.uint8)).save(buffer, format="png")
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()


def drawn(lines: Sequence[Floats]) -> str:
    """Lines (k, 2) in metre as a path of an SVG in mm, y upwards; at most 200 points of each."""
    lines = [line[:: max(1, len(line) // 200)] for line in lines]
    return "".join(
        "M" + "L".join(f"{1e3 * x:.2f},{-1e3 * y:.2f}" for x, y in line) for line in lines
    )


def speeds(tacton: Tacton) -> str:
    """How fast the focus runs on each of several paths."""
    lengths = [np.linalg.norm(np.diff(line, axis=0), axis=1).sum()
               for line in parted(tacton.trajectory, tacton.n_paths)]  # fmt: skip
    each = [f"{length * tacton.drawing_frequency:.3g}" for length in lengths]
    return f"{', '.join(each)} m/s"


def ends(largest: float, unit: str) -> list[str]:
    """Labels of a colour bar at its left end, middle and right end: 0 to `largest`, Pa, or m in
    micrometre.
    """
    value, said = (largest, "Pa") if unit == "Pa" else (1e6 * largest, "µm")
    return ["0", f"{value / 2:.3g}", f"{value:.3g} {said}"]


def rows(
    kernel: Answer,
    waves: Answer | None,
    bands: Mapping[str, tuple[float, float]] = NO_BANDS,
    pinned: Answer | None = None,
) -> list[dict[str, str]]:
    """The named lines as a table: frequency, amplitudes, also of pinned waves, and level above
    threshold, with its 5 and 95 % by the name of the line.
    """
    by_wave = {line.name: line for line in waves.lines} if waves else {}
    per = waves.response.record.per_unit if waves else 1.0
    by_kernel = {line.name: line for line in kernel.lines}
    names = dict.fromkeys([*by_wave, *by_kernel])
    kept = _pinned_lines(pinned, {**by_kernel, **by_wave})
    found = []
    for name in list(names)[:MOST_ROWS]:
        line = by_wave.get(name) or by_kernel[name]
        pa, um = by_kernel.get(name), by_wave.get(name)
        level = um.sensation if um else None
        found.append({
            "name": written(name),
            "frequency": f"{line.frequency:.1f}",
            "pressure": f"{pa.amplitude:.3g}" if pa else "",
            "displacement": f"{per * um.amplitude:.3g}" if um else "",
            "level": "" if level is None or not np.isfinite(level) else f"{level:+.0f}",
            "band": " to ".join(f"{end:+.0f}" for end in bands.get(name, ())),
            "pinned": kept.pop(name, ("", ""))[1],
        })  # fmt: skip
    left = dict.fromkeys(("pressure", "displacement", "level", "band"), "")
    own = [left | {"name": f"A: {written(name)}", "frequency": frequency, "pinned": amplitude}
           for name, (frequency, amplitude) in kept.items() if name not in names]  # fmt: skip
    return found + own[:MOST_PINNED]


def _pinned_lines(
    pinned: Answer | None, others: Mapping[str, LineAtPoint]
) -> dict[str, tuple[str, str]]:
    """Frequency and amplitude of pinned lines, by their name or, at another frequency than the line
    of that name among the others, by both.
    """
    if pinned is None:
        return {}
    found, per = {}, pinned.response.record.per_unit
    for line in pinned.lines:
        other, frequency = others.get(line.name), f"{line.frequency:.1f}"
        same = other is None or f"{other.frequency:.1f}" == frequency
        name = line.name if same else f"{line.name}, {frequency} Hz"
        found[name] = (frequency, f"{per * line.amplitude:.3g}")
    return found


def written(name: str) -> str:
    """A line's name with its subscripts, such as 2f_d-f_AM, as HTML."""
    for tone in ("AM2", "AM", "d", "e", "r"):
        name = name.replace(f"f_{tone}", f"f<sub>{tone}</sub>")
    return name


def _gradient(colours: Floats, places: Floats) -> str:
    """Colours of 0..255 at places 0..1 from left to right, as CSS."""
    stops = [f"rgb({r:.0f} {g:.0f} {b:.0f}) {100 * place:.1f}%"
             for (r, g, b), place in zip(colours, places, strict=True)]  # fmt: skip
    return f"linear-gradient(to right, {', '.join(stops)})"


@cache
def shades() -> NDArray[np.float64]:
    """Colours (256, 3) from least to most, distinguishable with every kind of colour vision."""
    from matplotlib import colormaps

    return np.asarray(np.round(255 * colormaps["cividis"](np.arange(256))[:, :3]))


def signed_shade(part: Floats, root: bool = True) -> Floats:
    """Colours (..., 3) of 0..255 of a share -1..1 of the largest; by its `root` as body.js colours
    motion into the body.
    """
    way = np.where(part[..., None] > 0, INTO, OUT)
    strength = np.sqrt(np.abs(part)) if root else np.abs(part)
    return np.asarray(STILL + strength[..., None] * (way - STILL))


_PARTS = np.linspace(-1, 1, 41)
SEQUENTIAL = _gradient(shades()[::15], np.linspace(0, 1, 18))
DIVERGING = _gradient(np.array([OUT, STILL, INTO]), np.array([0.0, 0.5, 1.0]))
SIGNED = _gradient(signed_shade(_PARTS), (_PARTS + 1) / 2)
