"""Record of a measurement: what was measured, where, how often, and under which drive."""

from dataclasses import dataclass, field

import numpy as np

from simple_model.numbers import first_few
from simple_model.quantities import Quantity, quantity
from skinwave.typing import Floats

UNEVEN = 1e-3  # of a sampling interval, left by rounding in text files


@dataclass(frozen=True, kw_only=True, eq=False)
class Measurement:
    """Motion measured at places on a body: waveforms or spectra.

    Parameters
    ----------
    quantity : str, name in `simple_model.quantities.QUANTITIES`; normal motion is positive into the
        body
    places : (p, 2) float, m, in the plane of the body; nan if unknown
    times : (t,) float, s, rising in equal steps; empty for spectra
    frequencies : (f,) float, Hz, rising; empty for waveforms
    values : (r, t, p) float or, for spectra, (r, f, p) complex, in SI, for r repetitions; spectra
        are complex amplitudes a of Re a exp(2 pi i f t)
    drive : (t,) float or (f,) complex, the recorded reference signal in any unit; may be empty
    name, source : str, a title, and the file or publication
    remarks : sentences on missing information and assumptions

    Arrays are copied and read-only.

    Raises
    ------
    ValueError
        If shapes do not fit, a value is not finite, times are not equally spaced, or the quantity
        is unknown or not that of a body.

    >>> t = np.arange(100) / 1000
    >>> values = np.sin(2 * np.pi * 140 * t)[None, :, None]
    >>> record = Measurement(quantity="velocity", places=[[0, 0]], times=t, values=values)
    >>> record.values.shape, record.rate
    ((1, 100, 1), 1000.0)
    """

    quantity: str
    places: Floats
    values: np.ndarray
    times: Floats = field(default_factory=lambda: np.empty(0))
    frequencies: Floats = field(default_factory=lambda: np.empty(0))
    drive: np.ndarray = field(default_factory=lambda: np.empty(0))
    name: str = ""
    source: str = ""
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not quantity(self.quantity).of_body:
            raise ValueError(f"a measurement cannot be of {self.quantity}; give a motion")
        kind = np.complex128 if len(self.frequencies) else np.float64
        for name in ("places", "times", "frequencies", "values", "drive"):
            dtype = kind if name in ("values", "drive") else np.float64
            array = np.array(getattr(self, name), dtype)
            if name != "places" and not np.isfinite(array).all():
                raise ValueError(f"{name} of a measurement must be finite; leave out nan and inf")
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        object.__setattr__(self, "remarks", tuple(self.remarks))
        self._check()

    def _check(self) -> None:
        if bool(len(self.times)) == bool(len(self.frequencies)):
            raise ValueError("a measurement has either times or frequencies; give one of them")
        shape, count = self.places.shape, len(self.axis)
        if len(shape) != 2 or shape[1] != 2:
            raise ValueError(f"places of a measurement have shape {shape}; give (p, 2) in m")
        expected = (max(len(self.values), 1), count, len(self.places))
        if self.values.shape != expected:
            shape = self.values.shape
            raise ValueError(f"values of a measurement have shape {shape}; give {expected}")
        if len(self.drive) not in (0, count):
            raise ValueError(f"drive of a measurement has {len(self.drive)} values; give {count}")
        steps = np.diff(self.axis)
        if not steps.min(initial=1.0) > 0:
            raise ValueError("times or frequencies of a measurement must rise; sort them")
        if len(self.times) > 1 and np.abs(steps - steps.mean()).max() > UNEVEN * steps.mean():
            steps_s = f"{steps.min():g} to {steps.max():g} s"
            raise ValueError(f"times of a measurement must rise in equal steps, not {steps_s}")

    @property
    def axis(self) -> Floats:
        """Times in s or, for spectra, frequencies in Hz."""
        return self.times if len(self.times) else self.frequencies

    @property
    def is_spectrum(self) -> bool:
        """Whether values are complex amplitudes by frequency, not waveforms."""
        return len(self.frequencies) > 0

    @property
    def record(self) -> Quantity:
        """Record of the quantity."""
        return quantity(self.quantity)

    @property
    def rate(self) -> float:
        """Sampling rate of waveforms, Hz; nan for spectra."""
        times = self.times
        return (len(times) - 1) / float(np.ptp(times)) if len(times) > 1 else float("nan")

    @property
    def mean(self) -> np.ndarray:
        """Mean (t or f, p) over the repetitions."""
        return np.asarray(self.values.mean(axis=0))

    def place_name(self, place: int) -> str:
        """Return the position of a place, such as "(5, 0) mm", or its number from 1."""
        x, y = 1e3 * self.places[place]
        return f"({x:.4g}, {y:.4g}) mm" if np.isfinite([x, y]).all() else f"place {place + 1}"

    def place_names(self, places: np.ndarray) -> str:
        """Return the names of the first few of some places."""
        return first_few([self.place_name(int(p)) for p in places], 5)


def strongest(size: Floats, most: int) -> np.ndarray:
    """Return the ascending indices of the places with the largest values of `size` (p,)."""
    return np.sort(np.argsort(-size, kind="stable")[:most])
