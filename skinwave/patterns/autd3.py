"""Writer of a Python script that plays a Tacton on AUTD3 devices with FociSTM, by the package autd3
(0.12 and later, asyncio) or its predecessor pyautd3.

The device steps through a list of foci at 40 kHz / N and repeats it, so that its drawing frequency
is 40 kHz / (N points). The script uses the nearest such frequency.
"""

from importlib.resources import files
from math import ceil
from string import Template

import numpy as np

from simple_model import MovingPressure
from simple_model.choices import choose
from skinwave.patterns.pattern import Options, aliasing_notes, loudness
from skinwave.scene.scene import Scene
from skinwave.system.formats import PATTERN_WRITERS, register
from skinwave.typing import Floats

TICK = 40_000.0  # Hz


def write(scene: Scene, options: Options) -> tuple[bytes, tuple[str, ...]]:
    """Return the script, and notes on its approximations; raise a ValueError if the package is
    unknown, if the path is too slow, or if no sound produces the load.
    """
    choose("--package", options.package, ("pyautd3", "autd3"))
    pressure, path = scene.pressure, scene.tacton.trajectory
    foci, in_turn = len(scene.tacton.foci), scene.tacton.sharing == "time_multiplexed"
    count, division = steps(path.drawing_frequency, foci if in_turn else 1)
    places = _places(pressure, count, in_turn=in_turn and foci > 1)
    samples, ticks = _modulation(pressure, path.drawing_frequency)
    drawn = TICK / division / count if not path.is_static else 0.0
    apart = np.linalg.norm(np.roll(places, -foci if in_turn else -1, axis=0) - places, axis=2).max()
    notes = [
        f"{count} patterns of {places.shape[1]} foci, one every {division} ticks of 40 kHz, each "
        f"focus up to {apart:.3g} mm from its last place",
        f"drawing frequency {drawn:.6g} Hz in place of {path.drawing_frequency:.6g} Hz",
        "the device rounds positions to 0.025 mm",
    ]
    if foci > 1:
        notes.append(f"{foci} foci {'in turn' if in_turn else 'at the same time'}")
    if len(samples) > 1:
        notes.append(f"modulation: {len(samples)} samples at {TICK / ticks:g} Hz with 8 bits")
    notes += aliasing_notes(scene.tacton, TICK / ticks)
    if pressure.profile_name == "file":
        notes.append("the map of the focus does not say its height; check HEIGHT")
    name = scene.name.encode("unicode_escape").decode().replace('"', "'")
    title = [
        f'"""{name}: {scene.tacton.duration:g} s on AUTD3 devices, by {options.package}."""',
        *(f"# {note}." for note in notes),
        "# HEIGHT is in mm above the array, DURATION in s, and MODULATION in 1/255 of full drive.",
    ]
    values = [
        f"HEIGHT = {1e3 * pressure.height!r}",
        f"DURATION = {scene.tacton.duration!r}",
        f"PATTERN_TICKS = {division}",
        f"MODULATION_TICKS = {ticks}",
        "PLACES = [  # mm from the centre: patterns, foci, (x, y)",
        *("    [" + ", ".join(f"[{x:.3f}, {y:.3f}]" for x, y in each) + "]," for each in places),
        "]",
        f"MODULATION = {samples.tolist() * (2 if len(samples) == 1 else 1)}",
    ]
    template = files("skinwave") / "templates" / f"play_{options.package}.txt"
    script = Template(template.read_text(encoding="utf-8"))
    text = script.substitute(title="\n".join(title), values="\n".join(values))
    return text.encode(), tuple(notes)


def steps(
    frequency: float, multiple: int = 1, most_points: int = 8192, most_ticks: int = 65_535
) -> tuple[int, int]:
    """Return points per period, a multiple of `multiple`, and ticks per point.

    They give the frequency nearest to a drawing frequency in Hz. A focus at rest has two points,
    the minimum of a FociSTM. Raises a ValueError if the frequency is too low for a device.
    """
    if frequency == 0:
        return 2 * multiple, 1
    ticks = TICK / frequency
    most = most_points // multiple * multiple
    division = max(1, ceil(ticks / most - 1e-9))
    if division > most_ticks:
        raise ValueError(
            f"the drawing frequency of {frequency:g} Hz is below the "
            f"{TICK / most_points / most_ticks:.2g} Hz of a device; raise the speed"
        )
    count = max(multiple, round(ticks / division / multiple) * multiple)
    return min(count, most), division


def _places(pressure: MovingPressure, count: int, *, in_turn: bool) -> Floats:
    """Return positions (patterns, foci, 2) in mm along one period."""
    path, ahead = pressure.tacton.trajectory, np.array(pressure.tacton.foci)
    phase = np.arange(count)[:, None] / count * (not path.is_static) + ahead
    if in_turn:
        phase = phase[np.arange(count), np.arange(count) % len(ahead)][:, None]
    return 1e3 * path.at_phase(np.mod(phase, 1.0))


def _modulation(pressure: MovingPressure, f_d: float) -> tuple[np.ndarray, int]:
    """Return the sound pressure as bytes (k,), one if it is constant, and ticks per sample."""
    tacton, path = pressure.tacton, pressure.tacton.trajectory
    least_ticks, most_samples = 10, 32_768  # 4 kHz
    ticks = max(least_ticks, ceil(tacton.duration * TICK / most_samples))
    t = np.arange(max(2, int(tacton.duration * TICK / ticks))) * (ticks / TICK)
    loud = loudness(pressure, t)
    if path.levels:
        loud = loud * np.sqrt(pressure.weight(path.phase(t)))
        if len(tacton.foci) > 1 and len(set(path.levels)) > 1:
            raise ValueError(
                "AUTD3 has one modulation for all foci, but these have different levels; write .csv"
            )
    samples = np.round(255 * loud).astype(int)
    return (samples[:1] if np.ptp(loud) < 1e-12 else samples), ticks


register(PATTERN_WRITERS, ".py", function=write)
