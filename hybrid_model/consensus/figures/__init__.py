"""Figures of runs and certificates, as files.

It imports `certificates`, `runs`, `laws` and `scenario`, and draws with `hybrid_model.plots`.
"""
