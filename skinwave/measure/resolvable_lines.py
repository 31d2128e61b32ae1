"""Lines of a scene's load that a record can resolve."""

import numpy as np

from meshes.tetmesh import Floats
from simple_model import Response, resolved_lines, spectrum
from simple_model.load.sampling import step
from simple_model.response import SETTLE
from skinwave.measure.lines import as_response, bin_width, evenly, measurable
from skinwave.measure.measurement import Measurement
from skinwave.models.options import sample_times
from skinwave.results.run import ASSESSED, own_names
from skinwave.scene.scene import Scene


def lines_to_compare(
    measurement: Measurement, scene: Scene
) -> tuple[dict[str, tuple[str, ...]], Floats, tuple[str, ...]]:
    """Lines of the load that both the record and a response of the scene resolve, and the others.

    Returns
    -------
    names by the first of each, frequencies (f,) in Hz, and the names of those left out

    Raises
    ------
    ValueError
        If the record resolves none.
    """
    candidates = ASSESSED if len(scene.tacton.foci) == 1 else ()
    clocks = [*_clock(measurement), _silence(sample_times(scene))]
    highest = min(0.5 / step(clock.times) for clock in clocks)
    found: dict[str, float] = {}
    lost: dict[str, float] = {}
    for clock in clocks:
        good, bad = resolved_lines(scene.pressure, clock, candidates=candidates, highest=highest)
        found, lost = (found | good), (lost | bad)
    kept = {name: f for name, f in sorted(found.items(), key=lambda x: x[1]) if name not in lost}
    there = measurable(measurement, np.array([*kept.values()])) if kept else ()
    lost |= {name: f for (name, f), is_there in zip(kept.items(), there, strict=True)
             if not is_there}  # fmt: skip
    kept = {name: f for name, f in kept.items() if name not in lost}
    if not kept:
        raise ValueError(
            "the measurement resolves no line of the scene's load; give a longer record, a higher "
            "sampling rate, or the scene that was measured"
        )
    own = own_names(scene, kept)
    names = {
        name: tuple(dict.fromkeys([name, *(n for n, o in own.items() if o == name)]))
        for name in kept
    }
    return names, np.array([*kept.values()]), tuple(lost)


def _clock(measurement: Measurement) -> list[Response]:
    """Silence at the times of a measurement, by which lines are resolved; of a spectrum with equal
    bins at times whose transform has them.
    """
    if not measurement.is_spectrum:
        times = evenly(measurement)
    else:
        width = bin_width(measurement)
        if not width:
            return []
        rate = 2.1 * measurement.frequencies[-1]
        times = np.arange(int(rate / width)) / rate / (1 - SETTLE)
    return [_silence(times)]


def _silence(times: Floats) -> Response:
    return Response(
        model="measured", times=times, probes=np.zeros((1, 2)), values=np.zeros((len(times), 1))
    )


def spectrum_of(measurement: Measurement) -> tuple[Floats, Floats]:
    """Amplitude spectrum of the mean, for peaks; empty of spectra of single lines."""
    if not measurement.is_spectrum:
        return spectrum(as_response(measurement, measurement.mean))
    if not bin_width(measurement):
        return np.empty(0), np.empty((0, len(measurement.places)))
    return measurement.frequencies, np.abs(measurement.mean)
