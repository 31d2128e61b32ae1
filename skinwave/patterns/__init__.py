"""Pattern files of other programs: AdapTics, focal-point CSV, WAV, AUTD3, and own formats."""

from skinwave.patterns.conversion import convert, read_pattern, write_pattern
from skinwave.patterns.pattern import Options, Pattern, onto

__all__ = [
    "Options",
    "Pattern",
    "convert",
    "onto",
    "read_pattern",
    "write_pattern",
]
