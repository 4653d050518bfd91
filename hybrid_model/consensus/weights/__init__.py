"""Weights of edges and switching as functions of time, and as automata.

It imports `graphs`; scenarios are made of it.
"""
