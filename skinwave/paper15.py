"""The 15 Tactons that Lim, Seifi and Park measured (CHI EA '24, section 3.1)."""

from collections.abc import Iterator

from simple_model import MovingPressure, Tacton, Trajectory
from skinwave.scene import BODIES, Scene

AM_FREQUENCIES = (0.0, 80.0, 140.0, 210.0)  # Hz
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


def scenes(name: str, tacton: Tacton) -> dict[str, Scene]:
    """One Tacton as published (no body), on the paper sheet and on skin, by body name."""
    published = MovingPressure(tacton=tacton, focus="main_lobe", drive="linear")
    physical = MovingPressure(tacton=tacton)
    return {
        label: Scene(name=name, pressure=published if label == "none" else physical, body=body)
        for label, body in BODIES.items()
    }
