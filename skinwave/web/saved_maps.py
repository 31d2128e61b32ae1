"""Maps and the moving body of the figure that a page saves."""

import base64
from io import BytesIO
from math import atan2, cos, degrees, sin
from textwrap import wrap
from typing import Any

import numpy as np

from skinwave.web import drawings
from skinwave.web.moving import DRAWN, Moving
from skinwave.web.paths import REACH

CHARACTERS = 14.5  # of 8 points in an inch
NARROW = 1.4  # inch of a colour bar without a label in the middle
RMS = drawings.shades() / 255
SIGNED = drawings.signed_shade(np.linspace(-1, 1, 256), root=False) / 255
MOTION = drawings.signed_shade(np.linspace(-1, 1, 256)) / 255
Corner = tuple[float, float]


def axes(figure: Any, box: tuple[float, float, float, float], **how: Any) -> Any:
    """Axes at (left, bottom, width, height) in inch."""
    wide, high = figure.get_size_inches()
    x, y, w, h = box
    return figure.add_axes((x / wide, y / high, w / wide, h / high), **how)


def title_of(found: dict[str, Any], seen: dict[str, Any], side: float) -> str:
    """Title of a map, or of the body in its place, as wide as the map."""
    said = found["said"]
    if is_body(found, seen):
        said = f"displacement, {seen['view'][0]:.1f} ms into the period"
    return "\n".join(wrap(f"{found['title']}: {said}", int(CHARACTERS * (side + 0.3))))


def is_body(found: dict[str, Any], seen: dict[str, Any]) -> bool:
    """Whether the moving body stands in the place of a map."""
    return found is seen["wave_map"] and seen["moving"] is not None


def area(figure: Any, corner: Corner, side: float, seen: dict[str, Any], key: str) -> None:
    """A map with path, foci, contours, selected point and colour bar."""
    found, edge, own = seen[key], 1e3 * REACH, key == "pinned_map"
    ax = axes(figure, (*corner, side, side))
    ax.imshow(
        _pixels(found["picture"]), extent=(-edge, edge, -edge, edge), interpolation="bilinear"
    )
    lines = [(found["threshold"], "#ff6fd0", "-"),
             (seen["pinned_path" if own else "path"], "#56B4E9", "-")]  # fmt: skip
    lines += [] if own else [(seen["influenced"], "white", ":")]
    for path, colour, dash in lines:
        for line in _lines(path):
            ax.plot(*line.T, color=colour, lw=0.9, ls=dash)
    if not own:
        for x, y in seen["foci"]:
            ax.plot(x, -y, "o", color="#56B4E9", mfc="none", ms=4)
    ax.plot(seen["x"], seen["y"], "x", color="#D55E00", ms=5, mew=1.2)
    ax.set(xlim=(-edge, edge), ylim=(-edge, edge), xlabel="x, mm", ylabel="y, mm")
    ax.set(xticks=[-40, 0, 40], yticks=[-40, 0, 40])
    ax.yaxis.labelpad = 0
    ax.set_title(title_of(found, seen, side), loc="left", fontsize="medium")
    _colour_bar(figure, corner, side, found["ends"], SIGNED if found["signed"] else RMS)


def _colour_bar(figure: Any, corner: Corner, side: float, ends: list[str], shades: Any) -> None:
    ends = ends if side > NARROW else ends[::2]
    bar = axes(figure, (corner[0], corner[1] - 0.48, side, 0.07))
    bar.imshow(shades[None], aspect="auto", extent=(0, 1, 0, 1))
    bar.set(yticks=[], xticks=np.linspace(0, 1, len(ends)))
    bar.set_xticklabels(ends)
    bar.get_xticklabels()[0].set_ha("left")
    bar.get_xticklabels()[-1].set_ha("right")
    bar.tick_params(length=0)


