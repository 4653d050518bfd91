"""Agents, event generators, channels, and the closed loop made of them.

It imports `scenario` and `weights`.
"""
