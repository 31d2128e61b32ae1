"""Response at the probes, as every model returns it, and its spectral lines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from simple_model import drawing
from simple_model.load.line_names import FEWEST_CYCLES, SAME_LINE, line_names
from simple_model.load.pressure import MovingPressure
from simple_model.load.sampling import step
from simple_model.load.tacton import exact_period, repetition_frequencies
from simple_model.numbers import plural, significant
from simple_model.quantities import DISPLACEMENT, PRESSURE, NotApplicable, Quantity, quantity
from simple_model.spectra import Lines, Spectrum, cosines
from simple_model.statement import Statement
from simple_model.typing import Bools, Complex, Floats, Ints

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SETTLE = 0.25  # of a response, left out at its start when lines are fitted
LINE_BINS = 2.5  # bins between lines that the Kaiser window resolves
ALIKE = 1e-3  # of the frequency resolution: closer lines are one
MINOR = 0.05  # of a line: most that unresolved neighbours may have together
UNEVEN = 1e-6  # of a sampling interval: largest deviation of equal steps


@dataclass(frozen=True, kw_only=True)
class Effort:
    """Cost of a response, and how it was computed.

    `seconds` by phase; `cells` of the whole mesh, also if a half is modelled; `dofs` and number of
    `steps` or lines that were solved; `peak_memory` in bytes; element size `h` in m and time step
    `dt` in s, 0 if there is none; SHA-256 of the `mesh`; `solver`; `estimate` of the relative error
    of the reduction; relative `energy_imbalance`; share of the losses that was `radiated` through
    absorbing boundaries; `versions` of the software; `errors`, the statement of the expected error;
    `warnings`, distinct sentences on the limits of the result.
    """

    seconds: Mapping[str, float] = field(default_factory=dict)
    cells: int = 0
    dofs: int = 0
    steps: int = 0
    reduced_dofs: int = 0
    factorisations: int = 0
    peak_memory: int = 0
    h: float = 0.0
    dt: float = 0.0
    mesh: str = ""
    solver: str = "none"
    estimate: float = 0.0
    energy_imbalance: float = 0.0
    radiated: float = 0.0
    versions: Mapping[str, str] = field(default_factory=dict)
    errors: Statement = field(default_factory=Statement)
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "warnings", tuple(dict.fromkeys(self.warnings)))  # once each


@dataclass(frozen=True, kw_only=True, eq=False)
class Response:
    """Response of a model: a quantity at the probes.

    Parameters
    ----------
    model : str, name of the model
    times : (t,) float, s, equally spaced
    probes : (p, 2) float, m
    values : (t, p) float, in the unit of the quantity
    quantity : a name in `quantities.QUANTITIES`; normal motion is positive into the body
    effort : Effort
    load : MovingPressure that defines the `lines`; None if unknown

    The arrays are copied and read-only. Raises a ValueError if shapes do not fit, if a number is
    not finite, if times are not equally spaced, or if the quantity is unknown.

    >>> times = np.arange(1000) / 1e4
    >>> x = 1e-6 * np.sin(2 * np.pi * 140 * times)
    >>> response = Response(model="made", times=times, probes=[[0.0, 0.0]], values=x[:, None])
    >>> response
    <Response of made: displacement into the body (1,000 times, 1 probe) from 0 to 99.9 ms, ...>
    """

    model: str
    times: Floats
    probes: Floats
    values: Floats
    quantity: str = DISPLACEMENT.name
    effort: Effort = field(default_factory=Effort)
    load: MovingPressure | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        for name in ("times", "probes", "values"):
            array = np.array(getattr(self, name), np.float64)
            if not np.isfinite(array).all():
                raise ValueError(f"{name} of a response must be finite; remove nan and inf")
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        quantity(self.quantity)  # refuses an unknown one
        _check_shapes(self.times, self.probes, self.values)

    @property
    def record(self) -> Quantity:
        """The record of its quantity."""
        return quantity(self.quantity)

    @property
    def expected_error(self) -> float:
        """Expected relative error of the worst probe's waveform; inf if unknown."""
        return self.effort.errors.error

    @property
    def unit(self) -> str:
        """The SI unit of its values."""
        return self.record.unit

    @property
    def displacement(self) -> Floats:
        """Values (t, p) of a normal displacement or a pressure; raises a ValueError for others."""
        if self.record not in (DISPLACEMENT, PRESSURE):
            raise NotApplicable(f"this is a response of {self.quantity}; use its `values`")
        return self.values

    @property
    def lines(self) -> Lines:
        """Resolved lines of its load by name; raises a ValueError if the load is unknown."""
        if self.load is None:
            raise NotApplicable(
                "the load of this response is unknown, so its lines have no names; use "
                "simple_model.phasors(response, frequencies)"
            )
        named = line_names(self.load)
        named = named.some(named.frequencies < 0.5 / step(self.times))
        named = named.some(are_resolved(self, named.frequencies, strengths=named.strengths))
        return Lines(
            names=named.names, frequencies=named.frequencies, probes=self.probes,
            amplitudes=phasors(self, named.frequencies), quantity=self.quantity,
        )  # fmt: skip

    def spectrum(self, window: str = "hann") -> Spectrum:
        """Amplitude spectrum at every probe, see the function `spectrum`."""
        frequencies, amplitudes = spectrum(self, window)
        return Spectrum(
            frequencies=frequencies, amplitudes=amplitudes, probes=self.probes,
            quantity=self.quantity,
        )  # fmt: skip

    def plot(self, probes: Sequence[int] | None = None, *, ax: Axes | None = None) -> Axes:
        """Draw the waveforms of all probes, or of probes by index. Return the axes."""
        chosen = slice(None) if probes is None else list(probes)
        ax = drawing.new_axes(ax)
        values = self.record.per_unit * self.values[:, chosen]
        drawing.curves(ax, 1e3 * self.times, values, self.probes[chosen])
        ax.margins(x=0)
        ax.set_xlabel("time, ms")
        ax.set_ylabel(f"{self.record.words}, {self.record.shown}")
        return ax

    def to_dataframe(self) -> pd.DataFrame:
        """Return the values as a data frame of pandas: rows by time_s, columns by x_m and y_m of
        the probes. Its `attrs` are those of `to_xarray`.
        """
        names = [f"{axis}_m" for axis in "xyz"[: self.probes.shape[1]]]
        pandas = library("pandas")
        frame = pandas.DataFrame(
            self.values.copy(),
            index=pandas.Index(self.times.copy(), name="time_s"),
            columns=pandas.MultiIndex.from_arrays(self.probes.T.copy(), names=names),
        )
        frame.attrs = self._attributes
        return frame

    def to_xarray(self) -> xr.DataArray:
        """Return the values as an array of xarray with dimensions time and probe.

        Coordinates are the time in s, and x and y of the probes in m. The attributes are units,
        long_name, quantity, model, expected_error (inf if unknown) and warnings, one on each line.
        All are text or numbers, so that `to_netcdf` writes them.
        """
        columns = zip("xyz", self.probes.T.copy(), strict=False)
        coords = {axis: ("probe", at, {"units": "m"}) for axis, at in columns}
        time = ("time", self.times.copy(), {"units": "s"})
        return library("xarray").DataArray(
            self.values.copy(), {"time": time, **coords}, ("time", "probe"), self.quantity,
            self._attributes,
        )  # fmt: skip

    @property
    def _attributes(self) -> dict[str, Any]:
        return {
            "units": self.unit, "long_name": self.record.words, "quantity": self.quantity,
            "model": self.model, "expected_error": self.expected_error,
            "warnings": "\n".join(self.effort.warnings),
        }  # fmt: skip

    def __repr__(self) -> str:
        record, times = self.record, self.times
        largest = record.per_unit * float(np.abs(self.values).max(initial=0.0))
        size = f"{plural(len(times), 'time')}, {plural(len(self.probes), 'probe')}"
        parts = [
            f"{record.words} ({size}) from {1e3 * times[0]:g} to {1e3 * times[-1]:.5g} ms, at most "
            f"{significant(largest)} {record.shown}",
            f"expected error {self.effort.errors.words}",
            plural(len(self.effort.warnings), "warning"),
        ]
        return f"<Response of {self.model}: {'; '.join(parts)}>"

    def _repr_html_(self) -> str:
        """A small page: the waveforms of the last 30 ms and the spectrum."""

        def draw(figure: Figure) -> None:
            left, right = figure.subplots(1, 2)
            start, end = 1e3 * self.times[[0, -1]]
            self.plot(ax=left).set_xlim(max(start, end - 30), end)
            self.spectrum().plot(ax=right)
            if legend := right.get_legend():  # the same as that on the left
                legend.remove()

        image = drawing.picture(draw, 8, 2.6) if len(self.times) > 1 else b""
        return drawing.page(repr(self).strip("<>"), image, (), self.effort.warnings)


