"""Lines by name, of a model or of a measurement, as claims are assessed by."""

from typing import Protocol

from meshes.tetmesh import Floats
from skinwave.scene.scene import Scene


class NamedLines(Protocol):
    """Lines by name that claims are assessed by: of a `Run`, or of a measurement."""

    @property
    def tacton(self) -> str:
        """Name of the Tacton."""

    @property
    def scene(self) -> Scene:
        """The scene, whose load has the lines."""

    @property
    def places(self) -> Floats:
        """Places (p, 2) in metre."""

    @property
    def frequencies(self) -> dict[str, float]:
        """Frequencies in Hz by name."""

    @property
    def lines(self) -> dict[str, Floats]:
        """Amplitudes (p,) by name."""

    @property
    def unresolved(self) -> tuple[str, ...]:
        """Names of unresolved lines."""

    @property
    def spectrum(self) -> tuple[Floats, Floats]:
        """Frequencies (f,) in Hz and amplitudes (f, p)."""

    @property
    def is_am(self) -> bool:
        """Whether the amplitude is modulated."""

    @property
    def is_stm(self) -> bool:
        """Whether the focus moves."""

    @property
    def is_motion(self) -> bool:
        """Whether they are of displacement."""
