"""The paper's bounds, printed and valid, with their hypotheses, beside what a run shows.

It imports `exact`, `excitation`, `runs` and what is below.
"""
