"""Inspection of test files before a campaign lists them: their contents, how bushfit reads them, and oddities."""
