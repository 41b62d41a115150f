"""Published data of real vehicles, read strictly from the folder of the data."""
