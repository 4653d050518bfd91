"""From an automaton to C: maps traced once with symbols, their derivatives, and C code of both.

The one room that imports CasADi. It imports `declare` and the numbers of `scales`; the C engine
that its code feeds is in `hybrid_model/engine`.
"""
