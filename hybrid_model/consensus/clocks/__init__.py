"""Clocks of weights, switching and triggers: which interval or row holds a time, and when it ends; common periods.

It imports nothing else of `consensus`.
"""
