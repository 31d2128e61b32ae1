"""Basics of commands and records: pages, processes, text, and progress."""
