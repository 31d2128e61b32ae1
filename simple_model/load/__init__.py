"""The load: Tactons, trajectories, focal spots, the moving pressure and its spectral lines."""
