"""Persistence of excitation: the constants of a network's weights, of one topology and of switching ones.

It imports `scenario` and what is below.
"""
