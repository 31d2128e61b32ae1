"""Pattern files of other programs: AdapTics, focal-point CSV, WAV, AUTD3, and own formats."""

from skinwave.patterns.conversion import convert, read_pattern, write_pattern
from skinwave.patterns.pattern import Format, Options, Pattern, onto, register

__all__ = [
    "Format",
    "Options",
    "Pattern",
    "convert",
    "onto",
    "read_pattern",
    "register",
    "write_pattern",
]
