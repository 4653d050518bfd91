"""What a run leaves: flows, jumps, hybrid arcs, and their files, samples and tables.

Every execution writes it, and figures and the verifier read it. It imports `declare` and `stop`.
"""
