"""What a scene requires, and how wrong an answer will be."""
