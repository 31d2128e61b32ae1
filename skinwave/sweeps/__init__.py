"""Many scenes in one table."""
