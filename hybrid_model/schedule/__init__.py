"""Blocks that meet only at events, the queue of their predicted events, and networks run by it.

The scheduler knows automata and FMUs as blocks alone; blocks of automata run on `reference`.
It imports that room and those below.
"""
