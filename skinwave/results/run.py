"""Runs: the response of one model to a scene, and its lines by name."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from simple_model import LineTable, Response, Unnamed, line_table, sensation_level, spectrum
from simple_model.line_table import lines_in_pulses
from simple_model.load.line_names import SAME_LINE, line_frequency
from skinwave.scene.scene import Scene
from skinwave.typing import Floats

# Lines of one focus that claims are about, whether or not the load has them.
ASSESSED = (
    "f_AM", "2f_AM", "3f_AM", "4f_AM", "5f_AM", "f_d", "2f_d", "3f_d",
    "f_d-f_AM", "f_d+f_AM", "2f_d-f_AM", "2f_d+f_AM",
)  # fmt: skip

SUPPORT = "f_support"  # line of a moving support


class OfTacton:
    """Properties of the Tacton in a scene."""

    scene: Scene

    @property
    def is_am(self) -> bool:
        """Whether the amplitude is modulated."""
        return self.scene.tacton.am_frequency > 0

    @property
    def is_stm(self) -> bool:
        """Whether the focus moves."""
        return self.scene.tacton.trajectory.drawing_frequency > 0


@dataclass(frozen=True, kw_only=True, eq=False)
class Run(OfTacton):
    """Response of one model to one Tacton on one body, with the lines of the load."""

    tacton: str
    body: str
    scene: Scene
    response: Response

    @property
    def model(self) -> str:
        """Name of the model."""
        return self.response.model

    @property
    def column(self) -> str:
        """Name in tables and figures: the body, or the model of a point kernel."""
        return self.model if self.body == "none" else self.body

    @cached_property
    def table(self) -> LineTable:
        """All lines of the response, each once."""
        motion = self.scene.load.support_motion
        support = {SUPPORT: motion.frequency} if motion and self.response.record.of_body else {}
        return line_table(
            self.scene.pressure, self.response, candidates=self._assessed, other_lines=support
        )

    @cached_property
    def in_pulses(self) -> LineTable:
        """Lines while a pulse is on, by which levels are defined; see `lines_in_pulses`."""
        if self.scene.tacton.rhythm is None:
            return self.table
        return lines_in_pulses(self.scene.pressure, self.response, candidates=self._assessed)

    @cached_property
    def levels(self) -> dict[str, Floats]:
        """Sensation levels (p,) in dB of the lines while a pulse is on; empty unless on skin."""
        if not self.is_skin:
            return {}
        lines = self.in_pulses
        own = own_names(self.scene, lines.frequencies)
        return {
            name: sensation_level(lines.amplitudes[line], lines.frequencies[line])
            for name, line in own.items()
        }

    @property
    def _assessed(self) -> tuple[str, ...]:
        return ASSESSED if len(self.scene.tacton.foci) == 1 else ()

    @property
    def line_hz(self) -> dict[str, float]:
        """Frequencies in Hz of the resolved lines of the load by name, each line once."""
        return self.table.frequencies

    @property
    def unnamed(self) -> tuple[Unnamed, ...]:
        """Other spectral peaks above -40 dB, such as a free vibration."""
        return self.table.unnamed

    @cached_property
    def frequencies(self) -> dict[str, float]:
        """Frequencies in Hz by name; a line is listed under every name that claims use for it."""
        return {name: self.line_hz[own] for name, own in self._own.items()}

    @cached_property
    def lines(self) -> dict[str, Floats]:
        """Amplitudes (p,) in the unit of the response, by the names of `frequencies`."""
        return {name: self.table.amplitudes[own] for name, own in self._own.items()}

    @cached_property
    def spectrum(self) -> tuple[Floats, Floats]:
        """Frequencies (f,) in Hz and amplitudes (f, p) of the whole response."""
        return spectrum(self.response)

    @property
    def places(self) -> Floats:
        """Places (p, 2) of the probes in m."""
        return self.response.probes

    @property
    def unresolved(self) -> tuple[str, ...]:
        """Names of lines too close to 0 Hz or to each other to be resolved in the response."""
        return tuple(self.table.unresolved)

    @cached_property
    def _own(self) -> dict[str, str]:
        return own_names(self.scene, self.line_hz)

    @property
    def is_motion(self) -> bool:
        """Whether the response is the displacement of a body's surface."""
        return self.scene.reading.is_plain and self.response.record.of_body

    @property
    def is_skin(self) -> bool:
        """Whether the response is the motion of skin, for which detection thresholds are known."""
        return self.is_motion and self.scene.body.is_skin


def own_names(scene: Scene, listed: Mapping[str, float]) -> dict[str, str]:
    """Return the name in `listed` of each name of a line.

    Listed names map to themselves, names in `ASSESSED` to the listed line at the same frequency.
    """
    same = SAME_LINE / scene.tacton.duration
    own = {name: name for name in listed}
    for name in ASSESSED:
        f = line_frequency(scene.tacton, name)
        near = [] if f is None else [n for n, g in listed.items() if abs(f - g) <= same]
        own |= {name: near[0]} if near else {}
    return own
