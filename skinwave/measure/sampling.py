"""Even times of samples, and gaps of what was not measured."""

import numpy as np

from simple_model.typing import Floats
from skinwave.measure.measurement import UNEVEN

CLOCK = 1e8  # s: later times are counted from an epoch, and become those from the first
DIGITS = 7  # of times as programs round them
COARSEST = 0.25  # of a sampling interval: what rounding may leave
LARGEST_GAPS = 0.1  # of the samples
LARGEST_ERROR = 0.1  # of the RMS: what interpolation may be wrong by
TRIALS = 16  # places in a record at which it is tried
BESIDE = 8  # samples on both sides of each


def even(times: Floats) -> tuple[Floats, np.ndarray]:
    """Even times (n,) in s of rounded ones with missing rows, and the number (t,) of each.

    Times that are even within `UNEVEN` come back as they are.

    Raises
    ------
    ValueError
        If times fall or repeat, or are not even.
    """
    largest = float(np.abs(times).max(initial=0.0))
    if largest > CLOCK:
        times = times - times[0]
    steps = np.diff(times)
    index = np.arange(len(times))
    if not np.isfinite(times).all():
        raise ValueError("a time is missing or not finite; complete the times, or give --rate")
    if len(times) < 2:
        return times, index
    if not steps.min() > 0:
        raise ValueError(
            "times must rise, and some repeat or fall; sort them, or give --rate if they are "
            "rounded"
        )
    if np.abs(steps - steps.mean()).max() <= UNEVEN * steps.mean():
        return times, index
    step = float(np.median(steps))
    index = np.concatenate([[0], np.cumsum(np.rint(steps / step).astype(int))])
    step, start = np.polyfit(index, times, 1)
    away = float(np.abs(times - start - step * index).max())
    rounding = 0.51 * 10.0 ** (np.floor(np.log10(largest)) + 1 - DIGITS)
    if np.diff(index).min() < 1 or away > max(UNEVEN * step, min(rounding, COARSEST * step)):
        raise ValueError(
            f"times of a measurement must rise in equal steps, and theirs are {steps.min():g} to "
            f"{steps.max():g} s; sample it evenly, or give --rate"
        )
    if index[-1] + 1 - len(index) > LARGEST_GAPS * len(index):
        raise ValueError(
            f"{index[-1] + 1 - len(index)} rows are missing between {len(index)} in equal steps of "
            f"{step:g} s; measure again, or give the part without gaps"
        )
    full = start + step * np.arange(index[-1] + 1)
    if away <= UNEVEN * step:
        full[index] = times
    return full, index


def complete(values: Floats, index: np.ndarray, count: int) -> tuple[Floats, slice, list[str]]:
    """Values (..., t) at every sample, those that are missing or nan interpolated by cubic splines.

    Parameters
    ----------
    values : (..., t) float, nan where nothing was measured
    index : (t,) int, the sample of each
    count : n, of samples

    Returns
    -------
    values (..., m), the samples that these are, and sentences: samples at the start and the end at
    which a row has no value are cut off

    Raises
    ------
    ValueError
        If gaps are too long or too many to be interpolated.
    """
    full = np.full((*values.shape[:-1], count), np.nan)
    full[..., index] = values
    if np.isfinite(full).all():
        return full, slice(0, count), []
    rows = full.reshape(-1, count)
    gaps = np.isnan(rows)
    inside = ~np.logical_or.reduce(
        np.logical_and.accumulate(gaps, axis=1)
        | np.logical_and.accumulate(gaps[:, ::-1], axis=1)[:, ::-1]
    )
    kept = np.flatnonzero(inside)
    if len(kept) < (1 - LARGEST_GAPS) * count:
        raise ValueError(
            f"of {count} samples only {len(kept)} lie between the first and the last value of "
            "every place; give the part, or the --columns, with values"
        )
    part = slice(int(kept[0]), int(kept[-1]) + 1)
    rows, gaps = rows[:, part], gaps[:, part]
    said = []
    if cut := count - rows.shape[1]:
        said.append(f"{cut} samples at the start or the end without a value are left out")
    if gaps.any():
        worst = max(_fill(row, gap) for row, gap in zip(rows, gaps, strict=True) if gap.any())
        said.append(
            f"{int(gaps.any(axis=0).sum())} samples are missing and interpolated, with an error of "
            f"about {100 * worst:.2g} % of the RMS"
        )
    return rows.reshape(*values.shape[:-1], -1), part, said


def _fill(row: Floats, gap: np.ndarray) -> float:
    """Fill the gaps of a row; the error of gaps as long elsewhere, as a fraction of the RMS."""
    from scipy.interpolate import CubicSpline  # only where it is needed: it takes a while

    known = np.flatnonzero(~gap)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], gap, [False]]).astype(int)))
    longest = int((edges[1::2] - edges[::2]).max())
    width = longest + 2 * BESIDE
    free = np.flatnonzero(np.convolve(gap, np.ones(width), "valid") == 0)
    size = float(np.sqrt(np.mean((row[known] - row[known].mean()) ** 2)))
    error = np.inf
    if len(free) >= TRIALS and gap.sum() <= LARGEST_GAPS * len(row):
        wrong = []
        for first in free[np.linspace(0, len(free) - 1, TRIALS).astype(int)]:
            at, hidden = np.arange(first, first + width), slice(BESIDE, BESIDE + longest)
            shown = np.delete(at, np.arange(width)[hidden])
            wrong.append(CubicSpline(shown, row[shown])(at[hidden]) - row[at[hidden]])
        error = float(np.sqrt(np.mean(np.square(wrong)))) / size if size > 0 else 0.0
    if not error <= LARGEST_ERROR:
        raise ValueError(
            f"{int(gap.sum())} samples are missing, up to {longest} in a row, which is too long to "
            "interpolate; give the part without them, or leave out that place by --columns"
        )
    row[gap] = CubicSpline(known, row[known])(np.flatnonzero(gap))
    return error
