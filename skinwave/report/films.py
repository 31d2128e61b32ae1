"""Films of motion: GIF, or MP4 where an encoder is installed."""

from base64 import b64encode
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from simple_model.numbers import significant
from skinwave.report.palette import COLUMNS, SPARE, colour
from skinwave.report.render import Image, stage
from skinwave.report.renderer import renderer
from skinwave.report.styles import Style
from skinwave.results import playback
from skinwave.results.views import View
from skinwave.system.effort import Progress, silent

FORMATS = {".gif": "image/gif", ".mp4": "video/mp4"}
ENCODER = ("imageio", "imageio_ffmpeg")


@dataclass(frozen=True, kw_only=True, eq=False)
class Film:
    """Film that plays in a notebook: its `frames`, its `suffix`, .gif or .mp4, and its `data`."""

    frames: int
    suffix: str
    data: bytes

    def __repr__(self) -> str:
        kind = self.suffix[1:].upper()
        return f"<Film: {self.frames} frames, {kind} of {len(self.data):,} bytes>"

    def _repr_html_(self) -> str:
        source = f"data:{FORMATS[self.suffix]};base64,{b64encode(self.data).decode()}"
        if self.suffix == ".gif":
            return f'<img alt="film of the motion" src="{source}">'
        return f'<video controls loop autoplay muted src="{source}"></video>'


def film(
    path: Path, views: Sequence[View], style: Style, progress: Progress = silent, *,
    camera: str = "tilted", panel: tuple[int, int] | None = None,
) -> None:  # fmt: skip
    """Write a film of all frames of views, side by side.

    One period of a steady state repeats without a jump. `check_format` must accept the path.
    """
    count = len(views[0].times)

    def frames() -> Iterator[Image]:
        with stage(views, style, camera=camera, panel=panel) as show:
            for k in range(count):
                progress("film", k / count)
                yield show(k)

    if path.suffix == ".gif":
        _write_gif(path, list(frames()), style)
        return
    import imageio.v2 as imageio

    writer: Any
    with imageio.get_writer(path, fps=count / duration(count), macro_block_size=16) as writer:
        for frame in frames():
            writer.append_data(frame)


def check_format(path: Path) -> None:
    """Raise a ValueError if a film of this format cannot be drawn or written."""
    if path.suffix not in FORMATS:
        raise ValueError(f"the film '{path.name}' must end in {' or '.join(FORMATS)}")
    if path.suffix == ".mp4" and not all(map(find_spec, ENCODER)):
        raise ValueError(
            "MP4 needs imageio and imageio-ffmpeg, which are not installed. Install the extra "
            "[film], or write a .gif"
        )
    if not renderer().is_available:
        raise ValueError(f"this machine cannot draw a film: {renderer().detail}")


def played_text(view: View) -> str:
    """Describe which part of a motion is played, and whether it repeats without a jump."""
    span, whole = f"{significant(1e3 * view.period)} ms", playback.whole_period(view.scene.pressure)
    jump = playback.phase_jump(view.scene.tacton, view.period)
    if jump < 1e-4:  # of a turn: round-off
        return f"one period of {span}, which repeats without a jump"
    pattern = f"{significant(1e3 * whole)} ms long" if whole else "that never repeats exactly"
    turn = f"phases jump by up to {100 * jump:.2g} % of a turn at each repetition"
    return f"{span} of a pattern {pattern}; {turn}"


def duration(frames: int, least: float = 4.0, frame: float = 0.04) -> float:
    """Return the duration in s of a film with a number of frames, each shown for `frame` s."""
    return max(least, frame * frames)


def _write_gif(path: Path, frames: list[Image], style: Style) -> None:
    """Write a GIF with one palette for all frames; parts at rest do not flicker."""
    from PIL import Image as Pillow

    some = Pillow.fromarray(np.concatenate(frames[:: max(1, len(frames) // 4)]))
    page = [style.paper, style.ink, *(colour(column) for column in COLUMNS), *SPARE]
    exact = [int(shade[k : k + 2], 16) for shade in page for k in (1, 3, 5)]
    palette = Pillow.new("P", (1, 1))
    chosen = some.quantize(240, kmeans=1).getpalette() or []  # beside the exact ones
    palette.putpalette(exact + chosen)
    shown = [
        Pillow.fromarray(frame).quantize(palette=palette, dither=Pillow.Dither.NONE)
        for frame in frames
    ]
    shown[0].save(
        path, save_all=True, append_images=shown[1:], loop=0, optimize=False,
        duration=round(100 * duration(len(frames)) / len(frames)) * 10,  # ms, in steps of ten
    )  # fmt: skip
