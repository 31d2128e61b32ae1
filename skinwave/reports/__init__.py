"""Pages of results, one HTML file each."""