def _pixels(address: str) -> Any:
    """Pixels (y, x, 4) of a map's picture."""
    from PIL import Image

    return np.asarray(Image.open(BytesIO(base64.b64decode(address.partition(",")[2]))))


def _lines(path: str) -> list[Any]:
    """Lines (k, 2) in mm, y upwards, of a path as `drawings.drawn` writes it."""
    each = [part.split("L") for part in path.split("M") if part]
    return [np.array([point.split(",") for point in line], float) * [1, -1] for line in each]


def body(figure: Any, corner: Corner, side: float, seen: dict[str, Any], key: str) -> None:
    """The body as it is seen in three dimensions, in the colours of body.js."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    moving, (time, turned, tipped, cut, hue) = seen["moving"], seen["view"]
    motion, largest = _motion(moving, time)
    points = 1e3 * moving.shape.points
    ends = np.array([points.min(axis=0), points.max(axis=0)]).T
    triangles = moving.shape.triangles
    edge = ends[1, 0] + cut * np.ptp(ends[1])
    triangles = triangles[points[triangles, 1].max(axis=1) <= edge + 1e-9]
    lifted = points + [0, 0, 1] * (DRAWN * np.ptp(ends[0]) * motion[:, None])
    corners = lifted[triangles]
    ax = axes(
        figure, (*corner, side, side), projection="3d", proj_type="ortho", computed_zorder=False
    )
    ax.view_init(90 - degrees(tipped), degrees(atan2(-cos(turned), -sin(turned))))
    shades = RMS if hue else MOTION
    colours = _lit(corners, turned, tipped) * _shade(shades, motion[triangles].mean(axis=1))
    faces = Poly3DCollection(corners, facecolors=colours, edgecolors=colours, linewidths=0.2)
    faces.set_rasterized(True)
    ax.add_collection3d(faces)
    ax.set(xlim=ends[0], ylim=ends[1], zlim=ends[2])
    ax.set_box_aspect(np.ptp(ends, axis=1), zoom=1.5)
    ax.set_axis_off()
    ax.set_title(title_of(seen[key], seen, side), loc="left", fontsize="medium")
    for line in _lines(seen["path"]):
        ax.plot(*line.T, ends[2, 1], color="black", lw=0.8, zorder=5)
    for x, y in seen["foci"]:
        ax.plot(x, -y, ends[2, 1], "s", color="black", ms=3, zorder=5)
    value = f"{1e6 * largest:.3g}"
    _colour_bar(figure, corner, side, [f"{value} µm out", "0", f"{value} µm in"], shades)


def _motion(moving: Moving, time: float) -> tuple[Any, float]:
    """Motion (n,) at a time in ms of the period over its largest, and that in metre."""
    frames, largest = moving.frames, float(np.abs(moving.frames).max()) or 1.0
    exact = time / 1e3 / moving.period % 1 * len(frames)
    k, part = int(exact) % len(frames), exact % 1
    return ((1 - part) * frames[k] + part * frames[(k + 1) % len(frames)]) / largest, largest


def _shade(shades: Any, motion: Any) -> Any:
    """Colours (k, 3) of motion (k,) upwards, over the largest."""
    return shades[np.rint(127.5 * (1 - np.clip(motion, -1, 1))).astype(int)]


def _lit(corners: Any, turned: float, tipped: float) -> Any:
    """Brightness (k, 1) of triangles, lit over the left shoulder of who looks at them."""
    c, s, d, e = cos(turned), sin(turned), cos(tipped), sin(tipped)
    turn = np.array([[c, -s, 0], [s * d, c * d, e], [-s * e, -c * e, d]])
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) @ turn.T
    normal *= np.sign(normal[:, 2:]) / np.maximum(np.linalg.norm(normal, axis=1), 1e-30)[:, None]
    light = np.array([-0.4, 0.5, 0.8]) / np.linalg.norm([-0.4, 0.5, 0.8])
    return 0.45 + 0.55 * np.maximum(0, normal @ light)[:, None]
