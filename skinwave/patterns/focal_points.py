"""Focal points as CSV: tidy, `t_s,point,x_m,y_m,z_m,intensity`, or bare `x,y[,z[,intensity]]` at a
rate. Other programs' words for a column are known (`time`, `X (mm)`); without a unit it is s or m.

Intensity is the sound pressure of a point over that at full drive, 0..1; the radiation pressure is
its square. Several points are foci on paths of their own: their paths one after the other are a
path, on which each focus runs one part ahead of the one before.
"""

import re
from math import isfinite

import numpy as np

from simple_model import Tacton, Trajectory, evenly
from simple_model.choices import meant
from simple_model.load.tacton import LONGEST, MOST_FOCI
from skinwave.patterns.pattern import Options, Pattern, aliased, loudness, one_height
from skinwave.scene.scene import Scene
from skinwave.system.plain_text import as_utf_8, csv_table, number_in
from skinwave.typing import Floats

COLUMNS = ("t_s", "point", "x_m", "y_m", "z_m", "intensity")
NEEDED = ("t_s", "x_m", "y_m")
WORDS = {
    "t_s": "t|time|timestamp", "point": "point|focus|id|index", "x_m": "x", "y_m": "y", "z_m": "z",
    "intensity": "intensity|amplitude|strength",
}  # fmt: skip
UNITS = {"t_s": {"s": 1.0, "ms": 1e-3, "us": 1e-6}, "lengths": {"m": 1.0, "cm": 1e-2, "mm": 1e-3}}
DEVICE_RATE = 40_000.0  # Hz
MOST_ROWS = 1_000_000


def read(content: bytes, options: Options) -> Pattern:
    """The pattern in a focal-point CSV; raises a ValueError with the line and the cure."""
    rows = _rows(content)
    tidy = number_in(rows[0][1][0]) is None
    table = _table(rows[1:], _columns(rows[0][1])) if tidy else _bare(rows, options.rate)
    notes: list[str] = []
    points, counts = np.unique(table["point"], return_counts=True)
    if len(points) > MOST_FOCI or (points != np.arange(len(points))).any():
        shown = ", ".join(f"{p:g}" for p in points[:10])
        raise ValueError(f"points are numbered {shown}; number them from 0 to {MOST_FOCI - 1}")
    ordered = table[np.argsort(table["point"], kind="stable")]
    table = ordered.reshape(len(points), -1) if not np.ptp(counts) else ordered[None]
    times = table["t_s"] - table["t_s"][0, 0]
    if np.ptp(counts) or np.ptp(times, axis=0).max() > 1e-9:
        raise ValueError("points have different times; give each the same")
    if (falling := np.diff(times[0]) < 0).any():
        raise ValueError(f"times fall after t_s = {table['t_s'][0][falling.argmax()]:g}; sort them")
    if not ((table["intensity"] >= 0) & (table["intensity"] <= 1)).all():
        raise ValueError("intensity must lie in 0..1, the sound pressure over that at full drive")
    if len(points) > 1:
        notes.append(
            f"{len(points)} points at a time: each has 1/{len(points)} of the pressure of one alone"
        )
    if not tidy:
        notes.append(f"samples at {options.rate:g} Hz")
    elif options.rate is not None:
        notes.append("the times of the file stay; --rate is that of a file to be written")
    way = "stays at a sample until the next" if options.hold else "goes straight between samples"
    notes.append(f"the focus {way}")
    height = one_height(table["z_m"].ravel(), options, notes)
    tacton = recorded(times[0], np.stack([table["x_m"], table["y_m"]], -1), table["intensity"],
                      hold=options.hold)  # fmt: skip
    return Pattern(
        tacton=tacton, pressure={"drive": "pressure_squared", **height}, notes=tuple(notes)
    )


def recorded(times: Floats, places: Floats, levels: Floats, *, hold: bool = False) -> Tacton:
    """A Tacton of foci at places (n, t, 2) in metre with levels (n, t) at times (t,) in s from 0.

    The last sample lasts as long as the one before it.
    """
    n, count = levels.shape
    if np.ptp(places, axis=(0, 1)).max() == 0 and np.ptp(levels) == 0 and n == 1:
        duration = times[-1] + (times[-1] - times[-2]) if count > 1 else 1.0
        centre = (float(places[0, 0, 0]), float(places[0, 0, 1]))
        return Tacton(
            amplitude=float(levels[0, 0]), duration=duration, trajectory=Trajectory(centre=centre)
        )
    if count < 2:
        times, places, levels = np.array([0.0, 1.0]), *(
            np.repeat(x, 2, axis=1) for x in (places, levels)
        )  # fmt: skip
    with np.errstate(over="ignore"):
        last = times[-1] + (times[-1] - times[-2])
    if not 0 < last <= LONGEST * (1 + 1e-9):
        raise ValueError(f"the points last {last:g} s, outside 0..{LONGEST:g} s; cut them")
    clock = np.concatenate([j * last + np.append(times, last) for j in range(n)])
    held = [np.concatenate([x, x[:, -1:]], axis=1) for x in (places, levels)]
    path = Trajectory(
        shape="recorded",
        points=tuple(map(tuple, held[0].reshape(-1, 2).tolist())),
        times=tuple(clock.tolist()),
        levels=tuple(held[1].ravel().tolist()),
        hold=hold,
    )
    return Tacton(duration=min(last, LONGEST), trajectory=path, foci=evenly(n))


