"""Pattern files of other programs: AdapTics, focal-point CSV, WAV, AUTD3."""

from skinwave.patterns.conversion import READERS, WRITERS, convert, read_pattern, write_pattern
from skinwave.patterns.pattern import Options, Pattern, onto

__all__ = [
    "READERS",
    "WRITERS",
    "Options",
    "Pattern",
    "convert",
    "onto",
    "read_pattern",
    "write_pattern",
]
