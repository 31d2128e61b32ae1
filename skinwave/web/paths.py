"""Paths of several foci of their own as text, such as "circle/20/-15/0, line/10/15/0": the shape,
its size and the x and y of its centre in mm, of each.
"""

from math import isfinite

import numpy as np

from meshes.tetmesh import Floats
from simple_model import SHAPES, Tacton, Trajectory, joined
from simple_model.choices import choose
from simple_model.joined import ROUND, parted
from simple_model.trajectory import LARGEST

REACH = 50e-3  # m: half the side of the area that is shown, which paths stay within
# mm: where the first of eight foci has its path, the second and so on, unless it is moved.
STARTS_AT = ((-20, 0), (20, 0), (0, 20), (0, -20), (-20, 20), (20, -20), (20, 20), (-20, -20))
CORNERS = {2: "point", 3: "line", 4: "triangle", 5: "square", ROUND + 1: "circle"}
CLOSE = 1e-8  # m and of a period, within which a recording is that of named shapes


def paths_of(text: str) -> tuple[Trajectory, ...]:
    """The path of each focus; none if it is empty.

    Raises
    ------
    ValueError
        If it is no such text, or a path is unknown, too large or beyond the area.
    """
    parts = filter(None, (part.strip() for part in text.split(",")))
    found = tuple(_path_of(number, part) for number, part in enumerate(parts, 1))
    if len(found) > len(STARTS_AT):
        raise ValueError(f"{len(found)} paths exceed {len(STARTS_AT)}, as many as there are foci")
    return found


def text_of(paths: tuple[Trajectory, ...]) -> str:
    """The text that `paths_of` reads."""
    return ", ".join(
        "/".join(
            [path.shape, *(f"{round(1e3 * v, 6) + 0.0:.10g}" for v in (path.size, *path.centre))]
        )
        for path in paths
    )


def fitted(text: str, n: int) -> str:
    """The text with as many paths as there are foci: those at its end are left out, and what is
    missing is like the last.
    """
    kept = [part.strip() for part in text.split(",") if part.strip()][:n]
    like = kept[-1].split("/")[:2]
    more = ["/".join([*like, f"{x:g}", f"{y:g}"]) for x, y in STARTS_AT[len(kept) : n]]
    return ", ".join(kept + more)


def paths_in(tacton: Tacton) -> tuple[Trajectory, ...]:
    """The named shapes that a Tacton's recording joins; none if it is another."""
    path, n = tacton.trajectory, tacton.n_paths
    if path.shape != "recorded" or path.levels or path.hold or n != len(tacton.foci):
        return ()
    parts = parted(path, n)
    if any(len(part) not in CORNERS for part in parts):
        return ()
    try:
        paths = tuple(map(_shape_of, parts))
        same = joined(paths, tacton.drawing_frequency)
    except ValueError:
        return ()
    near = len(same.times) == len(path.times) and (
        np.allclose(same.outline, path.outline, rtol=0, atol=CLOSE)
        and np.allclose(same.times, path.times, rtol=0, atol=CLOSE * path.times[-1])
    )
    return paths if near else ()


def _path_of(number: int, part: str) -> Trajectory:
    try:
        shape, *numbers = part.split("/")
        size, x, y = (float(value) / 1e3 for value in numbers)
    except ValueError:
        raise ValueError(
            f"path {number}: '{part}' is none; give shape/size/x/y in mm, such as circle/20/-15/0"
        ) from None
    choose("shape", shape, SHAPES)
    if not 0 <= size <= LARGEST:
        raise ValueError(f"path {number}: {1e3 * size:g} mm is outside 0 to {1e3 * LARGEST:g} mm")
    if not (isfinite(x) and isfinite(y)):
        raise ValueError(f"path {number}: its centre must be finite")
    path = Trajectory(shape=shape, size=0.0 if shape == "point" else size, centre=(x, y))
    if (furthest := np.abs(path.outline).max()) > REACH * (1 + 1e-9):
        raise ValueError(
            f"path {number} reaches to {1e3 * furthest:.3g} mm, beyond the {1e3 * REACH:g} mm of "
            "the area; move or shrink it"
        )
    return path


def _shape_of(corners: Floats) -> Trajectory:
    """The named shape that has these corners (k, 2) in metre, the first of them again at its end;
    some shape, if none has.
    """
    shape = CORNERS[len(corners)]
    x, y = corners[:-1].mean(axis=0)
    side = float(np.linalg.norm(corners[1] - corners[0]))
    sizes = {"point": 0.0, "circle": 2 * float(np.hypot(*(corners[0] - [x, y])))}
    centre = (round(float(x), 9), round(float(y), 9))
    return Trajectory(shape=shape, size=round(sizes.get(shape, side), 9), centre=centre)
