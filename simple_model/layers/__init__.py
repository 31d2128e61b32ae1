"""Material laws, and wavenumber integrals and dispersion curves of flat layers."""
