"""Tactons, the load that they put on the skin, and all models without a mesh."""

from simple_model.layers.flat_body import flat_body, steady_state
from simple_model.layers.material import (
    Material,
    Orthotropy,
    from_young,
    of_law,
    orthotropic,
    tabulated,
)
from simple_model.layers.modulus_laws import (
    MODULUS_LAWS,
    FractionalKelvinVoigt,
    FractionalZener,
    ModulusTable,
    modulus_table,
)
from simple_model.layers.prony import PronySeries, PronyTerm, fit_prony
from simple_model.layers.stack import Stack
from simple_model.line_table import LineTable, Unnamed, line_table, resolved_lines
from simple_model.load.drive import DRIVES, DriveLaw
from simple_model.load.focus import array_field, focal_spot, relative_intensity
from simple_model.load.line_names import named_lines
from simple_model.load.pressure import MovingPressure
from simple_model.load.rhythm import Rhythm, Signal
from simple_model.load.tacton import (
    SUPERPOSITIONS,
    Tacton,
    commanded_signal,
    modulation,
    pattern_period,
)
from simple_model.load.trajectory import SHAPES, Trajectory, even_phases, joined
from simple_model.point_kernel import point_kernel, point_kernel_published, published_load
from simple_model.response import Effort, Response, are_resolved, lines, phasors, spectrum
from simple_model.statement import ErrorPart, Statement
from simple_model.threshold import sensation_level, threshold

__all__ = [
    "DRIVES",
    "MODULUS_LAWS",
    "SHAPES",
    "SUPERPOSITIONS",
    "DriveLaw",
    "Effort",
    "ErrorPart",
    "FractionalKelvinVoigt",
    "FractionalZener",
    "LineTable",
    "Material",
    "ModulusTable",
    "MovingPressure",
    "Orthotropy",
    "PronySeries",
    "PronyTerm",
    "Response",
    "Rhythm",
    "Signal",
    "Stack",
    "Statement",
    "Tacton",
    "Trajectory",
    "Unnamed",
    "are_resolved",
    "array_field",
    "commanded_signal",
    "even_phases",
    "fit_prony",
    "flat_body",
    "focal_spot",
    "from_young",
    "joined",
    "line_table",
    "lines",
    "modulation",
    "modulus_table",
    "named_lines",
    "of_law",
    "orthotropic",
    "pattern_period",
    "phasors",
    "point_kernel",
    "point_kernel_published",
    "published_load",
    "relative_intensity",
    "resolved_lines",
    "sensation_level",
    "spectrum",
    "steady_state",
    "tabulated",
    "threshold",
]
