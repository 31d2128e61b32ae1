"""Wavenumber integrals."""

from simple_model import flat_body, steady_state

EXACT = {"flat-body": flat_body, "flat-body-harmonic": steady_state}  # by wavenumber integral
