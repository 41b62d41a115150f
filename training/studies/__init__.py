"""Studies: ``python -m training.studies.NAME`` measures one question and writes a report."""
