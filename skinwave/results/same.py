"""Whether two result folders hold the same waveforms and lines."""

import csv
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from meshes import reading
from skinwave.results import record
from skinwave.system.plain_text import number_in

LINES = "lines.csv"
LARGEST_CSV = 64_000_000  # bytes
WRITTEN = 1.1e-5  # of a number in lines.csv, whose six digits may differ by one in the last


@dataclass(frozen=True, kw_only=True)
class Difference:
    """One difference, in words, and its size over the largest there; infinite if not in number."""

    words: str
    size: float = np.inf


def differences(first: Path, second: Path, rtol: float) -> list[Difference]:
    """Differences of more than `rtol` of the largest value of an array or a column, worst first.

    Raises
    ------
    ValueError
        If rtol is no number from 0 on, or a folder holds no result or a file that cannot be read.
    """
    if not 0 <= rtol < np.inf:
        raise ValueError(f"rtol = {rtol} must be a finite number from 0 on")
    files = [_files(folder) for folder in (first, second)]
    found = []
    for name in sorted({*files[0], *files[1]}):
        missing = next((f for f, has in zip((first, second), files, strict=True)
                        if name not in has), None)  # fmt: skip
        if missing:
            found.append(Difference(words=f"{missing} has no {name}"))
        elif name.endswith(LINES):
            found += _lines(name, files[0][name], files[1][name], rtol)
        else:
            found += _arrays(name, files[0][name], files[1][name], rtol)
    return sorted(found, key=lambda one: -one.size)


def _files(folder: Path) -> dict[str, Path]:
    """Files that are compared, by their place in a folder and today's name."""
    found = {}
    for below in (folder, *(path for path in sorted(folder.rglob("*")) if path.is_dir())):
        here = below.relative_to(folder)
        if waveforms := record.responses(below):
            found[str(here / record.RESPONSES[0])] = waveforms
        if (below / LINES).is_file():
            found[str(here / LINES)] = below / LINES
    if not found:
        raise ValueError(
            f"{folder} holds no {record.RESPONSES[0]}; name a folder that run, compare or report "
            "wrote"
        )
    return found


def _arrays(name: str, first: Path, second: Path, rtol: float) -> Iterator[Difference]:
    a, b = _loaded(first), _loaded(second)
    for array in sorted({*a, *b}):
        where = f"{name}, '{array}'"
        if array not in a or array not in b:
            yield Difference(words=f"{where} is in one of them only")
        elif a[array].shape != b[array].shape:
            yield Difference(
                words=f"{where} has shape {a[array].shape} in one and {b[array].shape} in the other"
            )
        else:
            yield from _worst(where, a[array], b[array], rtol)


def _worst(where: str, a: NDArray, b: NDArray, rtol: float) -> Iterator[Difference]:
    apart, largest = np.abs(a - b), max(np.abs(a).max(initial=0), np.abs(b).max(initial=0))
    if not apart.size or not apart.max() > rtol * largest:
        return
    at = tuple(int(k) for k in np.unravel_index(np.argmax(apart), apart.shape))
    yield _by(f"{where} at {list(at)}", float(a[at]), float(b[at]), float(largest), rtol)


def _by(where: str, a: float, b: float, largest: float, rtol: float) -> Difference:
    size = abs(a - b) / largest
    return Difference(
        words=f"{where} is {a:.10g} and {b:.10g}, apart by {size:.2g} of the largest there "
        f"(limit {rtol:g})",
        size=size,
    )


def _loaded(path: Path) -> dict[str, NDArray]:
    arrays = reading.arrays(path)
    for name, array in arrays.items():
        if array.dtype.kind not in "fiu" or not np.isfinite(array).all():
            raise ValueError(f"{path} holds '{name}', which is not finite numbers; make it anew")
    return arrays


def _lines(name: str, first: Path, second: Path, rtol: float) -> Iterator[Difference]:
    a, b = _rows(first), _rows(second)
    if [*map(list, a)] != [*map(list, b)]:
        yield Difference(words=f"{name} has {len(a)} rows in one and {len(b)} in the other, or "
                               "other columns")  # fmt: skip
        return
    largest: dict[str, float] = {}
    for row in (*a, *b):
        for column, cell in row.items():
            if (value := number_in(cell)) is not None:
                largest[column] = max(largest.get(column, 0.0), abs(value))
    for k, (one, other) in enumerate(zip(a, b, strict=True)):
        yield from _cells(f"{name}, row {k + 1}", one, other, largest, rtol)


def _rows(path: Path) -> list[dict[str, str]]:
    try:
        rows = [*csv.DictReader(reading.text(path, LARGEST_CSV).splitlines())]
    except csv.Error as error:
        raise ValueError(f"{path} is no CSV ({error}); make the result anew") from None
    if any(None in row or None in row.values() for row in rows):
        raise ValueError(f"{path} has rows of unequal length; make the result anew")
    return rows


def _cells(
    where: str,
    one: Mapping[str, str],
    other: Mapping[str, str],
    largest: Mapping[str, float],
    rtol: float,
) -> Iterator[Difference]:
    for column, cell in one.items():
        x, y = number_in(cell), number_in(other[column])
        if x is None or y is None:
            if cell != other[column]:
                yield Difference(words=f"{where}, {column} is '{cell}' and '{other[column]}'")
        elif abs(x - y) > rtol * largest[column] + WRITTEN * max(abs(x), abs(y)):
            yield _by(f"{where}, {column}", x, y, largest[column], rtol)
