"""Results: motion of surfaces, maps, comparison, claims, and the folders that hold them."""
