"""The benchmark: frozen suites, trials of every diagnoser under every stimulus, scores and pages."""
