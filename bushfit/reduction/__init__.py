"""Reduction of raw histories: cycles and steps to operating points."""
