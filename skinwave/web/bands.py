"""Bands at a page's point: what the spread of a scene's uncertain numbers leaves of its response.

The samples are those of `skinwave run --samples`, by models that need no new reduction: the point
kernel, the table of a flat body, the modes of a sheet that is held. Tables depend on the sample's
body and height alone: another Tacton or point costs next to nothing. Motion is in proportion to the
pressure: of any other body the device's part follows from the response that is there, and what
samples of the others would cost is said.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from meshes.tetmesh import Floats
from simple_model import Response, sensation_level, spectrum
from simple_model.line_names import line_frequency
from simple_model.response import phasors
from skinwave.effort import silent
from skinwave.models.advice import takes
from skinwave.models.plate_modes import FROM_REST
from skinwave.models.point_kernel import SAME_LOAD
from skinwave.models.prepared import sample_times
from skinwave.numbers import significant
from skinwave.planning.budget import error_budget
from skinwave.scene import Body, Scene
from skinwave.simulation import compute
from skinwave.spreads import PRESSURE, Spread, spreads_of, with_values
from skinwave.uncertainty.propagate import method_of, percentiles
from skinwave.uncertainty.sampling import samples
from skinwave.uncertainty.shared_body import family_of
from skinwave.web.model import FAINTEST_LEVEL, HIGHEST
from skinwave.web.slabs import Table, is_tabulated, lowest, tabulate, wavenumbers
from skinwave.web.waves import flat_motion

FIRST = 16  # samples after which there are bands to be seen, which the others refine
EXACT = 2e-3  # relative error of a waveform by a table
NOT_SAMPLED = "since nothing that can be sampled here is uncertain"
FIXED = ("tacton.duration_s",)  # samples have one length
TOGETHER = 45.0  # reductions of one body that one of all samples takes, about
NONE = partial(np.empty, 0)

Respond = Callable[[Scene], Response]


@dataclass(frozen=True, kw_only=True, eq=False)
class Bands:
    """Percentiles 5 and 95 of samples at one point, in SI.

    Parameters
    ----------
    times, frequencies : (t,) float, s, and (f,) float, Hz; empty if nothing is sampled
    waveform, spectrum : (2, t) and (2, f) float
    levels : the two of the sensation level in dB of each named line; none of what is no skin
    done : samples so far
    sentences : what is uncertain, and by how much
    """

    sentences: tuple[str, ...]
    times: Floats = field(default_factory=NONE)
    waveform: Floats = field(default_factory=NONE)
    frequencies: Floats = field(default_factory=NONE)
    spectrum: Floats = field(default_factory=NONE)
    levels: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    done: int = 0


@dataclass(frozen=True, kw_only=True, eq=False)
class Sample:
    """Response of one sample: `waveform` (t,), `spectrum` (f,), and `levels` (lines,) in dB."""

    waveform: Floats
    spectrum: Floats
    levels: Floats


class Sampler:
    """Bands of so many samples of scenes; caches the tables of flat bodies."""

    def __init__(self, samples: int) -> None:
        self.samples = samples
        self._tables: dict[tuple[Body, float], Table] = {}

    def __call__(self, scene: Scene, central: Response) -> Iterator[Bands | None]:
        """Bands of a scene of one probe, after some samples and after all, and None after each of
        the others; `central` is the response of the central values.
        """
        respond = self._model(scene)
        spreads, left_out = _parted(spreads_of(scene), respond is not None)
        if all(spread.key == PRESSURE for spread in spreads):
            respond = None
        together = bool(left_out) and _is_together(scene, central, self.samples)
        said = (*_who(spreads, self.samples), *_cost(left_out, self.samples, central, together))
        if not spreads:
            yield Bands(sentences=(f"Uncertainty: no bands, {NOT_SAMPLED}.", *said))
            return
        names = method_of(scene, central.model).lines
        keys, found = [spread.key for spread in spreads], list[Sample]()
        middle = _seen(scene, central, names)
        for row in samples(spreads, self.samples):
            sample = with_values(scene, dict(zip(keys, map(float, row), strict=True)))
            found.append(
                _seen(sample, respond(sample), names) if respond
                else _scaled(middle, _pressure(sample) / _pressure(scene))
            )  # fmt: skip
            first = f"Uncertainty: bands of {len(found)} of {self.samples} samples."
            some = len(found) in (FIRST, self.samples)
            yield _bands(scene, central, found, names, (first, *said)) if some else None
        budget = error_budget(scene, _numerical(scene, central))
        first = f"Uncertainty of the waveform at the point: {budget.parts}."
        yield _bands(scene, central, found, names, (first, *said))

    def _model(self, scene: Scene) -> Respond | None:
        """The response of a sample in some tenths of a second, if there is a model for it."""
        if not scene.body.of_kind.discretise:
            return lambda sample: compute(sample, SAME_LOAD.name)
        if not scene.reading.is_plain:
            return None
        if is_tabulated(scene.body):
            return self._of_table
        return (lambda sample: compute(sample, FROM_REST.name)) if takes(FROM_REST, scene) else None

    def _of_table(self, sample: Scene) -> Response:
        """Response of a flat body by its table."""
        key = sample.body, sample.pressure.height
        if (table := self._tables.pop(key, None)) is None:
            table = tabulate(wavenumbers(key[0], lowest(key[1]), silent), key[1])
            table = replace(table, g=table.g.astype(np.complex64))
        self._tables[key] = table  # the newest is last
        while len(self._tables) > self.samples + 1:  # those of one scene
            del self._tables[next(iter(self._tables))]
        times, probes = sample_times(sample), sample.probe_points
        # Of a copy, whose splines, several times as large, are not kept.
        motion = flat_motion(replace(table), sample.pressure, probes[0], times)
        return Response(model="flat-body", times=times, probes=probes, values=motion[:, None])


def _parted(spreads: Sequence[Spread], is_cheap: bool) -> tuple[list[Spread], list[Spread]]:
    """Spreads that are sampled, and those that are not."""
    taken = [s for s in spreads if s.key not in FIXED and (is_cheap or s.key == PRESSURE)]
    return taken, [s for s in spreads if s not in taken]


def _pressure(scene: Scene) -> float:
    return scene.pressure.peak_pressure


def _scaled(middle: Sample, factor: float) -> Sample:
    """A sample that differs by its pressure alone."""
    return Sample(
        waveform=factor * middle.waveform, spectrum=factor * middle.spectrum,
        levels=middle.levels + 20 * np.log10(factor),
    )  # fmt: skip


def _seen(sample: Scene, response: Response, names: Sequence[str]) -> Sample:
    frequencies = np.array([line_frequency(sample.tacton, name) or 0.0 for name in names])
    lines = np.abs(phasors(response, frequencies)[:, 0]) * (frequencies > 0)
    f, amplitude = spectrum(response)
    return Sample(
        waveform=response.values[:, 0], spectrum=amplitude[f <= HIGHEST, 0],
        levels=np.asarray(sensation_level(lines, frequencies)),
    )  # fmt: skip


def _bands(
    scene: Scene,
    central: Response,
    found: Sequence[Sample],
    names: Sequence[str],
    said: Sequence[str],
) -> Bands:
    f = spectrum(central)[0]
    levels = np.maximum([each.levels for each in found], FAINTEST_LEVEL)
    skin = scene.reading.is_plain and scene.body.is_skin
    ends = _ends(levels).T.tolist()
    return Bands(
        times=central.times, waveform=_ends(np.array([each.waveform for each in found])),
        frequencies=f[f <= HIGHEST], spectrum=_ends(np.array([each.spectrum for each in found])),
        levels={n: (low, high) for n, (low, high) in zip(names, ends, strict=True) if skin},
        done=len(found), sentences=(*said, *(_above(levels) if skin else ())),
    )  # fmt: skip


def _ends(values: Floats) -> Floats:
    """Percentiles 5 and 95 (2, ...) of samples (n, ...)."""
    return percentiles(values)[[0, -1]]


def _above(levels: Floats) -> tuple[str, ...]:
    """Sentence on the highest sensation level of each sample (n, lines)."""
    highest = levels.max(axis=1, initial=FAINTEST_LEVEL)
    if highest.max() <= FAINTEST_LEVEL:
        return ()
    low, _, median, _, high = (f"{v:+.0f}" for v in percentiles(highest))
    share = 100 * float((highest >= 0).mean())
    return (
        f"Highest sensation level at the selected point: {median} dB, in nine of ten samples {low} "
        f"to {high} dB; above threshold in {share:.0f} %.",
    )


def _who(spreads: Sequence[Spread], count: int) -> tuple[str, ...]:
    """Sentence on what is uncertain."""
    if not spreads:
        return ()
    keys = ", ".join(f"{s.key} ({s.distribution.words})" for s in spreads)
    return (f"The bands are 5 to 95 % of {count} samples of {keys}.",)


def _is_together(scene: Scene, central: Response, count: int) -> bool:
    """Whether one reduced-order model gives all samples of a body of elements."""
    spreads = spreads_of(scene)
    values = samples(spreads, count)
    return bool(family_of(scene, spreads, values, method_of(scene, central.model)))


def _cost(
    left_out: Sequence[Spread], count: int, central: Response, together: bool
) -> tuple[str, ...]:
    """Sentence on what is uncertain and not in the bands, and what samples of it would cost."""
    if not left_out:
        return ()
    each = sum(central.effort.seconds.values())
    seconds = (TOGETHER if together else count) * each
    time = f", about {significant(seconds / 60, 2)} min" if seconds else ""
    how = f"each of {count} samples would be computed anew"
    if together:
        how = f"the body would be reduced once for all {count} samples"
    keys = ", ".join(s.key for s in left_out)
    return (
        f"The spread of {keys} is not in the bands: {how}{time}; skinwave run --samples {count} "
        "does.",
    )


def _numerical(scene: Scene, central: Response) -> float:
    """Relative numerical error of the waveform that is shown; nan if it is not known."""
    exact = not scene.body.of_kind.discretise or (
        scene.reading.is_plain and is_tabulated(scene.body) and scene.body.sides == "absorbing"
    )
    return EXACT if exact else central.expected_error
