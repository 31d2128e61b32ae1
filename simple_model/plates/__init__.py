"""Thin plates: modes, the air on them, sheet waves and large deflection."""
