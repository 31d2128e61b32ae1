"""Scenes: what is commanded, on which body, and where it is probed; their files."""
