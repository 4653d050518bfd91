"""Weights of edges as functions of time, and as automata: one file a kind, and a line for it in `kinds`.

It imports `switching`, `clocks`, `graphs` and the reader of entries; scenarios are made of it.
"""
