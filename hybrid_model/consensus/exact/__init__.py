"""Exact numbers of the linear edge domain: rates, gains, reachable sets, worst cases.

It imports `excitation`, `scenario` and what is below, and python-control by way of `hybrid_model.linear`.
"""
