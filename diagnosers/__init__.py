"""Diagnosers of propulsion faults, and the filters that feed them."""
