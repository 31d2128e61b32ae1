"""Uncertain numbers of a scene: samples, bands, and which of them matters."""
