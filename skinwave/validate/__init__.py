"""Models beside published measurements: what each source found, what a model predicts, how far apart."""
