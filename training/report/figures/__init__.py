"""Figures of the reports: functions that take data and return a Matplotlib figure."""
