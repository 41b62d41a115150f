"""The posterior of a Bayesian observer who knows the simulator: particles of faults, offline."""
