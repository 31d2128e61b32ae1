"""Benchmarks and comparisons with other codes; tests assert none of these numbers."""
