"""Networks of the diagnosers: layers, features, smoothing and fault maps."""
