"""Campaigns: one bushing and its tests, read from a TOML file."""
