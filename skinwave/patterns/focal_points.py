"""Focal points as CSV: tidy, `t_s,point,x_m,y_m,z_m,intensity`, or without a header,
`x,y[,z[,intensity]]` at a rate. Column names of other programs are known (`time`, `X (mm)`); the
default units are s and m.

Intensity, 0 to 1, is the sound pressure of a point relative to full drive; the radiation pressure
is its square. Several points become one path: the paths of all points in sequence, on which each
focus runs one part ahead of the previous one.
"""

from functools import partial
from math import isfinite

import numpy as np

from meshes import reading
from simple_model import Tacton, Trajectory, even_phases
from simple_model.choices import suggestion
from simple_model.load.tacton import LONGEST, MOST_FOCI
from skinwave.patterns.pattern import Options, Pattern, aliasing_notes, loudness, one_height
from skinwave.scene.scene import Scene
from skinwave.system import units
from skinwave.system.formats import PATTERN_READERS, PATTERN_WRITERS, register
from skinwave.system.headings import parse_heading
from skinwave.system.plain_text import csv_table
from skinwave.system.text_table import Table, parse_table
from skinwave.typing import Floats

COLUMNS = {"t_s": "time", "point": "point", "x_m": "x", "y_m": "y", "z_m": "z",
           "intensity": "intensity"}  # fmt: skip
NAMES = {role: role for role in COLUMNS.values()} | {
    "t": "time", "timestamp": "time", "focus": "point", "id": "point", "index": "point",
    "amplitude": "intensity", "strength": "intensity",
}  # fmt: skip


def read(content: bytes, options: Options, base: Scene) -> Pattern:
    """Read the pattern of a focal-point CSV."""
    text = reading.decode(content)
    found = parse_table(text, ",".join(COLUMNS), partial(parse_heading, roles=NAMES))
    has_header = any(column.text for column in found.columns)
    table = _in_si(found, _names(found) if has_header else _names_of_width(found, options.rate))
    if not has_header and options.rate:
        table["time"] = np.arange(len(table)) / options.rate
    notes: list[str] = []
    points, counts = np.unique(table["point"], return_counts=True)
    if len(points) > MOST_FOCI or (points != np.arange(len(points))).any():
        numbers = ", ".join(f"{p:g}" for p in points[:10])
        raise ValueError(
            f"points have the numbers {numbers}; count them from 0, at most {MOST_FOCI} points"
        )
    ordered = table[np.argsort(table["point"], kind="stable")]
    table = ordered.reshape(len(points), -1) if not np.ptp(counts) else ordered[None]
    times = table["time"] - table["time"][0, 0]
    if np.ptp(counts) or np.ptp(times, axis=0).max() > 1e-9:
        raise ValueError("the times of the points differ; give all points the same times")
    if (falling := np.diff(times[0]) < 0).any():
        raise ValueError(
            f"times decrease after t_s = {table['time'][0][falling.argmax()]:g}; sort them"
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
    height = one_height(table["z"].ravel(), options, notes)
    tacton = tacton_of(times[0], np.stack([table["x"], table["y"]], -1), table["intensity"],
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
    fastest = 40_000.0  # Hz, of devices
    rate = fastest if options.rate is None else options.rate
    if not (isfinite(rate) and 1 <= rate <= fastest):
        raise ValueError(f"--rate is {rate:g} Hz; devices take 1 to {fastest:g} Hz")
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


def _names(table: Table) -> list[str]:
    """Return the names of the columns of a table with headings."""
    names = [column.role for column in table.columns]
    if "" in names:
        word = table.columns[names.index("")].text
        hint = suggestion(word, COLUMNS) or f"; the columns are {','.join(COLUMNS)}"
        raise ValueError(f"column '{word[:40]}' is unknown{hint}")
    if len(set(names)) < len(names):
        raise ValueError(f"a column is repeated in {','.join(names)[:80]}; remove one")
    if missing := [key for key in ("t_s", "x_m", "y_m") if COLUMNS[key] not in names]:
        raise ValueError(f"column {missing[0]} is missing; the columns are {','.join(COLUMNS)}")
    return names


def _names_of_width(table: Table, rate: float | None, largest: float = 1e15) -> list[str]:
    """Return the names of the columns of a table without headings."""
    width = len(table.columns)
    if rate is None or not 2 <= width <= 4:
        raise ValueError(
            f"the file has no header; begin it with columns of {','.join(COLUMNS)}, or write only "
            "x,y[,z[,intensity]] and give the samples per second with --rate HZ"
        )
    if not 1 / largest < rate < largest:
        raise ValueError(f"--rate is {rate} Hz; give a number of samples per second, such as 1000")
    return ["x", "y", "z", "intensity"][:width]


def _in_si(
    table: Table, names: list[str], most_rows: int = 1_000_000, largest: float = 1e15
) -> np.ndarray:
    """Return the columns of a table by name, in s and m if they have no unit.

    `largest` limits the numbers in a file, such as timestamps in us.
    """
    numbers = table.numbers
    if len(numbers) > most_rows:
        raise ValueError(f"the file has more than {most_rows:,} rows; shorten the pattern")
    wrong = ~(np.abs(numbers) < largest).all(axis=1) | np.iscomplex(numbers).any(axis=1)
    for row in np.flatnonzero(wrong)[:1]:
        raise ValueError(f"row {row + 1} must contain only numbers below {largest:g}")
    columns = np.zeros(len(numbers), [(name, float) for name in COLUMNS.values()])
    columns["intensity"] = 1.0
    for name, column, values in zip(names, table.columns, numbers.real.T, strict=True):
        dimension = {"time": "time", "x": "length", "y": "length", "z": "length"}.get(name)
        divisor = units.divisor(column.unit, dimension or "number") if column.unit else 1.0
        columns[name] = units.in_si(values, divisor)
    return columns


register(PATTERN_READERS, ".csv", function=read, largest=128_000_000)
register(PATTERN_WRITERS, ".csv", function=write)
