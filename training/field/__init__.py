"""Tools for a real vehicle: its file, its logs, its calibration and its diagnosis."""
