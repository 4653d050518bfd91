"""Graphs and their matrices: incidence, Laplacians, spanning trees, families by name.

It imports `consensus.messages` only.
"""
