"""Models of a body: meshed, reduced, integrated in time or solved line by line."""
