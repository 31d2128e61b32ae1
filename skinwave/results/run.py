"""Response of one model to a scene, and its lines by name."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from simple_model import LineTable, Response, Unnamed, line_table, spectrum
from simple_model.load.line_names import SAME_LINE, line_frequency
from skinwave.scene.scene import Scene
from skinwave.typing import Floats

# Lines that claims are about, of one focus, whether or not the load has them.
ASSESSED = (
    "f_AM", "2f_AM", "3f_AM", "4f_AM", "5f_AM", "f_d", "2f_d", "3f_d",
    "f_d-f_AM", "f_d+f_AM", "2f_d-f_AM", "2f_d+f_AM",
)  # fmt: skip

SUPPORT = "f_support"  # the line of a support that moves


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """One Tacton on one body by one model; the lines of its response are those of its load."""

    tacton: str
    body: str
    scene: Scene
    response: Response

    @property
    def model(self) -> str:
        """The model of the response."""
        return self.response.model

    @property
    def column(self) -> str:
        """Name in tables and figures: its body or, of a point kernel, the model."""
        return self.model if self.body == "none" else self.body

    @cached_property
    def table(self) -> LineTable:
        """All lines of the response, each once."""
        candidates = ASSESSED if len(self.scene.tacton.foci) == 1 else ()
        beside = lines_beside(self.scene, self.response)
        return line_table(
            self.scene.pressure, self.response, candidates=candidates, other_lines=beside
        )

    @property
    def listed(self) -> dict[str, float]:
        """Names and frequencies in Hz of the resolved lines of the load, each once."""
        return self.table.frequencies

    @property
    def unnamed(self) -> tuple[Unnamed, ...]:
        """Other spectral peaks above -40 dB, such as a free vibration."""
        return self.table.unnamed

    @cached_property
    def frequencies(self) -> dict[str, float]:
        """Frequencies in Hz by name; of lines that coincide, by each name that claims are about."""
        return {name: self.listed[own] for name, own in self._own.items()}

    @cached_property
    def lines(self) -> dict[str, Floats]:
        """Amplitudes (p,) by the names of `frequencies`, in the unit of the response."""
        return {name: self.table.amplitudes[own] for name, own in self._own.items()}

    @cached_property
    def spectrum(self) -> tuple[Floats, Floats]:
        """Frequencies (f,) in Hz and amplitudes (f, p) of the whole response."""
        return spectrum(self.response)

    @property
    def places(self) -> Floats:
        """The probes (p, 2) in metre."""
        return self.response.probes

    @property
    def unresolved(self) -> tuple[str, ...]:
        """Names of lines too close to 0 Hz or to each other for the length of the response."""
        return tuple(self.table.unresolved)

    @cached_property
    def _own(self) -> dict[str, str]:
        return own_names(self.scene, self.listed)

    @property
    def is_motion(self) -> bool:
        """Whether it is the displacement of a body's surface."""
        return self.scene.reading.is_plain and self.response.record.of_body

    @property
    def is_skin(self) -> bool:
        """Whether it is the motion of skin, of which alone thresholds of detection are known."""
        return self.is_motion and self.scene.body.is_skin

    @property
    def is_am(self) -> bool:
        """Whether the amplitude is modulated."""
        return self.scene.tacton.am_frequency > 0

    @property
    def is_stm(self) -> bool:
        """Whether the focus moves."""
        return self.scene.tacton.trajectory.drawing_frequency > 0


def lines_beside(scene: Scene, response: Response) -> dict[str, float]:
    """Names and frequencies in Hz of what moves a response's body beside the pressure."""
    motion = scene.load.support_motion
    return {SUPPORT: motion.frequency} if motion and response.record.of_body else {}


def own_names(scene: Scene, listed: Mapping[str, float]) -> dict[str, str]:
    """Listed names, with frequencies in Hz, by themselves and each name that claims are about."""
    same = SAME_LINE / scene.tacton.duration
    own = {name: name for name in listed}
    for name in ASSESSED:
        f = line_frequency(scene.tacton, name)
        near = [] if f is None else [n for n, g in listed.items() if abs(f - g) <= same]
        own |= {name: near[0]} if near else {}
    return own
