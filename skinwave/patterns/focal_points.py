"""Focal points as CSV: tidy, `t_s,point,x_m,y_m,z_m,intensity`, or without a header,
`x,y[,z[,intensity]]` at a rate. Column names of other programs are known (`time`, `X (mm)`); the
default units are s and m.

Intensity, 0 to 1, is the sound pressure of a point relative to full drive; the radiation pressure
is its square. Several points become one path: the paths of all points in sequence, on which each
focus runs one part ahead of the previous one.
"""

import re
from math import isfinite

import numpy as np

from meshes import reading
from simple_model import Tacton, Trajectory, even_phases
from simple_model.choices import suggestion
from simple_model.load.tacton import LONGEST, MOST_FOCI
from skinwave.patterns.pattern import Options, Pattern, aliasing_notes, loudness, one_height
from skinwave.scene.scene import Scene
from skinwave.system.formats import PATTERN_READERS, PATTERN_WRITERS, register
from skinwave.system.plain_text import csv_table, number_in
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
LARGEST = 1e15  # of numbers in a file: also of timestamps in us


def read(content: bytes, options: Options, base: Scene) -> Pattern:
    """Read the pattern of a focal-point CSV."""
    rows = _rows(content)
    has_header = number_in(rows[0][1][0]) is None
    columns = _columns(rows[0][1]) if has_header else _columns_of_width(rows, options.rate)
    table = _table(rows[has_header:], columns)
    if not has_header and options.rate:
        table["t_s"] = np.arange(len(rows)) / options.rate
    notes: list[str] = []
    points, counts = np.unique(table["point"], return_counts=True)
    if len(points) > MOST_FOCI or (points != np.arange(len(points))).any():
        numbers = ", ".join(f"{p:g}" for p in points[:10])
        raise ValueError(
            f"points have the numbers {numbers}; count them from 0, at most {MOST_FOCI} points"
        )
    ordered = table[np.argsort(table["point"], kind="stable")]
    table = ordered.reshape(len(points), -1) if not np.ptp(counts) else ordered[None]
    times = table["t_s"] - table["t_s"][0, 0]
    if np.ptp(counts) or np.ptp(times, axis=0).max() > 1e-9:
        raise ValueError("the times of the points differ; give all points the same times")
    if (falling := np.diff(times[0]) < 0).any():
        raise ValueError(
            f"times decrease after t_s = {table['t_s'][0][falling.argmax()]:g}; sort them"
        )
    if not ((table["intensity"] >= 0) & (table["intensity"] <= 1)).all():
        raise ValueError(
            "intensity is the sound pressure relative to full drive; give values from 0 to 1"
        )
    if len(points) > 1:
        notes.append(
            f"{len(points)} points at a time, each with 1/{len(points)} of the full pressure"
        )
    if not has_header:
        notes.append(f"samples at {options.rate:g} Hz")
    elif options.rate is not None:
        notes.append("the file has times, so that --rate applies only to a file that is written")
    notes.append(f"the focus {'stays until the next sample' if options.hold else 'moves straight'}")
    height = one_height(table["z_m"].ravel(), options, notes)
    tacton = tacton_of(times[0], np.stack([table["x_m"], table["y_m"]], -1), table["intensity"],
                      hold=options.hold)  # fmt: skip
    return Pattern(
        tacton=tacton, pressure={"drive": "pressure_squared", **height}, notes=tuple(notes)
    )


def tacton_of(times: Floats, places: Floats, levels: Floats, *, hold: bool = False) -> Tacton:
    """Return a Tacton of foci at places (n, t, 2) in m with levels (n, t) at times (t,) in s.

    The last sample lasts as long as the previous one.
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
    return Tacton(duration=min(last, LONGEST), trajectory=path, foci=even_phases(n))


def write(scene: Scene, options: Options) -> tuple[bytes, tuple[str, ...]]:
    """Return a tidy CSV of a scene's foci at a rate, and notes."""
    rate = DEVICE_RATE if options.rate is None else options.rate
    if not (isfinite(rate) and 1 <= rate <= DEVICE_RATE):
        raise ValueError(f"--rate is {rate:g} Hz; devices take 1 to {DEVICE_RATE:g} Hz")
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
        "intensity is the sound pressure relative to full drive, the root of the load",
        *aliasing_notes(tacton, rate),
    )
    return csv_table(COLUMNS, rows, "\n"), notes


