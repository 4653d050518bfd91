"""Whether samples are a hybrid arc of an automaton: a verifier that uses nothing of the engines.

It imports `declare` and `record`.
"""
