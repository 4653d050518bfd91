"""Scenarios: checked data, and the TOML files that they are read from.

It imports `weights` and `graphs`; nothing here runs.
"""
