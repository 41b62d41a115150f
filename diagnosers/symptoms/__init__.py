"""Symptoms that rules and limits look at: residuals of the physics and faults of sensors."""
