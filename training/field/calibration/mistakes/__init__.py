"""Mistakes in the vehicle file and in the choice of healthy logs, found before the fit."""
