"""Models that answer on a body: built, prepared, marched."""
