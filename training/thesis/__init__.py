"""The thesis' test runs and networks, reproduced."""
