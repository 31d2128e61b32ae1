"""Plans: the model and mesh that a scene requires, and the expected error of its response."""
