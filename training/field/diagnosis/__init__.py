"""Diagnosis of the logs and of the live stream of a real vehicle."""