def library(name: str) -> Any:
    """Import an optional library; raises an ImportError that says how to install it."""
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name:
            raise
        raise ImportError(f"{name} is not installed; pip install {name}", name=name) from None


def _check_shapes(times: Floats, probes: Floats, values: Floats) -> None:
    """Refuse times (t,), probes (p, 2 or 3) and values (t, p) of wrong shapes, and uneven times."""
    if times.ndim != 1 or not len(times):
        raise ValueError(f"times of a response have shape {times.shape}; give (t,) in s")
    if probes.ndim != 2 or probes.shape[1] not in (2, 3):
        raise ValueError(f"probes of a response have shape {probes.shape}; give (p, 2) or (p, 3)")
    if values.shape != (expected := (len(times), len(probes))):
        raise ValueError(f"values of a response have shape {values.shape}; give {expected}")
    steps = np.diff(times)
    mean = steps.mean() if len(steps) else 1.0
    if not (mean > 0 and np.abs(steps - mean).max(initial=0.0) <= UNEVEN * mean):
        raise ValueError(
            f"times of a response must rise in equal steps, but the steps are {steps.min():g} to "
            f"{steps.max():g} s; give equally spaced times"
        )


def spectrum(response: Response, window: str = "hann") -> tuple[Floats, Floats]:
    """Compute the amplitude spectrum: frequencies (f,) in Hz and amplitudes (f, p) in the unit of
    the response.

    A sinusoid of amplitude a on a bin has the value a with every window of `spectra.COSINES`.

    >>> times = np.arange(1000) / 1e4
    >>> x = 1e-6 * np.sin(2 * np.pi * 140 * times)
    >>> response = Response(model="made", times=times, probes=[[0.0, 0.0]], values=x[:, None])
    >>> frequencies, amplitudes = spectrum(response)
    >>> float(frequencies[amplitudes[:, 0].argmax()])  # Hz
    140.0
    """
    amplitude = windowed_amplitude(response.values, window)
    amplitude[0] /= 2
    return np.asarray(np.fft.rfftfreq(len(response.times), step(response.times))), amplitude


