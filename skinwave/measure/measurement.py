"""Record of a measurement: what was measured, where, how often, and under which drive."""

from dataclasses import dataclass, field

import numpy as np

from simple_model.quantities import Quantity, quantity
from skinwave.typing import Floats

UNEVEN = 1e-3  # of a sampling interval: what rounding in text files may leave
MOST_NAMED = 5  # places


@dataclass(frozen=True, kw_only=True, eq=False)
class Measurement:
    """Motion measured at places on a body: waveforms or spectra.

    Parameters
    ----------
    quantity : str, name of one of `simple_model.quantities.QUANTITIES`; of the normal motion,
        positive into the body, the way a pressure pushes
    places : (p, 2) float, metre, in the plane of the body, as probes are; nan where unknown
    times : (t,) float, s, rising in equal steps; empty of spectra
    frequencies : (f,) float, Hz, rising; empty of waveforms
    values : (r, t, p) float or, of spectra, (r, f, p) complex, SI: repetitions first; a spectrum
        has the complex amplitudes a of Re a exp(2 pi i f t)
    drive : (t,) float or (f,) complex, the reference signal that was recorded beside it, in an
        unknown unit; empty where there is none
    name, source : str, what it is called, and the file or publication that it is from
    remarks : sentences on what was missing or assumed when it was read

    The arrays are copied, and the copies cannot be written to.

    Raises
    ------
    ValueError
        If shapes do not fit, a value is not finite, times are not equally spaced, or the quantity
        is unknown or not one of a body.
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
            raise ValueError(f"{self.quantity} is not measured on a body; give a quantity of one")
        kind = np.complex128 if len(self.frequencies) else np.float64
        for name, dtype in (
            ("places", np.float64), ("times", np.float64), ("frequencies", np.float64),
            ("values", kind), ("drive", kind),
        ):  # fmt: skip
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
        if self.places.ndim != 2 or self.places.shape[1] != 2:
            raise ValueError(
                f"places of a measurement have shape {self.places.shape}; give (p, 2) in metre"
            )
        expected = len(self.axis), len(self.places)
        if self.values.ndim != 3 or not len(self.values) or self.values.shape[1:] != expected:
            raise ValueError(
                f"values of a measurement have shape {self.values.shape}; give (repetitions, "
                f"{expected[0]}, {expected[1]}), by its times or frequencies and places"
            )
        if len(self.drive) not in (0, len(self.axis)):
            raise ValueError(
                f"the drive of a measurement has {len(self.drive)} values; give {len(self.axis)}"
            )
        steps = np.diff(self.axis)
        if len(steps) and not steps.min() > 0:
            raise ValueError("times or frequencies of a measurement must rise; sort them")
        if len(self.times) > 1 and np.abs(steps - steps.mean()).max() > UNEVEN * steps.mean():
            raise ValueError(
                f"times of a measurement must rise in equal steps, and theirs are {steps.min():g} "
                f"to {steps.max():g} s; sample it evenly"
            )

    @property
    def axis(self) -> Floats:
        """Times in s or, of spectra, frequencies in Hz."""
        return self.times if len(self.times) else self.frequencies

    @property
    def is_spectrum(self) -> bool:
        """Whether it is of complex amplitudes by frequency, not of waveforms."""
        return len(self.frequencies) > 0

    @property
    def record(self) -> Quantity:
        """The record of its quantity."""
        return quantity(self.quantity)

    @property
    def rate(self) -> float:
        """Sampling rate of waveforms, Hz; nan of spectra."""
        times = self.times
        return (len(times) - 1) / float(np.ptp(times)) if len(times) > 1 else float("nan")

    @property
    def mean(self) -> np.ndarray:
        """Mean (t or f, p) over the repetitions."""
        return np.asarray(self.values.mean(axis=0))

    def place_name(self, place: int) -> str:
        """A place: (5, 0) mm, or its number, from 1, where it is not known."""
        x, y = 1e3 * self.places[place]
        return f"({x:.4g}, {y:.4g}) mm" if np.isfinite([x, y]).all() else f"place {place + 1}"

    def place_names(self, places: np.ndarray) -> str:
        """The first of some places."""
        names = ", ".join(self.place_name(int(p)) for p in places[:MOST_NAMED])
        return names + f" and {len(places) - MOST_NAMED} more" * (len(places) > MOST_NAMED)
