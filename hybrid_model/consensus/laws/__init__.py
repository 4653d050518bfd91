"""Agents, event generators, channels, and the closed loop made of them.

It imports `scenario`, `weights`, `switching` and `clocks`.
"""
