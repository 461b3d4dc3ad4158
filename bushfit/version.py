"""The version of bushfit."""

__version__ = "0.1.0"
