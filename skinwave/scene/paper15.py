"""The 15 Tactons that Lim, Seifi and Park measured (CHI EA '24, section 3.1)."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

from simple_model import MovingPressure, Tacton, Trajectory, published_load
from skinwave.scene.scene import BODIES, Body, Scene, with_body

MEASURED_ON = ("paper-sheet", "palm")  # a sheet as theirs may have been, and skin
SIZES = {"palm": 4.5e-3}  # m, of elements within 3 % for every Tacton but stm30, 6 %


def tactons() -> Iterator[tuple[str, Tacton]]:
    """Yield names and Tactons of the 3 PureAM, 3 PureSTM and 9 AM+STM patterns of 1 s."""
    circles = ((0.0, 0.0), (0.010, 6.0), (0.020, 12.0), (0.030, 18.0))  # diameter m, speed m/s
    for am_frequency in (0.0, 80.0, 140.0, 210.0):  # Hz
        for size, speed in circles:
            parts = [f"am{am_frequency:g}"] if am_frequency else []
            parts += [f"stm{1e3 * size:g}"] if size else []
            if parts:
                path = Trajectory(shape="circle", size=size, speed=speed)
                yield "-".join(parts), Tacton(am_frequency=am_frequency, trajectory=path)


def scenes(name: str, tacton: Tacton, bodies: Mapping[str, Body] | None = None) -> dict[str, Scene]:
    """Return scenes of one Tacton by name: one of each point kernel, and one of each body under the
    load of `point-kernel`.

    The default bodies are the paper sheet and skin.
    """
    bodies = bodies or {key: BODIES[key] for key in MEASURED_ON}
    scene = Scene(name=name, pressure=MovingPressure(tacton=tacton), body=BODIES["none"])
    return beside_kernels(scene) | {key: with_body(scene, body) for key, body in bodies.items()}


def beside_kernels(scene: Scene) -> dict[str, Scene]:
    """Return the scene without its body, under the published load and under its own."""
    bare = with_body(scene, BODIES["none"])
    paper = replace(bare, pressure=published_load(scene.pressure))
    return {"point-kernel-published": paper, "point-kernel": bare}
