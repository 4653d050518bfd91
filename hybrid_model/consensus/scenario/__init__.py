"""Scenarios: checked data, and the TOML files that they are read from.

It imports `weights`, `switching` and `graphs`; nothing here runs.
"""
