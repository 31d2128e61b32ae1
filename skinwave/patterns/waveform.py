"""WAV files as the modulation or the envelope of a Tacton."""

import io
import re
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
from skinwave.system.formats import PATTERN_READERS, register
from skinwave.typing import Floats


def read(content: bytes, options: Options, base: Scene) -> Pattern:
    """Read a WAV as the envelope of the base scene's Tacton, replacing its rhythm, or as its
    modulation, replacing its sinusoids. The Tacton lasts as long as the WAV.
    """
    choose("role of a WAV", options.role, ROLES)
    rate, channels, _ = decode(content)
    if channels.shape[1] != 1:
        raise ValueError(f"the WAV has {channels.shape[1]} channels; mix it down to one")
    samples = channels[:, 0]
    if not np.isfinite(samples).all():
        raise ValueError("the WAV has samples that are not finite; export it again")
    samples, note = _scale(samples, options.scale)
    if options.role == "envelope":
        rounding = 2.0**-15  # of full scale, that of 16 bits
        if samples.min() < -rounding:
            raise ValueError(
                f"an envelope must not be negative, but falls to {samples.min():.3g}; use the role "
                "modulation"
            )
        samples = np.maximum(samples, 0.0)
    duration = len(samples) / rate
    if duration > LONGEST:
        raise ValueError(f"the WAV lasts {duration:g} s; cut it to {LONGEST:g} s or less")
    if base.tacton.trajectory.levels:
        raise ValueError("the path of the scene has levels of its own; use a scene without them")
    signal = Signal(rate=float(rate), samples=tuple(samples.tolist()), role=options.role)
    tacton = replace(base.tacton, duration=duration, signal=signal)
    if options.role == "modulation":
        tacton = replace(tacton, am_frequency=0.0, second_am_frequency=0.0, envelope_frequency=0.0)
    else:
        tacton = replace(tacton, rhythm=None)
    return Pattern(
        tacton=tacton, notes=(f"{len(samples):,} samples at {rate:g} Hz as {options.role}, {note}",)
    )


def decode(content: bytes) -> tuple[int, Floats, float]:
    """Return the rate in Hz, samples (k, channels) relative to full scale, and full scale."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", wavfile.WavFileWarning)  # about other chunks
            rate, data = wavfile.read(io.BytesIO(content))
    except Exception as error:  # whatever the library raises for damaged bytes
        unknown = re.match(r"Unknown wave file format: (\w+)", str(error))
        problem = f"is coded as {unknown[1]}" if unknown else "is damaged or not a WAV file"
        raise ValueError(f"the file {problem}; export it again as PCM") from None
    if rate <= 0 or len(data) < 2:
        raise ValueError(f"the WAV has {len(data)} samples at {rate} Hz; it needs two or more")
    middle, full = {"u": (128, 128.0), "f": (0, 1.0)}.get(
        data.dtype.kind, (0, 2.0 ** (8 * data.dtype.itemsize - 1))
    )  # 24 bits are the upper ones of 32
    with np.errstate(invalid="ignore"):  # of samples that are not finite
        return rate, (data.reshape(len(data), -1).astype(np.float64) - middle) / full, full


def _scale(samples: Floats, scale: str) -> tuple[Floats, str]:
    """Return scaled samples (k,), and the scale in words."""
    peak = float(np.abs(samples).max())
    if peak == 0:
        raise ValueError("the WAV is silent; export it again")
    if not 1e-12 < peak < 1e12:  # other numbers are damaged
        raise ValueError(
            f"the WAV has a peak of {peak:.3g} of full scale, which no recording has; export it "
            "again with a peak of 1"
        )
    rms = float(np.sqrt(np.mean(samples**2)))
    factors = {"full": 1.0, "peak": 1 / peak, "rms": np.sqrt(0.5) / rms}
    factor, clipped = factors[choose("scale", scale, factors)], 0.02  # a sine of 8 bits is rounded
    if factor * peak > 1 + clipped:
        raise ValueError(
            f"with scale '{scale}' the WAV reaches {factor * peak:.3g} times full drive; use the "
            "scale 'peak'"
        )
    note = f"scale '{scale}': full drive is {1 / factor:.4g} of full scale"
    return np.clip(samples * factor, -1, 1), note


register(PATTERN_READERS, ".wav", function=read, largest=32_000_000)
