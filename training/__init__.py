"""Around environment and diagnosers: simulation, training, benchmark, studies, command line."""
