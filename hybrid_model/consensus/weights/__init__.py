"""Weights of edges as functions of time, and as automata: one file a kind, and a line for it in `kinds`.

It imports `switching` and `clocks`; scenarios are made of it.
"""