def windowed_amplitude(x: Floats, window: str) -> Floats:
    """Amplitudes (f, p) of the windowed spectrum of signals (t, p), twice the mean at 0 Hz."""
    weights = cosines(window, len(x))[:, None]
    return np.asarray(2 * np.abs(np.fft.rfft(x * weights, axis=0)) / weights.sum())


def lines(response: Response, frequencies: ArrayLike, *, settle: float = SETTLE) -> Floats:
    """Compute line amplitudes (f, p) in the unit of the response: the moduli of `phasors`, which
    has the same arguments.

    >>> times = np.arange(1000) / 1e4
    >>> x = 1e-6 * np.sin(2 * np.pi * 140 * times)
    >>> response = Response(model="made", times=times, probes=[[0.0, 0.0]], values=x[:, None])
    >>> lines(response, [140.0, 280.0]).round(9)  # m
    array([[1.e-06],
           [0.e+00]])
    """
    return np.abs(phasors(response, frequencies, settle=settle))


def phasors(response: Response, frequencies: ArrayLike, *, settle: float = SETTLE) -> Complex:
    """Compute phasors (f, p): complex amplitudes a of Re a exp(2 pi i f t), in the unit of the
    response, by weighted least squares.

    All lines and the mean are fitted together under a Kaiser window, which suppresses leakage from
    other lines and from a transient that decays. Lines closer than one over the fitted time are
    unresolved and share one amplitude, see `are_resolved`. Frequencies (f,) in Hz are below half
    the sampling rate; 0 gives the mean. The fraction `settle` of the response is left out at its
    start. Raises a ValueError for other frequencies, or a response of too few samples.
    """
    return fit_lines(response, frequencies, settle=settle)[0]


def resolution(response: Response, *, settle: float = SETTLE) -> float:
    """Frequency resolution in Hz, one over the fitted time: lines further apart are resolved."""
    whole = whole_periods(response, settle)
    return (1 - ALIKE) / whole if whole else 1 / float((1 - settle) * np.ptp(response.times))


