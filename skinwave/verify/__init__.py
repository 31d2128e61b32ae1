"""Verification of finite elements and wavenumber integrals against independent references."""
