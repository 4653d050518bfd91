"""Usual compositions: product, series, parallel and feedback, by name and by operators.

It imports the rest of `hybrid_model.declare`, and none of that imports it.
"""
