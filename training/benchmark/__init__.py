"""The benchmark: suites, trials of every diagnoser under every stimulus, scores, pages."""
