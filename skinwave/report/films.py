"""Films of a period of motion: GIF, or MP4 where an encoder is installed."""

from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from simple_model.numbers import significant
from skinwave.report.palette import COLOURS, SPARE
from skinwave.report.render import Image, stage
from skinwave.report.styles import Style
from skinwave.results import speeds
from skinwave.results.views import View
from skinwave.system.effort import Progress, silent

LASTS = 4.0  # s that a film lasts on the screen,
EACH = 0.04  # s that a frame does at least
ROUND_OFF = 1e-4  # of a turn
FORMATS = (".gif", ".mp4")
ENCODER = ("imageio", "imageio_ffmpeg")
SHADES = 240  # colours of a GIF that are found in its frames; the rest are those of the page


def film(
    path: Path, views: Sequence[View], style: Style, progress: Progress | None = None, *,
    camera: str = "tilted", panel: tuple[int, int] | None = None,
) -> None:  # fmt: skip
    """Write the views' frames, one period of the whole pattern in the steady state, which repeats
    without a seam where the load is periodic; raises what `check_format` does.
    """
    check_format(path)
    count, report = len(views[0].times), progress or silent

    def frames() -> Iterator[Image]:
        with stage(views, style, camera=camera, panel=panel) as show:
            for k in range(count):
                report("film", k / count)
                yield show(k)

    if path.suffix == ".gif":
        _write_gif(path, list(frames()), style)
    else:
        _write_mp4(path, frames(), count)


def check_format(path: Path) -> None:
    """Refuse a film that cannot be written, by a ValueError, before anything is computed."""
    if path.suffix not in FORMATS:
        raise ValueError(f"film '{path.name}' ends in none of {', '.join(FORMATS)}; name it .gif")
    if path.suffix == ".mp4" and not all(map(find_spec, ENCODER)):
        raise ValueError(
            "MP4 needs imageio and imageio-ffmpeg, which are not installed; install the extra "
            "[film], or name it .gif"
        )


def seam(view: View) -> str:
    """Part of a view's motion that is shown, and whether it repeats without a seam, in words."""
    span, whole = f"{significant(1e3 * view.period)} ms", speeds.period(view.scene.pressure)
    jump = speeds.seam(view.scene.tacton, view.period)
    if jump < ROUND_OFF:
        return f"one period of {span}, which repeats without a seam"
    repeats = f"of {significant(1e3 * whole)} ms" if whole else "that never quite repeats"
    turn = f"phases jump by up to {100 * jump:.2g} % of a turn"
    return f"{span} of a pattern {repeats}; where it begins again, {turn}"


def lasts(frames: int) -> float:
    """How long in s a film of so many frames is shown."""
    return max(LASTS, EACH * frames)


def _write_gif(path: Path, frames: list[Image], style: Style) -> None:
    """With one palette for all frames, so that still parts do not flicker."""
    from PIL import Image as Pillow

    some = Pillow.fromarray(np.concatenate(frames[:: max(1, len(frames) // 4)]))
    page = [style.paper, style.ink, *COLOURS.values(), *SPARE]
    exact = [int(colour[k : k + 2], 16) for colour in page for k in (1, 3, 5)]
    palette = Pillow.new("P", (1, 1))
    palette.putpalette(exact + (some.quantize(SHADES, kmeans=1).getpalette() or []))
    shown = [
        Pillow.fromarray(frame).quantize(palette=palette, dither=Pillow.Dither.NONE)
        for frame in frames
    ]
    shown[0].save(
        path, save_all=True, append_images=shown[1:], loop=0, optimize=False,
        duration=round(100 * lasts(len(frames)) / len(frames)) * 10,  # ms, in steps of ten
    )  # fmt: skip


def _write_mp4(path: Path, frames: Iterator[Image], count: int) -> None:
    import imageio.v2 as imageio

    writer: Any
    with imageio.get_writer(path, fps=count / lasts(count), macro_block_size=16) as writer:
        for frame in frames:
            writer.append_data(frame)
