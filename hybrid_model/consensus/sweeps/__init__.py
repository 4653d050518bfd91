"""Sweeps: many runs of one scenario with other values under its keys, each a row of a table in a file.

Axes and designs say which runs, a study says what is taken from each, a table keeps the rows, and executors run them.
It imports `certificates`, `runs`, `laws`, `scenario` and what is below.
"""
