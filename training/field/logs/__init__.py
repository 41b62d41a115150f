"""Logs of real vehicles: files and streams, read into samples of the channels."""