def whole_periods(response: Response, settle: float = SETTLE) -> float:
    """Return the time in s of the whole periods of a load at the end of its response.

    It is 0 unless a rhythm or a signal repeats too few times for the Kaiser window. Over whole
    periods all lines of the load are orthogonal, without a window.
    """
    load, seconds = response.load, step(response.times) * len(response.times)
    if load is None or not load.tacton.is_sampled:
        return 0.0
    kept = (1 - settle) * seconds
    if min(repetition_frequencies(load.tacton).values()) * kept >= LINE_BINS:
        return 0.0
    period = exact_period(load.tacton)
    return period * int(kept / period * (1 + ALIKE)) if period else 0.0


def are_resolved(
    response: Response,
    frequencies: ArrayLike,
    *,
    settle: float = SETTLE,
    strengths: ArrayLike | None = None,
) -> Bools:
    """Return which lines (f,) of frequencies (f,) in Hz are resolved from 0 Hz and from each other.

    Near a resolved line, other lines and leakage of unresolved ones have at most 5 % of its
    strength. Strengths (f,) may have any unit and are equal if not given. Frequencies that differ
    by at most 0.1 % of the resolution are one line. `settle` is that of `phasors`.
    """
    frequencies = np.atleast_1d(np.asarray(frequencies, np.float64))
    strengths = np.ones_like(frequencies) if strengths is None else np.asarray(strengths)
    resolved = is_separate(frequencies, strengths, resolution(response, settle=settle))
    while True:
        rest = np.where(resolved, 0.0, strengths)
        masked = is_masked(response, frequencies, strengths, rest, resolved, settle=settle)
        if not (resolved & masked).any():
            return resolved
        resolved &= ~masked


def is_separate(frequencies: Floats, strengths: Floats, least: float) -> Bools:
    """Return a mask (f,) of lines whose neighbours within `least` Hz, including the mean, have at
    most 5 % of their strength.
    """
    away = np.abs(frequencies[:, None] - frequencies)
    near, alike = away < least, away <= ALIKE * least
    mixed = (near & ~alike) @ strengths > MINOR * (alike @ strengths)
    return ~mixed & ((frequencies < 1e-9) | (frequencies >= least))


def is_masked(
    response: Response,
    frequencies: Floats,
    strengths: Floats,
    rest: Floats,
    fitted: Bools,
    *,
    settle: float = SETTLE,
    faint: float = 0.02,
) -> Bools:
    """Return a mask (f,) of lines that side lobes of unfitted lines, of amplitudes `rest` (f,), may
    change by 5 %, or by 5 % of `faint` times the strongest.

    A rhythm that repeats too few times in the response masks all.
    """
    rhythm = response.load.tacton.rhythm if response.load else None
    seconds = step(response.times) * len(response.times)
    if rhythm and seconds < FEWEST_CYCLES * (1 - SAME_LINE) * rhythm.period:
        return np.ones(len(frequencies), bool)
    if whole_periods(response, settle):
        return np.zeros(len(frequencies), bool)
    least = resolution(response, settle=settle)
    distinct, _ = _distinct(frequencies[fitted], least)
    x = np.pi * (frequencies[:, None] - frequencies[rest > 0]) / least
    lobes = _kaiser_transform(x, _kaiser_beta(distinct, 1 / least))
    leakage = np.sqrt(lobes**2 @ rest[rest > 0] ** 2)  # for any phases
    return np.asarray(leakage > MINOR * np.maximum(strengths, faint * strengths.max(initial=0.0)))


def _kaiser_transform(x: Floats, beta: float) -> Floats:
    """|W(x)| / W(0) of a Kaiser window, x pi times bins (Kaiser & Schafer 1980, eq. 2)."""
    root = np.sqrt(beta**2 - x**2 + 0j) + 1e-9
    return np.abs(np.sinh(root) / root) * (beta / np.sinh(beta) if beta else 1.0)


def fit_lines(
    response: Response, frequencies: ArrayLike, *, settle: float = SETTLE
) -> tuple[Complex, Floats]:
    """Return `phasors` (f, p), and the whole response (t, p) minus these lines and the mean."""
    t, x = response.times, response.values
    whole = whole_periods(response, settle)
    basis, weighted, inverse, which = _weighted_waves(t, frequencies, settle, whole)
    fitted = inverse @ (weighted @ x[-weighted.shape[1] :])
    cosine, sine = np.split(fitted[1:], 2)
    amplitudes = np.vstack([fitted[:1], cosine - 1j * sine])[which]
    return amplitudes, x - basis.T @ fitted


