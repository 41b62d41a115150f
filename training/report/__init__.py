"""Run folders and self-contained report pages, shared by all commands and studies."""
