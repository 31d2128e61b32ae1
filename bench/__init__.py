"""Measurements against what a user would pick instead; nothing here is asserted in tests."""
