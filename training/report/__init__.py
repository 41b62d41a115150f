"""Run folders and self-contained pages of reports, for all commands and studies."""
