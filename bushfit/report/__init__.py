"""The report: tables and pictures of what was found, written to a folder whole or not at all."""
