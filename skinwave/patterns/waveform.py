"""WAV as what a Tacton's amplitude follows, at any rate; full scale is the scene's amplitude."""

import io
import warnings
from dataclasses import replace

import numpy as np
from scipy.io import wavfile

from simple_model import Signal
from simple_model.choices import choose
from simple_model.load.rhythm import ROLES
from simple_model.load.tacton import LONGEST
from skinwave.patterns.pattern import Options, Pattern
from skinwave.scene.scene import Scene
from skinwave.typing import Floats

SCALES = ("full", "peak", "rms")
CUT = 0.02  # beyond full drive that is cut off: what rounding adds to a sine of 8 bits
STEP = 2.0**-15  # of full scale, the resolution of 16 bits: rounding below 0 is no negative load


def read(content: bytes, options: Options, base: Scene) -> Pattern:
    """The base scene's Tacton for as long as the WAV lasts, with it as its envelope in place of the
    rhythm, or as its modulation in place of the sinusoids; raises a ValueError if it is no WAV of
    one channel, too long, or cannot be what it is said to be.
    """
    choose("role of a WAV", options.role, ROLES)
    choose("scale", options.scale, SCALES)
    rate, samples = _decoded(content)
    samples, said = _scaled(samples, options.scale)
    if options.role == "envelope":
        if samples.min() < -STEP:
            raise ValueError(
                f"an envelope falls to {samples.min():.3g}, below 0; take it as a modulation"
            )
        samples = np.maximum(samples, 0.0)
    signal = Signal(rate=float(rate), samples=tuple(samples.tolist()), role=options.role)
    duration = len(samples) / rate
    if duration > LONGEST:
        raise ValueError(f"the WAV lasts {duration:g} s, longer than {LONGEST:g} s; cut it")
    kept = base.tacton
    if kept.trajectory.levels:
        raise ValueError("a recorded path has levels of its own; give a scene with another path")
    tacton = replace(kept, duration=duration, signal=signal)
    if options.role == "modulation":
        tacton = replace(tacton, am_frequency=0.0, second_am_frequency=0.0, envelope_frequency=0.0)
    else:
        tacton = replace(tacton, rhythm=None)
    notes = (f"{len(samples):,} samples at {rate:g} Hz as {options.role}, {said}",)
    return Pattern(tacton=tacton, notes=notes)


def _decoded(content: bytes) -> tuple[int, Floats]:
    """Samples a second, and samples (k,) with full scale 1."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", wavfile.WavFileWarning)  # of chunks beside the samples
            rate, data = wavfile.read(io.BytesIO(content))
    except Exception:
        raise ValueError("not a WAV file that can be read; save it as 16-bit PCM") from None
    if data.ndim != 1:
        raise ValueError(f"the WAV has {data.shape[1]} channels; mix it down to one")
    if rate <= 0 or len(data) < 2:
        raise ValueError(f"the WAV has {len(data)} samples at {rate} Hz; give two or more")
    if data.dtype == np.uint8:
        return rate, (data.astype(np.float64) - 128) / 128
    if data.dtype.kind == "i":
        return rate, data / float(2 ** (8 * data.dtype.itemsize - 1))
    if not np.isfinite(data).all():
        raise ValueError("the WAV has samples that are not finite; mend it")
    return rate, data.astype(np.float64)


def _scaled(samples: Floats, scale: str) -> tuple[Floats, str]:
    """Samples (k,) so scaled, and by what, in words."""
    peak, rms = float(np.abs(samples).max()), float(np.sqrt(np.mean(samples**2)))
    if peak == 0:
        raise ValueError("the WAV is silent; there is nothing to command")
    factor = {"full": 1.0, "peak": 1 / peak, "rms": np.sqrt(0.5) / rms}[scale]
    if factor * peak > 1 + CUT:
        raise ValueError(
            f"samples of the WAV reach {factor * peak:.3g} on the scale '{scale}', beyond full "
            "drive; take the scale 'peak'"
        )
    said = f"scale '{scale}': full drive is {1 / factor:.4g} of full scale"
    return np.clip(samples * factor, -1, 1), said
