"""Verification: what finite elements and exact waves must reproduce, from outside this project."""
