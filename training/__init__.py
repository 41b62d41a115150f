"""Scripts around environment and diagnosers: reproduction, simulation, training, benchmark, command line."""
