"""Training of the networks of diagnosers and of the stimulus policies."""
