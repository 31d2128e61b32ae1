"""One answer beside the scene that it answers, and its lines by name."""

from dataclasses import dataclass
from functools import cached_property

from meshes.tetmesh import Floats
from simple_model import Response, lines, tacton_lines
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

    @cached_property
    def frequencies(self) -> dict[str, float]:
        """Names and frequencies in Hz of the Tacton's lines."""
        nyquist = 0.5 / self.response.times[1]
        return {n: f for n, f in tacton_lines(self.scene.tacton).items() if f < nyquist}

    @cached_property
    def lines(self) -> dict[str, Floats]:
        """Amplitudes (p,) of the Tacton's lines, in the unit of the response."""
        found = self.frequencies
        return dict(zip(found, lines(self.response, list(found.values())), strict=True))

    @property
    def is_am(self) -> bool:
        """Whether the amplitude is modulated."""
        return self.scene.tacton.am_frequency > 0

    @property
    def is_stm(self) -> bool:
        """Whether the focus moves."""
        return self.scene.tacton.trajectory.drawing_frequency > 0
