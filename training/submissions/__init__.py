"""Scores of submitted diagnosers on suites that nobody knew before, and the page of them."""