def write(scene: Scene, options: Options) -> tuple[bytes, tuple[str, ...]]:
    """Tidy CSV of a scene's foci at a rate, and notes."""
    rate = options.rate or DEVICE_RATE
    if not (isfinite(rate) and 1 <= rate <= DEVICE_RATE):
        raise ValueError(f"rate = {rate:g} Hz is outside 1..{DEVICE_RATE:g} Hz of devices")
    tacton, path = scene.tacton, scene.tacton.trajectory
    t = np.arange(max(2, round(tacton.duration * rate))) / rate
    amplitude = loudness(scene.pressure, t)
    phases = [np.mod(path.phase(t) + ahead, 1.0) for ahead in tacton.foci]
    places = [path.at_phase(phase).tolist() for phase in phases]
    levels = [(amplitude * np.sqrt(scene.pressure.weight(phase))).tolist() for phase in phases]
    rows = (
        (time, point, *places[point][k], scene.pressure.height, levels[point][k])
        for k, time in enumerate(t.tolist())
        for point in range(len(phases))
    )
    notes = (
        f"{len(t):,} samples of {len(tacton.foci)} focal points at {rate:g} Hz",
        "intensity is the sound pressure over that at full drive: the root of the load",
        *aliased(tacton, rate),
    )
    return csv_table(COLUMNS, rows, "\n"), notes


def _rows(content: bytes) -> list[tuple[int, list[str]]]:
    """Line numbers and fields of the lines that are neither empty nor comments."""
    lines = as_utf_8(content).splitlines()
    if len(lines) > MOST_ROWS:
        raise ValueError(f"more than {MOST_ROWS:,} lines; cut the pattern")
    kept = [(k, x) for k, x in enumerate(lines, 1) if x.strip(" ,;\t") and not x.startswith("#")]
    if not kept:
        raise ValueError("no focal points; give a line each")
    delimiter = max(",;\t", key=kept[0][1].count)
    fields = ((k, line.replace('"', "").split(delimiter)) for k, line in kept)
    return [(k, [x.strip().replace(",", ".") for x in row]) for k, row in fields]


def _columns(words: list[str]) -> list[tuple[str, float]]:
    """Names of columns by the words of a header, and their units in s or m."""
    columns = [_column(word) for word in words]
    names = [name for name, _ in columns]
    if len(set(names)) < len(names):
        raise ValueError(f"a column is there twice in {','.join(names)[:80]}; leave one out")
    if missing := [name for name in NEEDED if name not in names]:
        raise ValueError(f"column {missing[0]} is missing; columns are {','.join(COLUMNS)}")
    return columns


def _column(word: str) -> tuple[str, float]:
    """Name of a column by a word of a header, and its unit in s or m."""
    plain = re.sub(r"[\s_()\[\]]+", " ", word).strip().lower()
    for name, words in WORDS.items():
        units = UNITS.get(name, UNITS["lengths"] if name.endswith("_m") else {})
        if found := re.fullmatch(rf"({words})(?: ({'|'.join(units)}))?", plain):
            return name, units.get(found[2], 1.0)
    hint = meant(word, COLUMNS) or f"; columns are {','.join(COLUMNS)}"
    raise ValueError(f"column '{word[:40]}' is unknown{hint}")


def _bare(rows: list[tuple[int, list[str]]], rate: float | None) -> np.ndarray:
    width = len(rows[0][1])
    if rate is None or not 2 <= width <= 4:
        raise ValueError(
            f"the file has no header; begin it with {','.join(COLUMNS)} or those that it has, or "
            "give x,y[,z[,intensity]] alone, and how many samples a second with --rate HZ"
        )
    if not (isfinite(rate) and rate > 0):
        raise ValueError(f"rate = {rate} Hz must be a finite number above 0")
    table = _table(rows, [(name, 1.0) for name in ("x_m", "y_m", "z_m", "intensity")[:width]])
    table["t_s"] = np.arange(len(rows)) / rate
    return table


def _table(rows: list[tuple[int, list[str]]], columns: list[tuple[str, float]]) -> np.ndarray:
    if not rows:
        raise ValueError("a header without focal points; give a line each")
    table = np.zeros(len(rows), [(name, float) for name in COLUMNS])
    table["intensity"] = 1.0
    values = np.array([_numbers(line, cells, len(columns)) for line, cells in rows])
    for (name, unit), column in zip(columns, values.T, strict=True):
        table[name] = unit * column
    return table


def _numbers(line: int, cells: list[str], count: int) -> list[float]:
    if len(cells) != count:
        raise ValueError(f"line {line} has {len(cells)} columns, the first has {count}")
    values = [x for cell in cells if (x := number_in(cell)) is not None and isfinite(x)]
    if len(values) < count:
        raise ValueError(f"line {line} has what is no finite number in '{','.join(cells)[:60]}'")
    return values
