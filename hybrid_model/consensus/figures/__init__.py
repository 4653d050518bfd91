"""Figures of runs and certificates, as files.

It imports all other rooms of `consensus`.
"""
