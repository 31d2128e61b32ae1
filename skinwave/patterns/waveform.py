"""WAV as what a Tacton's amplitude follows, at any rate; full scale is the scene's amplitude."""

import io
import warnings
from dataclasses import replace

import numpy as np
from scipy.io import wavfile

from meshes.tetmesh import Floats
from simple_model import Signal, modulation
from simple_model.choices import choose
from simple_model.load.rhythm import ROLES
from simple_model.load.tacton import LONGEST, level, tones
from skinwave.patterns.pattern import Options, Pattern, aliased
from skinwave.scene.scene import Scene

SCALES = ("full", "peak", "rms")
WRITTEN_RATE = 48_000.0  # Hz
CUT = 0.02  # beyond full drive that is cut off: what rounding adds to a sine of 8 bits
STEP = 2.0**-15  # of full scale, the resolution of 16 bits: rounding below 0 is no negative load


def read(content: bytes, options: Options, base: Scene) -> Pattern:
    """The base scene's Tacton for as long as the WAV lasts, with it as its envelope in place of the
    rhythm, or as its modulation in place of the sinusoids.

    Raises
    ------
    ValueError
        If it is no WAV of one channel, too long, or cannot be what it is said to be.
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


def write(scene: Scene, options: Options) -> tuple[bytes, tuple[str, ...]]:
    """Modulation of the amplitude, or its level in time, 32-bit float, and notes on how it is read
    back to the same load.
    """
    rate = options.rate or WRITTEN_RATE
    if not (1 <= rate <= 192_000 and rate == int(rate)):
        raise ValueError(f"rate = {rate:g} Hz is outside the whole numbers 1..192000; choose one")
    t = np.arange(max(2, round(scene.tacton.duration * rate))) / rate
    path = scene.tacton.trajectory
    samples, said = (_with_levels if path.levels else _one_role)(scene, t)
    notes = [f"{len(t):,} samples at {rate:g} Hz; full scale is the scene's amplitude", *said]
    notes += aliased(scene.tacton, rate)
    if not path.is_static:
        notes.append("a WAV has no positions: the path is left out")
    file = io.BytesIO()
    wavfile.write(file, int(rate), samples.astype(np.float32))
    return file.getvalue(), tuple(notes)


def _one_role(scene: Scene, t: Floats) -> tuple[Floats, list[str]]:
    """Samples (t,) that stand for all modulation, or for the level, and notes.

    The other stays with the scene, as a product of the two would pass the drive law in another
    way than they do.
    """
    tacton, modulated = scene.tacton, _is_modulated(scene)
    enveloped = tacton.signal is not None and tacton.signal.role == "envelope"
    if enveloped or (tacton.rhythm and not modulated):
        kept = "amplitude and modulation stay" if modulated else "amplitude stays"
        notes = [f"{kept} with the scene", "to be read back with --role envelope"]
        return np.broadcast_to(level(tacton, t), t.shape), notes
    kept = "amplitude and rhythm stay" if tacton.rhythm else "amplitude stays"
    return modulation(tacton, t), [f"{kept} with the scene"]


def _with_levels(scene: Scene, t: Floats) -> tuple[Floats, list[str]]:
    """Samples (t,) of levels of a recorded path and of the modulation, and notes.

    They are read onto another path, so that both must be in them: as the level that gives the same
    pressure without modulation or, where pressure has a sign, as a modulation that is a product.
    """
    tacton, pressure = scene.tacton, scene.pressure
    path = tacton.trajectory
    levels = path.level_at_phase(np.mod(path.phase(t) + tacton.foci[0], 1.0))
    notes = ["levels of the first focus"] if len(tacton.foci) > 1 else []
    notes.append("amplitude stays with the scene, but a recorded path has levels of its own: "
                 "to be read onto another path")  # fmt: skip
    if _is_modulated(scene):
        law, depth, full = pressure.law, pressure.depth_of_modulation, tacton.amplitude or 1.0
        shown = modulation(tacton, t)
        driven = law(full * levels, shown, depth)
        if law.is_signed and np.allclose(law(full, levels * shown, depth), driven):
            return levels * shown, notes
        levels = law.amplitude(driven, depth) / full
        notes.append("the modulation is in these levels, and must not be in that scene")
    return levels, [*notes, "to be read back with --role envelope"]


def _is_modulated(scene: Scene) -> bool:
    tacton = scene.tacton
    sampled = tacton.signal is not None and tacton.signal.role == "modulation"
    return sampled or any(f > 0 for f in tones(tacton))


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