def line_rows(
    times: Floats, frequencies: ArrayLike, *, settle: float = SETTLE
) -> tuple[Floats, Floats, Ints]:
    """Return the least-squares rows of `fit_lines`, from which the errors of lines follow.

    Waves (m, k) and rows (m, k) at the k fitted samples: coefficients (m,) are rows @ x, the fit is
    waves.T @ coefficients. Indices (2, f) give the coefficients of cosine and sine of each line.
    """
    basis, weighted, inverse, which = _weighted_waves(times, frequencies, settle)
    sines = which + np.where(which > 0, (len(basis) - 1) // 2, 0)
    return basis[:, -weighted.shape[1] :], inverse @ weighted, np.array([which, sines])


def _weighted_waves(
    times: Floats, frequencies: ArrayLike, settle: float, whole: float = 0.0
) -> tuple[Floats, Floats, Floats, Ints]:
    """Waves (m, t), the same under the window (m, k) at the k fitted samples at the end, the
    inverse (m, m) of their products, and the index (f,) of the wave of each line. There is no
    window over a time of `whole_periods` in s.
    """
    frequencies = np.atleast_1d(np.asarray(frequencies, np.float64))
    nyquist = 0.5 / step(times)
    if not ((frequencies >= 0) & (frequencies < nyquist)).all():
        raise ValueError(f"lines must be between 0 and {nyquist:g} Hz, half the sampling rate")
    first = int(np.argmax(times >= times[0] + settle * np.ptp(times)))
    span = float(np.ptp(times[first:]))
    if not span:
        raise ValueError(f"{len(times)} samples are too few to fit lines; record more")
    if whole:
        first, span = len(times) - round(whole / step(times)), whole
    distinct, which = _distinct(frequencies, (1 - ALIKE) / span if whole else 1 / span)
    basis = _waves(distinct, times)
    fitted = basis[:, first:]
    beta = 0.0 if whole else _kaiser_beta(distinct, span)
    weighted = fitted * np.kaiser(fitted.shape[1], beta)
    inverse = np.linalg.pinv(weighted @ fitted.T, rcond=1e-13, hermitian=True)
    return basis, weighted, np.asarray(inverse, np.float64), which


def _waves(frequencies: Floats, times: Floats) -> Floats:
    """1, cosines and sines (2 f - 1, t) of frequencies (f,) in Hz, the first of which is 0, at
    equally spaced times (t,) in s; as products of few and many steps, which is faster.
    """
    few, dt = int(np.ceil(np.sqrt(len(times)))), step(times)
    turn = 2j * np.pi * frequencies[1:, None]
    blocks = np.exp(turn * (times[0] + dt * np.arange(0, len(times), few)))
    waves = blocks[:, :, None] * np.exp(turn * dt * np.arange(few))[:, None]
    waves = waves.reshape(len(turn), blocks.shape[1] * few)[:, : len(times)]
    return np.concatenate([np.ones((1, len(times))), waves.real, waves.imag])


def _kaiser_beta(frequencies: Floats, span: float, largest: float = 19.0) -> float:
    """Beta of a Kaiser window over `span` in s whose main lobe separates ascending frequencies.

    The `largest` resolves lines `LINE_BINS` apart, as weak as its side lobes of -140 dB.
    """
    bins = float(np.diff(frequencies).min(initial=np.inf) * span)
    lobe = np.hypot(1.0, largest / np.pi) * min(bins / LINE_BINS, 1.0)
    return float(np.pi * np.sqrt(max(lobe**2 - 1, 0.0)))


def _distinct(frequencies: Floats, resolution: float) -> tuple[Floats, Ints]:
    """Resolved frequencies, 0 Hz first, and for each frequency the index of its resolved one."""
    distinct, which = [0.0], np.zeros(len(frequencies), int)
    for k in np.argsort(frequencies, kind="stable"):
        if frequencies[k] > 0 and frequencies[k] - distinct[-1] >= resolution:
            distinct.append(float(frequencies[k]))
        which[k] = len(distinct) - 1
    return np.array(distinct), which
