"""Calibration: constants, healthy band and noise of a vehicle, fitted to its healthy logs."""
