"""One answer beside the scene that it answers, and its lines by name."""

from dataclasses import dataclass
from functools import cached_property

from meshes.tetmesh import Floats
from simple_model import Response, lines, tacton_lines, told_apart
from skinwave.scene import Scene


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """One Tacton on one body, answered by one model."""

    tacton: str
    body: str
    scene: Scene
    response: Response

    @property
    def model(self) -> str:
        """The model that answered."""
        return self.response.model

    @property
    def column(self) -> str:
        """What tables and figures know it by: its body or, of a point kernel, the model."""
        return self.model if self.body == "none" else self.body

    @cached_property
    def frequencies(self) -> dict[str, float]:
        """Names and frequencies in Hz of the Tacton's lines, but for those of `untold`."""
        return {n: f for n, f in self.possible.items() if n not in self.untold}

    @cached_property
    def untold(self) -> tuple[str, ...]:
        """Names of lines that the response is too short to tell from 0 Hz or from each other."""
        told = told_apart(self.response, list(self.possible.values()))
        return tuple(n for n, is_told in zip(self.possible, told, strict=True) if not is_told)

    @cached_property
    def possible(self) -> dict[str, float]:
        """Names and frequencies in Hz of all lines below half the sampling rate."""
        nyquist = 0.5 / self.response.times[1]
        return {n: f for n, f in tacton_lines(self.scene.tacton).items() if f < nyquist}

    @cached_property
    def lines(self) -> dict[str, Floats]:
        """Amplitudes (p,) of the Tacton's lines, in the unit of the response."""
        # Those that cannot be told are fitted too, so that they do not leak into the others.
        fitted = lines(self.response, list(self.possible.values()))
        found = dict(zip(self.possible, fitted, strict=True))
        return {name: found[name] for name in self.frequencies}

    @property
    def is_am(self) -> bool:
        """Whether the amplitude is modulated."""
        return self.scene.tacton.am_frequency > 0

    @property
    def is_stm(self) -> bool:
        """Whether the focus moves."""
        return self.scene.tacton.trajectory.drawing_frequency > 0
