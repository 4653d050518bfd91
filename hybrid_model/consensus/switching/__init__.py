"""Which edges are active when, as data and as automata: cyclic, by lists, at random; joint connectivity over time.

It imports `clocks` and `graphs`; weights and scenarios are made with it.
"""
