"""Functions of time: which interval or row of a clock holds a time, and when it ends; periods, domains.

It imports nothing else of `consensus`.
"""