def _rows(content: bytes) -> list[tuple[int, list[str]]]:
    """Return line numbers and fields of the lines that are neither empty nor comments."""
    lines = reading.decode(content).splitlines()
    if len(lines) > MOST_ROWS:
        raise ValueError(f"the file has more than {MOST_ROWS:,} lines; shorten the pattern")
    kept = [(k, x) for k, x in enumerate(lines, 1) if x.strip(" ,;\t") and not x.startswith("#")]
    if not kept:
        raise ValueError("the file has no focal points; write one per line")
    delimiter = max(",;\t", key=kept[0][1].count)
    fields = ((k, line.replace('"', "").split(delimiter)) for k, line in kept)
    return [(k, [x.strip().replace(",", ".") for x in row]) for k, row in fields]


def _columns(words: list[str]) -> list[tuple[str, float]]:
    """Return name and unit (in s or m) of each column of a header."""
    columns = [_column(word) for word in words]
    names = [name for name, _ in columns]
    if len(set(names)) < len(names):
        raise ValueError(f"a column is repeated in {','.join(names)[:80]}; remove one")
    if missing := [name for name in NEEDED if name not in names]:
        raise ValueError(f"column {missing[0]} is missing; the columns are {','.join(COLUMNS)}")
    return columns


def _column(word: str) -> tuple[str, float]:
    """Return the name of a column and its unit in s or m, given a word of a header."""
    plain = re.sub(r"[\s_()\[\]]+", " ", word).strip().lower()
    for name, words in WORDS.items():
        units = UNITS.get(name, UNITS["lengths"] if name.endswith("_m") else {})
        if match := re.fullmatch(rf"({words})(?: ({'|'.join(units)}))?", plain):
            return name, units.get(match[2], 1.0)
    hint = suggestion(word, COLUMNS) or f"; the columns are {','.join(COLUMNS)}"
    raise ValueError(f"column '{word[:40]}' is unknown{hint}")


def _columns_of_width(
    rows: list[tuple[int, list[str]]], rate: float | None
) -> list[tuple[str, float]]:
    """Return the columns of a file without a header."""
    width = len(rows[0][1])
    if rate is None or not 2 <= width <= 4:
        raise ValueError(
            f"the file has no header; begin it with columns of {','.join(COLUMNS)}, or write only "
            "x,y[,z[,intensity]] and give the samples per second with --rate HZ"
        )
    if not 1 / LARGEST < rate < LARGEST:
        raise ValueError(f"--rate is {rate} Hz; give a number of samples per second, such as 1000")
    return [(name, 1.0) for name in ("x_m", "y_m", "z_m", "intensity")[:width]]


def _table(rows: list[tuple[int, list[str]]], columns: list[tuple[str, float]]) -> np.ndarray:
    if not rows:
        raise ValueError("the file has a header, but no focal points; write one per line")
    table = np.zeros(len(rows), [(name, float) for name in COLUMNS])
    table["intensity"] = 1.0
    values = np.array([_numbers(line, cells, len(columns)) for line, cells in rows])
    for (name, unit), column in zip(columns, values.T, strict=True):
        table[name] = unit * column
    return table


def _numbers(line: int, cells: list[str], count: int) -> list[float]:
    if len(cells) != count:
        raise ValueError(
            f"line {line} has {len(cells)} columns, but the first has {count}; correct it"
        )
    values = [x for cell in cells if (x := number_in(cell)) is not None and abs(x) < LARGEST]
    if len(values) < count:
        raise ValueError(
            f"line {line}, '{','.join(cells)[:60]}', must contain only numbers below {LARGEST:g}"
        )
    return values


register(PATTERN_READERS, ".csv", function=read, largest=128_000_000)
register(PATTERN_WRITERS, ".csv", function=write)
