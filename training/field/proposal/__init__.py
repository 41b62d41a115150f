"""Proposal of a vehicle file from the columns of a log."""
