"""The 15 Tactons that Lim, Seifi and Park measured (CHI EA '24, section 3.1)."""

from collections.abc import Iterator, Mapping

from simple_model import MovingPressure, Tacton, Trajectory
from skinwave.scene import BODIES, Body, Scene

AM_FREQUENCIES = (0.0, 80.0, 140.0, 210.0)  # Hz
MEASURED_ON = ("paper-sheet", "skin-slab")  # the sheet they had, and what they wished to
PATHS = ((0.0, 0.0), (0.010, 6.0), (0.020, 12.0), (0.030, 18.0))  # circle diameter m, speed m/s


def tactons() -> Iterator[tuple[str, Tacton]]:
    """Name and Tacton of the 3 PureAM, 3 PureSTM and 9 AM+STM patterns, each 1 s."""
    for am_frequency in AM_FREQUENCIES:
        for size, speed in PATHS:
            parts = [f"am{am_frequency:g}"] if am_frequency else []
            parts += [f"stm{1e3 * size:g}"] if size else []
            if parts:
                path = Trajectory(shape="circle", size=size, speed=speed)
                yield "-".join(parts), Tacton(am_frequency=am_frequency, trajectory=path)


def scenes(name: str, tacton: Tacton, bodies: Mapping[str, Body] | None = None) -> dict[str, Scene]:
    """One Tacton as published (no body) and on bodies by name: the paper sheet and skin."""
    published = MovingPressure(tacton=tacton, focus="main_lobe", drive="linear")
    physical = MovingPressure(tacton=tacton)
    found = {"none": Scene(name=name, pressure=published, body=BODIES["none"])}
    for label, body in (bodies or {key: BODIES[key] for key in MEASURED_ON}).items():
        found[label] = Scene(name=name, pressure=physical, body=body)
    return found
